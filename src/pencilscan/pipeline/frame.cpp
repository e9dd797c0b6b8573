#include "pencilscan/pipeline/frame.h"

#include <algorithm>
#include <utility>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/pipeline/coarse_view.h"
#include "pencilscan/pipeline/disagreement_warnings.h"
#include "pencilscan/pipeline/frame_warnings.h"
#include "pencilscan/pipeline/light_warnings.h"
#include "pencilscan/pipeline/line_contrast.h"
#include "pencilscan/pipeline/line_naming.h"
#include "pencilscan/pipeline/sensor_frame.h"
#include "pencilscan/surface/manifold.h"

namespace pencilscan {
namespace {

/// The frame without the cameras that were left out: their plain pictures are as wrong.
Frame without(Frame frame, const std::vector<char>& left_out) {
  for (std::size_t c = 0; c < left_out.size(); ++c) {
    if (left_out[c] == 0) continue;
    for (auto* pictures : {&frame.images, &frame.plain})
      if (c < pictures->size()) (*pictures)[c] = cv::Mat();
  }
  return frame;
}

/// Why a frame has no points: wrong pictures, else their light.
std::string why_nothing(const Rig& rig, const PointResult& result) {
  const std::string why = "no curve could be given its projector line";
  std::string of_pictures;
  for (const Warning& warning : result.warnings)
    if (warning.code == WarningCode::kWrongPicture) of_pictures += "; " + warning.text;
  if (!of_pictures.empty()) return why + of_pictures;
  const double light = signal_to_noise(rig, result);
  if (light == 0)
    return why + "; no picture shows a line: are the projectors on, and is their light enough?";
  return why + "; lines are " + formatted(light, "%.1f") +
         " times as bright as the noise of the pictures (median)";
}

/// True where what lies in the volume is no more than wrong names among the room's lines make.
bool shows_room_alone(const PointResult& result) {
  // Before walls alone up to .06 % of the points lay in the volume (docs/sensors.md). Chosen: eight
  // times as many, since rooms differ. A smaller object needs a smaller picture of the room.
  constexpr double kWrong = 0.005;
  return !result.background.empty() && static_cast<double>(result.points.size()) <
                                           kWrong * static_cast<double>(result.background.size());
}

/// Of a frame that does so.
std::string why_room_alone(const PointResult& result) {
  return "nothing of the object was seen: of the points on lines that could be named, " +
         std::to_string(result.background.size()) + " lie outside the volume or on the floor, " +
         std::to_string(result.points.size()) +
         " in the volume, no more than wrong names make: is the object in the volume that the rig "
         "states?";
}

/// From what margins in the pictures say to how often labels are right.
void state_confidence(const PointOptions& options, PointResult& result) {
  if (!solution_method(options.method).capabilities.may_be_guided) return;
  for (std::size_t i = 0; i < result.points.size(); ++i) {
    float& confidence = result.points[i].confidence;
    confidence = result.is_on_surface ? confidence_on_surface(result.evidence[i])
                                      : confidence_on_lines(confidence);
  }
}

/// What of each camera's lines has a name; empty where the solution does not say what has none.
std::vector<TellingPoints> telling_by_camera(const Labeling& labeling) {
  std::vector<TellingPoints> telling;
  for (std::size_t c = 0; c < labeling.undecided.size(); ++c)
    telling.push_back(telling_points(labeling, c));
  return telling;
}

/// What is done once no line's name changes any more.
void end_points(const Rig& rig, const Frame& frame, const PointOptions& options,
                PointResult& result) {
  state_confidence(options, result);
  Rig above = rig;  // what a floor's lines do is said of the floor
  if (result.floor) above.floor = result.floor->floor;
  const CutLines lines = cut_lines(above, result.graphs, result.labeling);
  if (auto warning = volume_warning(rig, lines)) result.warnings.push_back(std::move(*warning));
  if (auto warning = floor_cut_warning(rig, lines)) result.warnings.push_back(std::move(*warning));
  if (auto warning = few_names_warning(result)) result.warnings.push_back(std::move(*warning));
  let_gamma_explain(result.warnings);
  let_focus_explain(result.warnings);
  restore_light(frame, result);
}

}  // namespace

bool has_pictures(const Frame& frame) {
  return !std::all_of(frame.images.begin(), frame.images.end(),
                      [](const cv::Mat& image) { return image.empty(); });
}

void restore_light(const Frame& frame, PointResult& result) {
  for (std::size_t c = 0; c < frame.gains.size(); ++c) {
    for (Curve& curve : result.graphs[c].curves)
      for (CurvePoint& point : curve.points) point.amplitude /= frame.gains[c];
  }
}

FrameResult reconstruct_frame(const Rig& stated, const Frame& frame, const FrameOptions& options,
                              const FrameLinks& links) {
  if (!has_pictures(frame)) throw NothingFound("no camera of the rig has a picture of this moment");
  std::vector<StageTime> times;
  const StageClock clock(links.progress, times);
  const SensorFrame fine = sensor_frame(in_footprints(stated), frame);
  const auto coarse = coarse_view(fine.rig, fine.frame, options);
  const Rig& rig = coarse ? coarse->rig : fine.rig;
  const Frame& seen = coarse ? coarse->frame : fine.frame;
  const FrameOptions& how = coarse ? coarse->options : options;
  PointResult curves = detect_frame(rig, seen, how.points, clock);
  curves = check_pictures(rig, seen, std::move(curves));
  PointResult lines = solve_frame(rig, seen, std::move(curves), how.points, clock);
  FrameResult result = measure_frame(rig, seen, std::move(lines), how, links, clock);
  if (coarse) result = in_fine_pixels(*coarse, std::move(result));
  result.times = std::move(times);
  return in_unit_of(stated, std::move(result));
}

FrameResult measure_frame(const Rig& rig, const Frame& frame, PointResult lines,
                          const FrameOptions& options, const FrameLinks& links,
                          const StageClock& clock) {
  FrameResult result;
  const bool looks_again = options.meshes && options.shape.depth.enabled && !lines.corrected;
  result.points = place_points(
      rig, std::move(lines), looks_again ? before_surface(options.points) : options.points, clock);
  if (shows_room_alone(result.points)) throw NothingFound(why_room_alone(result.points));
  if (result.points.points.empty()) throw NothingFound(why_nothing(rig, result.points));
  if (!options.meshes) {
    end_points(rig, frame, options.points, result.points);
    return result;
  }
  const Frame right = without(frame, result.points.left_out);
  result.shape = measure_shape(rig, right, result.points, options.shape, links, clock);
  if (links.only_hands_on) return result;
  const std::vector<TellingPoints> named = telling_by_camera(result.points.labeling);
  result = match_on_surface(rig, std::move(result), options.points, clock);
  if (result.points.is_on_surface) {
    for (Warning& warning : missing_lines_warnings(rig, result.points.labeling.expected, named))
      result.points.warnings.push_back(std::move(warning));
  }
  clock("confirmation",
        [&] { result = finish_shape(rig, std::move(result), options.shape.fusion); });
  end_points(rig, frame, options.points, result.points);
  if (auto warning = little_light_warning(rig, result.points))
    result.points.warnings.push_back(std::move(*warning));
  if (auto warning = depth_warning(result.shape.depth.report.consistency, result.points.warnings))
    result.points.warnings.push_back(std::move(*warning));
  return count_motion(rig, std::move(result));
}

Rig in_footprints(const Rig& rig) {
  return with_registered_patterns(scaled(rig, 1 / footprint(rig)));
}

PointResult detect_frame(const Rig& rig, const Frame& frame, const PointOptions& options,
                         const StageClock& clock) {
  PointResult result;
  const std::size_t cameras = rig.cameras.size();
  result.families = color_families(rig);
  result.detections.resize(cameras);
  result.graphs.resize(cameras);
  result.left_out.assign(cameras, 0);
  clock("detection", [&] {
    parallel_for(cameras, [&](std::size_t c) {
      if (frame.images[c].empty() || rig.cameras[c].sees_texture_only) return;
      result.detections[c] =
          detect_curves(rig.cameras[c], rig, result.families, frame.images[c], options.detection);
    });
    result.warnings = detection_warnings(rig, frame, result.families, result.detections);
  });
  clock("grid", [&] {
    GridOptions grid = options.grid;
    grid.identify = grid.identify && solution_method(options.method).capabilities.needs_identities;
    parallel_for(cameras, [&](std::size_t c) {
      result.graphs[c] = build_grid_graph(rig, result.families, static_cast<int>(c),
                                          std::move(result.detections[c].curves), grid);
      result.graphs[c].lit = lit_cells(rig, static_cast<int>(c), result.graphs[c].curves,
                                       result.detections[c].presence);
    });
  });
  return result;
}

FrameResult in_unit_of(const Rig& rig, FrameResult result) {
  const double unit = footprint(rig);
  const auto f = static_cast<float>(unit);
  for (MeasuredPoint& p : result.points.points) {
    for (float* length : {&p.x, &p.y, &p.z, &p.sigma}) *length *= f;
  }
  ShapeResult& shape = result.shape;
  scale_lengths(unit, shape);
  if (auto& found = result.points.floor) {
    found->floor.point *= unit;
    result.points.warnings.push_back(floor_warning(*found));
  }
  if (shape.motion.is_seen) result.points.warnings.push_back(motion_warning(rig, shape.motion));
  // Scaling and files round: what lay apart may lie at one place.
  separate_vertices(shape.surface.mesh);
  separate_vertices(shape.surface.measured);
  shape.scene.reset();
  return result;
}

}  // namespace pencilscan
