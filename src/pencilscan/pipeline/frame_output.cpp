#include "pencilscan/pipeline/frame_output.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/core.hpp>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/report/overlay.h"
#include "pencilscan/report/pictures.h"
#include "pencilscan/rig/camera_light.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {
namespace {

using nlohmann::ordered_json;

/// Rounded to six digits, so that the file stays readable; null when not finite.
ordered_json number(double value) {
  if (!std::isfinite(value)) return nullptr;
  if (value == 0) return 0.0;
  const double scale = std::pow(10.0, 5 - std::floor(std::log10(std::abs(value))));
  return std::round(value * scale) / scale;
}

/// Mean over all pixels and channels, of values in [0, 1].
double level_of(const Camera& camera, const cv::Mat& stored) {
  const cv::Mat image = camera_values(camera, stored);
  const cv::Scalar mean = cv::mean(image);
  double sum = 0;
  for (int k = 0; k < image.channels(); ++k) sum += mean[k];
  return sum / image.channels();
}

/// How far the crossings of each device miss each other; null where they are too few to tell.
ordered_json device_reports(const Rig& rig, const std::vector<CrossingDisagreement>& devices) {
  ordered_json reports = ordered_json::array();
  for (std::size_t d = 0; d < devices.size(); ++d) {
    reports.push_back({{"name", device_at(rig, d).name},
                       {"crossings", devices[d].crossings},
                       {"median_px", nullptr},
                       {"expected_px", nullptr}});
    if (are_enough(devices[d])) {
      reports.back()["median_px"] = number(devices[d].median_px);
      reports.back()["expected_px"] = number(devices[d].expected_px);
    }
    if (const auto& shift = devices[d].shift_px)
      reports.back()["shift_px"] = {number(shift->x()), number(shift->y())};
  }
  return reports;
}

/// Median height of the lines of each projector above their surroundings, in one camera; only where
/// the median is no chance. Which of two is dimmer, projector or camera, the height of all does not
/// tell.
ordered_json heights_by_projector(const Rig& rig, const GridGraph& graph,
                                  const std::vector<LabeledRun>& runs) {
  constexpr std::size_t kFewest = 30;  // points, as crossings in are_enough()
  std::vector<std::vector<float>> heights(rig.projectors.size());
  for (const LabeledRun& run : runs) {
    const auto& points = graph.curves[static_cast<std::size_t>(run.curve)].points;
    for (int i = run.begin; i < run.end; ++i) {
      heights[static_cast<std::size_t>(run.label.pattern.projector)].push_back(
          points[static_cast<std::size_t>(i)].amplitude);
    }
  }
  ordered_json report = ordered_json::object();
  for (std::size_t p = 0; p < heights.size(); ++p) {
    if (heights[p].size() >= kFewest)
      report[rig.projectors[p].name] = number(upper_median(std::move(heights[p])));
  }
  return report;
}

ordered_json camera_report(const Rig& rig, const Frame& frame, const PointResult& result,
                           std::size_t c) {
  const GridGraph& graph = result.graphs[c];
  std::size_t without_crossing = 0;
  std::vector<float> sigmas;
  std::vector<float> widths;
  std::vector<float> heights;
  for (std::size_t k = 0; k < graph.curves.size(); ++k) {
    without_crossing += graph.component_of_curve[k] < 0;
    for (const CurvePoint& p : graph.curves[k].points) {
      sigmas.push_back(p.sigma_px);
      widths.push_back(p.width_px);
      heights.push_back(p.amplitude);
    }
  }
  ordered_json report;
  report["name"] = rig.cameras[c].name;
  report["image"] = !frame.images[c].empty();
  report["curves"] = graph.curves.size();
  report["curve_points"] = sigmas.size();
  report["labelled_curve_points"] = labelled_points(result.labeling.runs[c]);
  report["curves_without_crossing"] = without_crossing;
  report["crossings"] = graph.crossings.size();
  report["components"] = graph.component_count;
  report["connections_cut"] = graph.cut_connections;
  if (!sigmas.empty()) {
    report["curve_sigma_median_px"] = number(upper_median(std::move(sigmas)));
    report["curve_width_median_px"] = number(upper_median(std::move(widths)));
    report["curve_height_median"] = number(upper_median(std::move(heights)));
    report["curve_height_by_projector"] = heights_by_projector(rig, graph, result.labeling.runs[c]);
  }
  if (!frame.images[c].empty())
    report["image_level"] = number(level_of(rig.cameras[c], frame.images[c]));
  if (frame.timing) {
    report["time_offset_us"] = number(frame.timing->offset_us[c]);
    report["late"] = static_cast<bool>(frame.timing->is_late[c]);
  }
  if (c < result.labeling.undecided.size()) {
    const auto points = undecided_points(result.labeling.undecided[c], result.labeling.runs[c]);
    report["undecided_points"] = {{"no_crossing", points[0]},
                                  {"ambiguous", points[1]},
                                  {"contradicted", points[2]},
                                  {"outside_volume", points[3]}};
  }
  report["saturated_pixels"] = result.detections[c].saturated_pixels;
  if (result.detections[c].joined_pixels > 1)
    report["joined_pixels"] = result.detections[c].joined_pixels;
  report["crosstalk_estimated"] = result.detections[c].unmixing.estimated;
  return report;
}

ordered_json component_report(const Rig& rig, const ComponentReport& component) {
  ordered_json report;
  report["camera"] = rig.cameras[static_cast<std::size_t>(component.camera)].name;
  report["curves"] = component.curves;
  report["crossings"] = component.crossings;
  report["solved"] = component.solved;
  if (!component.reason.empty()) report["reason"] = component.reason;
  if (component.sigma_min > 0) {
    report["sigma_min_px_per_line"] = number(component.sigma_min);
    report["sigma_second_px_per_line"] = number(component.sigma_second);
    report["residual_rms_px"] = number(component.residual_rms_px);
  }
  if (!component.sweep_s.empty()) {
    report["best_s_lines"] = number(component.best_s);
    report["margin"] = number(component.margin);
    report["sweep_first_s_lines"] = number(component.sweep_s.front());
    report["sweep_last_s_lines"] = number(component.sweep_s.back());
    // The curve is for a plot: at most 400 values, evenly picked.
    const std::size_t stride = 1 + component.sweep_cost.size() / 400;
    ordered_json cost = ordered_json::array();
    for (std::size_t i = 0; i < component.sweep_cost.size(); i += stride) {
      cost.push_back(number(component.sweep_cost[i]));
    }
    report["sweep_stride"] = stride;
    report["sweep_cost"] = cost;
  }
  return report;
}

/// Nodes of one camera by why they have no depth; the background is left out.
ordered_json hole_counts(const std::array<std::size_t, kHoleReasons>& nodes) {
  ordered_json counts;
  for (std::size_t k = 0; k < kHoleReasons; ++k) {
    const auto reason = static_cast<HoleReason>(k);
    if (reason == HoleReason::kBackground || reason == HoleReason::kNotSeen) continue;
    counts[to_string(reason)] = nodes[k];
  }
  return counts;
}

ordered_json depth_report(const Rig& rig, const DepthReport& depth, const HoleReport& holes) {
  ordered_json report;
  report["sigma_scale"] = number(depth.consistency.sigma_scale);
  if (const auto& shared = depth.consistency.shared_scale) report["shared_scale"] = number(*shared);
  report["nodes_unconfirmed"] = depth.consistency.unconfirmed;
  report["nodes_completed"] = depth.completed;
  report["nodes_contradicted"] = depth.consistency.contradicted;
  report["nodes_in_small_islands"] = depth.consistency.islands;
  report["cameras"] = ordered_json::array();
  for (std::size_t i = 0; i < depth.cameras.size(); ++i) {
    const CameraDepthReport& camera = depth.cameras[i];
    ordered_json entry = {{"name", rig.cameras[static_cast<std::size_t>(camera.camera)].name},
                          {"nodes_measured", camera.measured},
                          {"blur_px", number(camera.blur_px)},
                          {"sigma_median_mm", number(camera.sigma_median_mm)}};
    if (i < holes.nodes.size()) entry["nodes"] = hole_counts(holes.nodes[i]);
    report["cameras"].push_back(entry);
  }
  return report;
}

/// Every detected curve of a camera, by what the grid graph found, or else in pieces by the labels;
/// undecided ones have key -1.
std::vector<OverlayCurve> overlay_curves(const Rig& rig, const GridGraph& graph,
                                         const std::vector<LabeledRun>& runs, OverlayKey key) {
  std::vector<OverlayCurve> curves;
  const auto add = [&](std::size_t curve, int begin, int end, int value) {
    OverlayCurve overlay;
    overlay.key = value;
    for (int i = begin; i < end; ++i)
      overlay.points.push_back(graph.curves[curve].points[static_cast<std::size_t>(i)].position);
    curves.push_back(std::move(overlay));
  };
  if (!graph.identities.empty()) {
    for (std::size_t k = 0; k < graph.curves.size(); ++k) {
      const CurveIdentity& identity = graph.identities[k];
      const int value = !identity.pattern             ? -1
                        : key == OverlayKey::kLocalId ? identity.local_id
                                                      : identity.pattern->projector;
      add(k, 0, static_cast<int>(graph.curves[k].points.size()), value);
    }
    return curves;
  }
  auto run = runs.begin();
  for (std::size_t k = 0; k < graph.curves.size(); ++k) {
    const int end = static_cast<int>(graph.curves[k].points.size());
    int at = 0;
    for (; run != runs.end() && run->curve == static_cast<int>(k); ++run) {
      if (run->begin > at) add(k, at, run->begin, -1);
      const PatternRef& ref = run->label.pattern;
      const LinePattern& pattern = rig.projectors[static_cast<std::size_t>(ref.projector)]
                                       .patterns[static_cast<std::size_t>(ref.pattern)];
      add(k, run->begin, run->end,
          key == OverlayKey::kLocalId ? pattern.local_id(run->label.line) : ref.projector);
      at = run->end;
    }
    if (at < end) add(k, at, end, -1);
  }
  return curves;
}

ordered_json vector_report(const Vec3& v) {
  return ordered_json::array({number(v.x()), number(v.y()), number(v.z())});
}

ordered_json motion_report(const ExposureMotion& motion) {
  ordered_json report = {{"seen", motion.is_seen}, {"at_most_mm", number(motion.at_most)}};
  if (!motion.is_seen) return report;
  report["way_mm"] = number(motion.way);
  report["way_sigma_mm"] = number(motion.way_deviation);
  report["shift_mm"] = vector_report(motion.shift);
  report["turn_deg"] = vector_report(motion.turn * (180 / std::numbers::pi));
  report["pivot_mm"] = vector_report(motion.pivot);
  return report;
}

}  // namespace

