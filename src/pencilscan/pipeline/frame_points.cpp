#include <algorithm>
#include <cmath>
#include <utility>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/pipeline/disagreement_warnings.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/frame_warnings.h"
#include "pencilscan/pipeline/line_contrast.h"
#include "pencilscan/pipeline/view_agreement.h"
#include "pencilscan/points/surface_check.h"
#include "pencilscan/rig/object_space.h"

// Of a frame's way: from the lines to points, and to points on the dense surface.

namespace pencilscan {
namespace {

/// Error of each plane, projector px, that makes crossings miss each other as they do.
double plane_error_px(const CrossingDisagreement& crossings) {
  const double noise2 = crossings.expected_px * crossings.expected_px;
  const double devices2 = crossings.median_px * crossings.median_px - noise2;
  return kDeviationPerMedian * std::sqrt(std::max(0.0, devices2) / 2);
}

/// A place of the dense surface as a camera sees it: a point of no line.
MeasuredPoint point_at(const DepthMap& map, const Vec2& pixel, const Vec3& position, float sigma) {
  MeasuredPoint p;
  set_position(position, p);
  p.u = static_cast<float>(pixel.x());
  p.v = static_cast<float>(pixel.y());
  p.camera = static_cast<std::uint8_t>(map.camera);
  p.sigma = sigma;
  return p;
}

/// The measured surface as each camera sees it: its own nodes, and where it has none, what others
/// measured.
std::vector<MeasuredPoint> dense_points(const Rig& rig, std::span<const DepthMap> maps,
                                        const RayScene& scene) {
  constexpr double kLeastCosine = 0.2;  // of the incidence, as of windows
  const TriangleMesh& mesh = scene.mesh();
  std::vector<std::vector<MeasuredPoint>> of_map(maps.size());
  parallel_for(maps.size(), [&](std::size_t m) {
    const DepthMap& map = maps[m];
    const Camera& camera = rig.cameras[static_cast<std::size_t>(map.camera)];
    for (std::size_t i = 0; i < map.nodes.size(); ++i) {
      const Vec2 pixel = map.pixel(i);
      if (map.nodes[i].measured()) {
        const double length = camera.normalized_from_pixel(pixel).homogeneous().norm();
        of_map[m].push_back(point_at(map, pixel, node_point(rig, map, i),
                                     map.nodes[i].sigma * static_cast<float>(length)));
        continue;
      }
      const Ray ray = camera.ray(pixel);
      const auto hit = scene.first_hit(ray);
      if (!hit || !is_measured(mesh, hit->face)) continue;
      const double cosine = -ray.direction.dot(face_normal(mesh, hit->face));
      if (cosine < kLeastCosine) continue;
      float sigma = 0;
      for (const int v : mesh.faces[hit->face])
        sigma = std::max(sigma, mesh.sigma[static_cast<std::size_t>(v)]);
      of_map[m].push_back(point_at(map, pixel, hit->point, sigma / static_cast<float>(cosine)));
    }
  });
  std::vector<MeasuredPoint> points;
  for (const auto& some : of_map) points.insert(points.end(), some.begin(), some.end());
  return points;
}

/// Takes out what lies where the object cannot be.
std::vector<MeasuredPoint> take_background(const Rig& rig, double volume_margin,
                                           std::vector<MeasuredPoint>& points) {
  const ObjectSpace space(rig, volume_margin);
  const auto first =
      std::stable_partition(points.begin(), points.end(),
                            [&](const MeasuredPoint& p) { return space.holds(position_of(p)); });
  std::vector<MeasuredPoint> background(first, points.end());
  points.erase(first, points.end());
  return background;
}

/// The presence images, which nobody looks at any more.
std::vector<std::vector<cv::Mat>> taken_presence(std::span<CameraDetection> detections) {
  std::vector<std::vector<cv::Mat>> presence;
  for (CameraDetection& detection : detections)
    presence.push_back(std::exchange(detection.presence, {}));
  return presence;
}

/// The camera whose depths lie apart though its crossings meet: what it sees is in its place for
/// the projectors, but not where the others see it.
std::optional<std::size_t> of_another_moment(const ViewsApart& apart, const PointResult& result) {
  constexpr double kMeetsPx = 0.25;  // half of a bump that is to be told from it
  const auto camera = apart.single();
  const auto all = static_cast<std::ptrdiff_t>(result.left_out.size());
  const bool are_most_left =
      2 * (std::count(result.left_out.begin(), result.left_out.end(), 1) + 1) < all;
  if (!camera || !are_most_left || result.corrected || *camera >= result.device_crossings.size())
    return std::nullopt;
  const auto& shift = result.device_crossings[*camera].shift_px;
  return shift && shift->norm() < kMeetsPx ? camera : std::nullopt;
}

std::vector<MeasuredPoint> without_camera(std::vector<MeasuredPoint> points, std::size_t camera) {
  std::erase_if(points, [&](const MeasuredPoint& p) { return p.camera == camera; });
  return points;
}

}  // namespace

PointOptions before_surface(PointOptions options) {
  options.guided.passes = std::min(options.guided.passes, options.guided.passes_before_surface);
  return options;
}

PointResult place_points(const Rig& rig, PointResult lines, const PointOptions& options,
                         const StageClock& clock) {
  PointResult result = std::move(lines);
  const bool is_guided = solution_method(options.method).capabilities.may_be_guided;
  std::vector<LocalSurface> surfaces;
  if (is_guided) {
    clock("guided matching", [&] {
      surfaces = match_guided(result.corrected ? *result.corrected : rig, result.families,
                              presence_images(result.detections), result.graphs, result.labeling,
                              options.guided);
    });
  }
  clock("triangulation", [&] {
    TriangulationOptions triangulation = options.triangulation;
    triangulation.keeps_background = true;
    SettleOptions settle = options.settle;
    if (result.corrected) {
      triangulation.projection_sigma_px =
          std::max(triangulation.projection_sigma_px, plane_error_px(result.crossings));
      settle.errors_are_shared = true;
    }
    const auto place = [&] {
      result.points = triangulate(rig, result.graphs, result.labeling, triangulation);
      result.background = take_background(rig, triangulation.volume_margin, result.points);
      if (result.corrected) surfaces = local_surfaces(rig, result.points, options.guided.surface);
      if (!is_guided) return ViewsApart{};
      result.points = settle_points(rig, std::move(result.points), surfaces, settle);
      return views_apart(rig, result.points, surfaces);
    };
    ViewsApart apart = place();
    std::optional<std::size_t> camera = of_another_moment(apart, result);
    while (camera && *apart.with[*camera] > kMostApart) {
      result.warnings.push_back(another_moment_warning(rig, *camera, apart, true));
      forget_camera(*camera, result);
      surfaces = local_surfaces(rig, without_camera(std::move(result.points), *camera),
                                options.guided.surface);
      apart = place();
      camera = of_another_moment(apart, result);
    }
    // Where a device was found to be off, what cameras see by its lines lies apart, too.
    let_focus_explain(result.warnings);
    const bool is_explained = std::any_of(
        result.warnings.begin(), result.warnings.end(),
        [](const Warning& warning) { return warning.code == WarningCode::kDeviceIsOff; });
    if (camera && !is_explained)
      result.warnings.push_back(another_moment_warning(rig, *camera, apart, false));
    // Where the rig is off, that was said.
    if (!result.corrected && apart.all.value_or(0) > kMostApart)
      result.warnings.push_back(views_warning(*apart.all));
  });
  return result;
}

FrameResult match_on_surface(const Rig& rig, FrameResult result, const PointOptions& options,
                             const StageClock& clock) {
  auto& [points, shape, times] = result;
  if (!solution_method(options.method).capabilities.may_be_guided || points.corrected ||
      !shape.scene)
    return result;
  points.is_on_surface = true;
  GuidedMatchingOptions guided = options.guided;
  if (guided.passes > 0) guided.passes = guided.passes_on_surface;
  clock("guided matching on the surface", [&] {
    points.points = {};  // made anew
    points.contradicted = drop_contradicted(rig, *shape.scene, points.graphs, points.labeling);
    const std::vector<LocalSurface> surfaces =
        match_guided(rig, points.families, taken_presence(points.detections), points.graphs,
                     points.labeling, guided, dense_points(rig, shape.depth.maps, *shape.scene));
    // Of cameras without any line that was said.
    for (const GridGraph& graph : points.graphs)
      if (graph.curves.empty())
        points.labeling.expected[static_cast<std::size_t>(graph.camera)].clear();
    std::vector<MeasuredPoint> triangulated =
        triangulate(rig, points.graphs, points.labeling, options.triangulation);
    SettledPoints settled = settle_on_surface(
        rig, *shape.scene, settle_points(rig, std::move(triangulated), surfaces, options.settle),
        static_cast<float>(options.settle.min_alone_confidence), shape.surface.mesh.color);
    points.points = std::move(settled.points);
    points.contradicted += settled.contradicted;
    shape.surface.used.clear();
    for (const PointEvidence& evidence : settled.evidence)
      shape.surface.used.push_back(evidence.settled ? 1 : 0);
    points.evidence = std::move(settled.evidence);
  });
  SurfaceReport& report = shape.surface.report;
  report.points = points.points.size();
  report.points_used =
      static_cast<std::size_t>(std::count(shape.surface.used.begin(), shape.surface.used.end(), 1));
  return result;
}

}  // namespace pencilscan
