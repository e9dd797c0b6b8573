#include "pencilscan/pipeline/frame.h"

#include <array>
#include <cstdio>
#include <utility>

#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"

namespace pencilscan {
namespace {

std::vector<std::string> detection_warnings(const Rig& rig, const Frame& frame,
                                            const std::vector<ColorFamily>& families,
                                            const std::vector<CameraDetection>& detections) {
  std::vector<std::string> warnings;
  for (const ColorFamily& family : families) {
    if (family.leakage <= 0.1) continue;
    std::string names;
    for (const std::string& color : family.colors) names += (names.empty() ? "" : "/") + color;
    warnings.push_back("the colours " + names +
                       " cannot be told apart from those of other projectors");
  }
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const Camera& camera = rig.cameras[c];
    if (camera.sees_texture_only) continue;
    const std::string who = "camera " + camera.name;
    if (frame.images[c].empty()) {
      warnings.push_back(who + " has no image in frame " + frame.name +
                         ": reconstructed without it");
      continue;
    }
    if (detections[c].curves.empty())
      warnings.push_back(who + ": no projected line was found in its image");
    const double saturated = static_cast<double>(detections[c].saturated_pixels) /
                             static_cast<double>(frame.images[c].total());
    if (saturated > 0.01) {
      warnings.push_back(who + ": " + std::to_string(static_cast<int>(100 * saturated)) +
                         " % of its pixels are saturated; lower exposure or gain");
    }
  }
  return warnings;
}

std::string disagreement_warning(const CrossingDisagreement& crossings) {
  std::array<char, 200> text{};
  std::snprintf(
      text.data(), text.size(),
      "crossing lines miss each other by %.2f projector pixels (median) where image noise "
      "explains %.2f: the rig's calibration is off; --refine-rig can correct it",
      crossings.median_px, crossings.expected_px);
  return text.data();
}

}  // namespace

PointResult detect_frame(const Rig& rig, const Frame& frame, const PointOptions& options) {
  PointResult result;
  result.families = color_families(rig);
  const std::size_t cameras = rig.cameras.size();

  Stopwatch detection_watch;
  result.detections.resize(cameras);
  parallel_for(cameras, [&](std::size_t c) {
    if (frame.images[c].empty() || rig.cameras[c].sees_texture_only) return;
    result.detections[c] =
        detect_curves(rig.cameras[c], rig, result.families, frame.images[c], options.detection);
  });
  result.warnings = detection_warnings(rig, frame, result.families, result.detections);
  result.times.push_back({"detection", detection_watch.seconds()});

  Stopwatch grid_watch;
  GridOptions grid = options.grid;
  // The joint solution decides pattern and line at once.
  grid.identify = grid.identify && options.solution.method != Method::kJoint;
  result.graphs.resize(cameras);
  parallel_for(cameras, [&](std::size_t c) {
    result.graphs[c] = build_grid_graph(rig, result.families, static_cast<int>(c),
                                        std::move(result.detections[c].curves), grid);
  });
  result.times.push_back({"grid", grid_watch.seconds()});
  return result;
}

PointResult measure_points(const Rig& rig, const Frame& frame, const PointOptions& options) {
  PointResult result = detect_frame(rig, frame, options);
  Stopwatch solution_watch;
  result.labeling = solve(rig, result.families, result.graphs, options.solution);
  result.times.push_back({"solution", solution_watch.seconds()});
  if (options.solution.method == Method::kJoint) {
    const auto tracks = crossing_tracks(rig, result.graphs, result.labeling);
    result.crossings = crossing_disagreement(rig, tracks);
    if (disagrees(result.crossings))
      result.warnings.push_back(disagreement_warning(result.crossings));
  }

  if (options.solution.method == Method::kJoint) {
    Stopwatch second_look_watch;
    std::vector<std::vector<cv::Mat>> presence;
    for (CameraDetection& detection : result.detections)
      presence.push_back(std::move(detection.presence));
    second_look(rig, result.families, presence, result.graphs, result.labeling,
                options.second_look);
    result.times.push_back({"second look", second_look_watch.seconds()});
  }

  Stopwatch triangulation_watch;
  result.points = triangulate(rig, result.graphs, result.labeling, options.triangulation);
  if (options.solution.method == Method::kJoint)
    result.points = settle_points(rig, result.points, options.settle);
  result.times.push_back({"triangulation", triangulation_watch.seconds()});
  return result;
}

ShapeResult measure_shape(const Rig& rig, const Frame& frame, const PointResult& points,
                          const ShapeOptions& options) {
  ShapeResult result;
  if (options.depth.enabled) {
    const Stopwatch depth_watch;
    std::vector<Unmixing> unmixings;
    for (const CameraDetection& detection : points.detections)
      unmixings.push_back(detection.unmixing);
    result.depth =
        measure_depth(rig, points.families, frame.images, unmixings, points.points, options.depth);
    result.times.push_back({"depth", depth_watch.seconds()});
    const Stopwatch surface_watch;
    result.surface = fuse_depth(rig, points.points, result.depth.maps, options.fusion);
    result.times.push_back({"surface", surface_watch.seconds()});
    if (result.surface.report.status != SurfaceStatus::kTooFewPoints) {
      const Stopwatch hole_watch;
      result.holes = explain_holes(rig, result.surface.mesh, result.depth.maps);
      for (const HoleReason reason : result.holes.vertices)
        result.surface.mesh.hole.push_back(static_cast<std::uint8_t>(reason));
      result.times.push_back({"holes", hole_watch.seconds()});
      return result;
    }
  }
  const Stopwatch surface_watch;
  result.surface = reconstruct_surface(rig, points.points, options.surface);
  result.times.push_back({"surface", surface_watch.seconds()});
  if (options.depth.enabled) {
    result.surface.report.warnings.push_back(
        "dense depth found too little: the surface rests on the labelled curves alone");
  }
  return result;
}

}  // namespace pencilscan