nlohmann::ordered_json frame_report(const Rig& rig, const Frame& frame, const PointResult& points,
                                    const ShapeResult& shape) {
  ordered_json report;
  report["frame"] = frame.name;
  report["points"] = points.points.size();
  ordered_json per_projector = ordered_json::object();
  for (const Projector& projector : rig.projectors) per_projector[projector.name] = 0;
  for (const MeasuredPoint& p : points.points) {
    auto& count = per_projector[rig.projectors[p.projector].name];
    count = count.get<int>() + 1;
  }
  report["points_by_projector"] = per_projector;
  if (frame.timing) report["time_spread_us"] = number(frame.timing->spread_us);
  report["cameras"] = ordered_json::array();
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    report["cameras"].push_back(camera_report(rig, frame, points, c));
  }
  if (points.is_on_surface) report["points_contradicted"] = points.contradicted;
  if (points.crossings.crossings > 0) {
    report["crossing_disagreement"] = {{"crossings", points.crossings.crossings},
                                       {"median_px", number(points.crossings.median_px)},
                                       {"expected_px", number(points.crossings.expected_px)},
                                       {"devices", device_reports(rig, points.device_crossings)}};
  }
  report["components"] = ordered_json::array();
  for (const ComponentReport& component : points.labeling.components) {
    report["components"].push_back(component_report(rig, component));
  }
  if (!shape.depth.maps.empty())
    report["depth"] = depth_report(rig, shape.depth.report, shape.holes);
  if (shape.motion.is_judged) report["motion"] = motion_report(shape.motion);
  const SurfaceReport& s = shape.surface.report;
  report["surface"] = {{"status", to_string(s.status)},
                       {"points_used", s.points_used},
                       {"spacing_mm", number(s.spacing_mm)},
                       {"cells_across", 1 << s.depth},
                       {"vertices", s.vertices},
                       {"faces", s.faces},
                       {"boundary_edges", s.edges.boundary},
                       {"non_manifold_edges", s.edges.non_manifold},
                       {"self_intersections", s.self_intersections},
                       {"measured_share", number(s.measured_share)}};
  if (!shape.holes.vertices.empty()) {
    ordered_json& area = report["surface"]["area_mm2"];
    for (std::size_t k = 1; k < kHoleReasons; ++k)
      area[to_string(static_cast<HoleReason>(k))] = number(shape.holes.area_mm2[k]);
  }
  std::vector<Warning> warnings = points.warnings;
  warnings.insert(warnings.end(), s.warnings.begin(), s.warnings.end());
  report["warnings"] = ordered_json::array();
  report["findings"] = ordered_json::array();
  for (const Warning& warning : warnings) {
    report["warnings"].push_back(warning.text);
    ordered_json& finding = report["findings"].emplace_back();
    finding["code"] = to_string(warning.code);
    if (!warning.device.empty()) finding["device"] = warning.device;
    for (const auto& [name, value] : warning.figures) finding[name] = number(value);
    finding["text"] = warning.text;
  }
  if (!points.notes.empty()) report["notes"] = points.notes;
  return report;
}

