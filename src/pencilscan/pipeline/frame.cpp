#include "pencilscan/pipeline/frame.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/pipeline/frame_warnings.h"
#include "pencilscan/pipeline/line_naming.h"
#include "pencilscan/pipeline/picture_check.h"
#include "pencilscan/points/surface_check.h"
#include "pencilscan/surface/manifold.h"

namespace pencilscan {
namespace {

/// Forgets what the cameras of the findings saw.
void leave_out(const Rig& rig, const std::vector<PictureFinding>& findings, PointResult& result) {
  for (const PictureFinding& finding : findings) {
    const auto c = static_cast<std::size_t>(finding.camera);
    result.left_out[c] = 1;
    result.detections[c] = {};
    result.graphs[c] = {};
    result.graphs[c].camera = finding.camera;
    result.warnings.push_back(
        {WarningCode::kWrongPicture, describe(rig, finding), rig.camera(finding.camera).name});
  }
}

/// The frame without the pictures that were left out.
Frame without(Frame frame, const std::vector<char>& left_out) {
  for (std::size_t c = 0; c < left_out.size(); ++c) {
    if (left_out[c] != 0) frame.images[c] = cv::Mat();
  }
  return frame;
}

/// Error of each plane, projector px, that makes crossings miss each other as they do.
double plane_error_px(const CrossingDisagreement& crossings) {
  const double noise2 = crossings.expected_px * crossings.expected_px;
  const double devices2 = crossings.median_px * crossings.median_px - noise2;
  return kDeviationPerMedian * std::sqrt(std::max(0.0, devices2) / 2);
}

/// Why a frame has no points.
std::string why_nothing(const PointResult& result) {
  std::string why = "no curve could be given its projector line";
  for (const Warning& warning : result.warnings) {
    if (warning.code == WarningCode::kWrongPicture) why += "; " + warning.text;
  }
  return why;
}

/// Of all cameras; they share their pixels with the detections.
std::vector<std::vector<cv::Mat>> presence_images(std::span<const CameraDetection> detections) {
  std::vector<std::vector<cv::Mat>> presence;
  for (const CameraDetection& detection : detections) presence.push_back(detection.presence);
  return presence;
}

/// The share of a camera's curve points with a name after a second look, least of all cameras: one
/// that stands elsewhere has few, and says nothing where it has none.
double guided_share(const Rig& rig, const PointOptions& options, const PointResult& result) {
  std::vector<GridGraph> graphs = result.graphs;
  Labeling labeling = result.labeling;
  second_look(rig, result.families, presence_images(result.detections), graphs, labeling,
              options.second_look);
  double least = 1;
  for (std::size_t c = 0; c < graphs.size(); ++c) {
    const auto points = static_cast<double>(curve_points(graphs[c]));
    if (points > 0)
      least = std::min(least, static_cast<double>(labelled_points(labeling.runs[c])) / points);
  }
  return least;
}

/// Gives the curves their lines. Methods that correct the rig first leave out pictures that do not
/// fit, and give back the rig that the lines were named with where it is not the one given.
std::optional<Rig> label_lines(const Rig& rig, const Frame& frame, const PointOptions& options,
                               PointResult& result) {
  const SolutionMethod& method = solution_method(options.method);
  const auto solve = [&] {
    return method.solve(rig, result.families, result.graphs, options.method);
  };
  result.labeling = solve();
  if (!method.capabilities.corrects_rig) return std::nullopt;
  if (const auto pair = exchanged_projectors(rig, frame, result.graphs, result.labeling, options)) {
    const std::string one = rig.projector(pair->first).name;
    const std::string other = rig.projector(pair->second).name;
    throw StageError(
        "projectors " + one + " and " + other +
        " show each other's patterns: their outputs or cables are exchanged (put them "
        "back; frames that are taken already fit a rig with the two patterns exchanged)");
  }
  const std::vector<PictureFinding> misplaced =
      misplaced_pictures(rig, frame, result.graphs, result.labeling, options);
  if (!misplaced.empty()) {
    leave_out(rig, misplaced, result);
    result.labeling = solve();
  }
  LineNaming naming = name_lines(rig, result.families, result.graphs, result.labeling, options,
                                 [&] { return guided_share(rig, options, result); });
  result.labeling = std::move(naming.labeling);
  result.crossings = naming.crossings;
  result.device_crossings = std::move(naming.device_crossings);
  if (naming.warning) result.warnings.push_back(std::move(*naming.warning));
  return std::move(naming.corrected);
}

/// The nodes of all depth maps.
std::vector<MeasuredPoint> dense_points(const Rig& rig, std::span<const DepthMap> maps) {
  std::vector<MeasuredPoint> points;
  for (const DepthMap& map : maps) {
    const Camera& camera = rig.cameras[static_cast<std::size_t>(map.camera)];
    for (std::size_t i = 0; i < map.nodes.size(); ++i) {
      if (!map.nodes[i].measured()) continue;
      const Vec3 x = node_point(rig, map, i);
      const Vec2 pixel = map.pixel(i);
      MeasuredPoint p;
      p.x = static_cast<float>(x.x());
      p.y = static_cast<float>(x.y());
      p.z = static_cast<float>(x.z());
      p.u = static_cast<float>(pixel.x());
      p.v = static_cast<float>(pixel.y());
      p.camera = static_cast<std::uint8_t>(map.camera);
      const double length = camera.normalized_from_pixel(pixel).homogeneous().norm();
      p.sigma = map.nodes[i].sigma * static_cast<float>(length);
      points.push_back(p);
    }
  }
  return points;
}

void scale(double factor, TriangleMesh& mesh) {
  for (Vec3& x : mesh.vertices) x *= factor;
  for (float& sigma : mesh.sigma) sigma *= static_cast<float>(factor);
}

/// From footprints to the rig's unit.
void scale(double factor, FrameResult& result) {
  const auto f = static_cast<float>(factor);
  for (MeasuredPoint& p : result.points.points) {
    for (float* length : {&p.x, &p.y, &p.z, &p.sigma}) *length *= f;
  }
  ShapeResult& shape = result.shape;
  scale(factor, shape.surface.mesh);
  scale(factor, shape.surface.measured);
  shape.surface.report.spacing_mm *= factor;
  for (double& area : shape.holes.area_mm2) area *= factor * factor;
  for (CameraDepthReport& camera : shape.depth.report.cameras) camera.sigma_median_mm *= factor;
  for (DepthMap& map : shape.depth.maps) {
    for (DepthNode& node : map.nodes) {
      for (float* inverse : {&node.w, &node.wx, &node.wy, &node.wxx, &node.wxy, &node.wyy})
        *inverse /= f;
      node.sigma *= f;
    }
  }
  // Scaling and files round: what lay apart may lie at one place.
  separate_vertices(shape.surface.mesh);
  separate_vertices(shape.surface.measured);
  shape.scene.reset();
}

}  // namespace

PointResult detect_frame(const Rig& rig, const Frame& frame, const PointOptions& options) {
  PointResult result;
  const StageClock clock(options.progress, result.times);
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
    });
  });
  return result;
}

