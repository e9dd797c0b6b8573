#include "pencilscan/solution/triangulate.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "pencilscan/core/parallel.h"

namespace pencilscan {
namespace {

/// d(line coordinate, projector px)/d(camera px across the curve), by a finite difference at equal
/// depth.
double coordinate_per_pixel(const Camera& camera, const Projector& projector,
                            const LinePattern& pattern, const CurvePoint& point, double depth) {
  const Vec2 pixel = point.position.cast<double>();
  const Vec2 normal = point.normal.cast<double>();
  const auto axis = static_cast<Eigen::Index>(pattern.axis);
  const auto a = RayInProjector(camera, projector, pixel - 0.5 * normal).pixel(depth);
  const auto b = RayInProjector(camera, projector, pixel + 0.5 * normal).pixel(depth);
  return a && b ? std::abs((*b)[axis] - (*a)[axis]) : 1.0;
}

/// Standard deviation of a curve point across the curve, px.
double position_sigma(const Curve& curve, int i, const TriangulationOptions& options) {
  const int from_end = std::min(i, static_cast<int>(curve.points.size()) - 1 - i);
  const double end = options.end_sigma_px * std::exp(-from_end / options.end_reach);
  return std::hypot(options.position_factor * curve.points[static_cast<std::size_t>(i)].sigma_px,
                    end);
}

void add_run(const Rig& rig, const GridGraph& graph, const LabeledRun& run, const Sphere& volume,
             const TriangulationOptions& options, std::vector<MeasuredPoint>& points) {
  const Camera& camera = rig.cameras[static_cast<std::size_t>(graph.camera)];
  const Curve& curve = graph.curves[static_cast<std::size_t>(run.curve)];
  const CurveLabel& label = run.label;
  const Projector& projector = rig.projectors[static_cast<std::size_t>(label.pattern.projector)];
  const LinePattern& pattern = projector.patterns[static_cast<std::size_t>(label.pattern.pattern)];
  const double coordinate = pattern.position_px(label.plane);
  for (int i = run.begin; i < run.end; ++i) {
    const CurvePoint& p = curve.points[static_cast<std::size_t>(i)];
    const Vec2 pixel = p.position.cast<double>();
    const RayInProjector ray(camera, projector, pixel);
    const auto depth = ray.depth(coordinate, pattern.axis);
    if (!depth) continue;
    const Vec3 x = camera.point_at_depth(pixel, *depth);
    if ((x - volume.center).norm() > options.volume_margin * volume.radius) continue;
    const double slope = std::abs(ray.slope(*depth, pattern.axis));
    const double gain = coordinate_per_pixel(camera, projector, pattern, p, *depth);
    const double position = position_sigma(curve, i, options);
    const double sigma_px = std::hypot(gain * position, options.projection_sigma_px);
    const double footprint = options.footprint_sigma_px * *depth / camera.K(0, 0);
    const double ray_length = camera.normalized_from_pixel(pixel).homogeneous().norm();
    MeasuredPoint point;
    point.x = static_cast<float>(x.x());
    point.y = static_cast<float>(x.y());
    point.z = static_cast<float>(x.z());
    point.u = p.position.x();
    point.v = p.position.y();
    point.camera = static_cast<std::uint8_t>(graph.camera);
    point.projector = static_cast<std::uint8_t>(label.pattern.projector);
    point.pattern = static_cast<std::uint8_t>(label.pattern.pattern);
    point.line = static_cast<std::uint16_t>(label.line);
    point.sigma =
        static_cast<float>(std::hypot(sigma_px / std::max(1e-6, slope), footprint) * ray_length);
    point.confidence = label.confidence;
    point.plane = static_cast<float>(label.plane);
    points.push_back(point);
  }
}

void keep_one_per_pixel(std::vector<MeasuredPoint>& points) {
  const auto key = [](const MeasuredPoint& p) {
    return std::make_tuple(p.camera, p.projector, p.pattern, p.line, std::lround(p.v),
                           std::lround(p.u));
  };
  std::sort(points.begin(), points.end(), [&](const MeasuredPoint& a, const MeasuredPoint& b) {
    return std::tuple_cat(key(a), std::make_tuple(a.sigma, a.u, a.v)) <
           std::tuple_cat(key(b), std::make_tuple(b.sigma, b.u, b.v));
  });
  const auto last =
      std::unique(points.begin(), points.end(),
                  [&](const MeasuredPoint& a, const MeasuredPoint& b) { return key(a) == key(b); });
  points.erase(last, points.end());
}

}  // namespace

std::vector<MeasuredPoint> triangulate(const Rig& rig, std::span<const GridGraph> graphs,
                                       const Labeling& labeling,
                                       const TriangulationOptions& options) {
  const Sphere volume = working_volume(rig);
  std::vector<std::vector<MeasuredPoint>> per_camera(graphs.size());
  parallel_for(graphs.size(), [&](std::size_t g) {
    for (const LabeledRun& run : labeling.runs[static_cast<std::size_t>(graphs[g].camera)]) {
      add_run(rig, graphs[g], run, volume, options, per_camera[g]);
    }
    keep_one_per_pixel(per_camera[g]);
  });
  std::vector<MeasuredPoint> points;
  for (const auto& part : per_camera) points.insert(points.end(), part.begin(), part.end());
  return points;
}

}  // namespace pencilscan