void write_frame_pictures(const std::filesystem::path& folder, const Rig& rig, const Frame& frame,
                          const PointResult& points, const ShapeResult& shape) {
  std::vector<std::size_t> cameras;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    if (!frame.images[c].empty()) cameras.push_back(c);
  }
  parallel_for(cameras.size(), [&](std::size_t i) {
    const std::size_t c = cameras[i];
    const Camera& camera = rig.cameras[c];
    // Raw samples have no colours to draw on.
    const cv::Mat ground = displayable(camera.mosaic ? linear_light(camera, frame.images[c])
                                                     : camera_values(camera, frame.images[c]));
    const auto write_overlay = [&](OverlayKey key, const std::string& name,
                                   const std::string& ending) {
      OverlayOptions options;
      options.key_name = name;
      const Picture overlay = {
          camera.name + ending,
          draw_overlay(ground, overlay_curves(rig, points.graphs[c], points.labeling.runs[c], key),
                       options)};
      write_pictures(folder, {&overlay, 1});
    };
    write_overlay(OverlayKey::kLocalId, "local ID", "_local_id");
    write_overlay(OverlayKey::kProjector, "projector", "_projector");
  });
  FrameResults results{.rig = rig};
  results.points = points.points;
  results.used = shape.surface.used;
  if (!shape.surface.mesh.faces.empty()) results.mesh = &shape.surface.mesh;
  write_pictures(folder, make_pictures(results));
}

}  // namespace pencilscan