PointResult measure_points(const Rig& stated, const Frame& frame, const PointOptions& options) {
  const Rig rig = with_registered_patterns(stated);
  PointResult result = detect_frame(rig, frame, options);
  const StageClock clock(options.progress, result.times);
  if (std::optional<Warning> warning = interpolation_warning(rig, result.detections))
    result.warnings.push_back(std::move(*warning));
  if (std::optional<Warning> warning = gamma_warning(rig, frame, result.graphs))
    result.warnings.push_back(std::move(*warning));
  leave_out(rig, plain_faults(rig, frame), result);
  std::optional<Rig> corrected;
  clock("solution", [&] { corrected = label_lines(rig, frame, options, result); });
  result.rig_is_off = corrected.has_value();
  std::vector<LocalSurface> surfaces;
  const bool is_guided = solution_method(options.method).capabilities.may_be_guided;
  if (is_guided) {
    clock("second look", [&] {
      surfaces = second_look(corrected ? *corrected : rig, result.families,
                             presence_images(result.detections), result.graphs, result.labeling,
                             options.second_look);
    });
  }
  clock("triangulation", [&] {
    TriangulationOptions triangulation = options.triangulation;
    SettleOptions settle = options.settle;
    if (corrected) {
      triangulation.projection_sigma_px =
          std::max(triangulation.projection_sigma_px, plane_error_px(result.crossings));
      settle.errors_are_shared = true;
    }
    result.points = triangulate(rig, result.graphs, result.labeling, triangulation);
    if (corrected) surfaces = local_surfaces(rig, result.points, options.second_look.surface);
    if (is_guided) result.points = settle_points(rig, result.points, surfaces, settle);
  });
  return result;
}

void look_again(const Rig& stated, const PointOptions& options, PointResult& points,
                ShapeResult& shape) {
  if (!solution_method(options.method).capabilities.may_be_guided || points.rig_is_off ||
      !shape.scene)
    return;
  const Rig rig = with_registered_patterns(stated);
  points.looked_again = true;
  const StageClock clock(options.progress, points.times);
  clock("look again", [&] {
    points.contradicted = drop_contradicted(rig, *shape.scene, points.graphs, points.labeling);
    const std::vector<LocalSurface> surfaces =
        second_look(rig, points.families, presence_images(points.detections), points.graphs,
                    points.labeling, options.second_look, dense_points(rig, shape.depth.maps));
    const std::vector<MeasuredPoint> triangulated =
        triangulate(rig, points.graphs, points.labeling, options.triangulation);
    SettledPoints settled = settle_on_surface(
        rig, *shape.scene, settle_points(rig, triangulated, surfaces, options.settle),
        shape.surface.mesh.color);
    points.points = std::move(settled.points);
    points.contradicted += settled.contradicted;
    shape.surface.used = std::move(settled.on_surface);
  });
  SurfaceReport& report = shape.surface.report;
  report.points = points.points.size();
  report.points_used =
      static_cast<std::size_t>(std::count(shape.surface.used.begin(), shape.surface.used.end(), 1));
}

FrameResult reconstruct_frame(const Rig& stated, const Frame& frame, const PointOptions& points,
                              const ShapeOptions& shape, bool meshes) {
  const double unit = footprint(stated);
  const Rig rig = scaled(stated, 1 / unit);
  if (std::all_of(frame.images.begin(), frame.images.end(),
                  [](const cv::Mat& image) { return image.empty(); })) {
    throw NothingFound("no camera of the rig has a picture of this moment");
  }
  FrameResult result;
  result.points = measure_points(rig, frame, points);
  if (result.points.points.empty()) throw NothingFound(why_nothing(result.points));
  if (meshes) {
    const Frame right = without(frame, result.points.left_out);
    result.shape = measure_shape(rig, right, result.points, shape);
  }
  std::vector<StageTime>& times = result.points.times;
  times.insert(times.end(), result.shape.times.begin(), result.shape.times.end());
  look_again(rig, points, result.points, result.shape);
  scale(unit, result);
  return result;
}

}  // namespace pencilscan
