#include "pencilscan/points/triangulate.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <tuple>

#include "pencilscan/core/parallel.h"
#include "pencilscan/points/pixel_lattice.h"
#include "pencilscan/rig/object_space.h"
#include "pencilscan/uncertainty/error_model.h"

namespace pencilscan {
namespace {

/// d(line coordinate, projector px)/d(camera px across the curve) at equal depth, lens distortion
/// neglected. `x`: the point in the camera frame.
double coordinate_per_pixel(const Camera& camera, const Projector& projector,
                            const RigidTransform& projector_from_camera, Axis axis,
                            const Eigen::Vector2f& normal, const Vec3& x) {
  const Vec3 moved(x.z() * normal.x() / camera.K(0, 0), x.z() * normal.y() / camera.K(1, 1), 0);
  const Vec3 h = projector_from_camera * x;
  const Vec3 dh = projector_from_camera.rotation * moved;
  const Vec2 change = (dh.head<2>() - h.head<2>() * (dh.z() / h.z())) / h.z();
  return std::abs(projector.K.row(static_cast<Eigen::Index>(axis)).head<2>().dot(change));
}

/// std::hypot for numbers whose squares neither over- nor underflow.
double root_of_squares(double a, double b) { return std::sqrt(a * a + b * b); }

/// Standard deviation of a curve point across the curve, px.
double position_sigma(const Curve& curve, int i, const TriangulationOptions& options) {
  const int from_end = std::min(i, static_cast<int>(curve.points.size()) - 1 - i);
  const double end = options.end_sigma_px * std::exp(-from_end / options.end_reach);
  return root_of_squares(
      options.position_factor * curve.points[static_cast<std::size_t>(i)].sigma_px, end);
}

void add_run(const Rig& rig, const GridGraph& graph, const LabeledRun& run,
             const ObjectSpace* space, const TriangulationOptions& options,
             std::vector<MeasuredPoint>& points) {
  const Camera& camera = rig.camera(graph.camera);
  const Curve& curve = graph.curves[static_cast<std::size_t>(run.curve)];
  const CurveLabel& label = run.label;
  const Projector& projector = rig.projector(label.pattern.projector);
  const LinePattern& pattern = rig.pattern(label.pattern);
  const RigidTransform world_from_camera = camera.device_from_world.inverse();
  const RigidTransform projector_from_camera = projector.device_from_world * world_from_camera;
  const double coordinate = pattern.position_px(label.plane);
  for (int i = run.begin; i < run.end; ++i) {
    const CurvePoint& p = curve.points[static_cast<std::size_t>(i)];
    if (!is_on_lattice(p.position.x(), p.position.y(), options.used_of_seven)) continue;
    const Vec2 pixel = p.position.cast<double>();
    const Vec3 direction = camera.normalized_from_pixel(pixel).homogeneous();
    const RayInProjector ray(projector_from_camera, projector, direction.head<2>());
    const auto depth = ray.depth(coordinate, pattern.axis);
    if (!depth) continue;
    const Vec3 x_in_camera = *depth * direction;
    const Vec3 x = world_from_camera * x_in_camera;
    if (space != nullptr && !space->holds(x)) continue;
    const double slope = std::abs(ray.slope(*depth, pattern.axis));
    const double gain = coordinate_per_pixel(camera, projector, projector_from_camera, pattern.axis,
                                             p.normal, x_in_camera);
    const double position = position_sigma(curve, i, options);
    const double sigma_px = root_of_squares(gain * position, options.projection_sigma_px);
    const double footprint = options.footprint_sigma_px * *depth / camera.focal_px();
    const double ray_length = direction.norm();
    MeasuredPoint point;
    set_position(x, point);
    point.u = p.position.x();
    point.v = p.position.y();
    point.camera = static_cast<std::uint8_t>(graph.camera);
    point.projector = static_cast<std::uint8_t>(label.pattern.projector);
    point.pattern = static_cast<std::uint8_t>(label.pattern.pattern);
    point.line = static_cast<std::uint16_t>(label.line);
    point.sigma = static_cast<float>(root_of_squares(sigma_px / std::max(1e-6, slope), footprint) *
                                     ray_length);
    point.confidence = label.confidence;
    point.plane = static_cast<float>(label.plane);
    points.push_back(point);
  }
}

bool is_line_before(const LabeledRun& a, const LabeledRun& b) {
  const CurveLabel& x = a.label;
  const CurveLabel& y = b.label;
  return std::tie(x.pattern.projector, x.pattern.pattern, x.line) <
         std::tie(y.pattern.projector, y.pattern.pattern, y.line);
}

/// Puts the points of one line in the order of its pixels, the most certain one of each.
class OnePerPixel {
 public:
  /// `points` from `first` on are of one line.
  void operator()(std::size_t first, std::vector<MeasuredPoint>& points) {
    const auto bits = [](float pixel) {
      return std::min<std::uint32_t>(pixel_number(pixel), 0xFFFF);
    };
    line_.assign(points.begin() + static_cast<std::ptrdiff_t>(first), points.end());
    places_.clear();
    for (std::uint32_t i = 0; i < line_.size(); ++i)
      places_.push_back({bits(line_[i].v) << 16 | bits(line_[i].u), i});
    std::sort(places_.begin(), places_.end(), [&](const Place& a, const Place& b) {
      if (a.pixel != b.pixel) return a.pixel < b.pixel;
      const MeasuredPoint& p = line_[a.point];
      const MeasuredPoint& q = line_[b.point];
      return std::tie(p.sigma, p.u, p.v) < std::tie(q.sigma, q.u, q.v);
    });
    points.resize(first);
    for (std::size_t i = 0; i < places_.size(); ++i) {
      if (i == 0 || places_[i].pixel != places_[i - 1].pixel)
        points.push_back(line_[places_[i].point]);
    }
  }

 private:
  struct Place {
    std::uint32_t pixel;  ///< row, column
    std::uint32_t point;
  };
  std::vector<MeasuredPoint> line_;
  std::vector<Place> places_;
};

/// Of one camera.
std::vector<MeasuredPoint> triangulate_graph(const Rig& rig, const GridGraph& graph,
                                             std::vector<LabeledRun> runs, const ObjectSpace* space,
                                             const TriangulationOptions& options) {
  std::stable_sort(runs.begin(), runs.end(), is_line_before);
  // New pages cost more than what is done with them: no vector grows by copies.
  std::size_t most = 0;
  for (const LabeledRun& run : runs) most += static_cast<std::size_t>(run.end - run.begin);
  std::vector<MeasuredPoint> points;
  points.reserve(most);
  OnePerPixel leave_one_per_pixel;
  std::size_t first = 0;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    add_run(rig, graph, runs[k], space, options, points);
    if (k + 1 < runs.size() && !is_line_before(runs[k], runs[k + 1])) continue;
    leave_one_per_pixel(first, points);
    first = points.size();
  }
  return points;
}

}  // namespace

std::vector<MeasuredPoint> triangulate(const Rig& rig, std::span<const GridGraph> graphs,
                                       const Labeling& labeling,
                                       const TriangulationOptions& options) {
  const ObjectSpace of_object(rig, options.volume_margin);
  const ObjectSpace* space = options.keeps_background ? nullptr : &of_object;
  std::vector<std::vector<MeasuredPoint>> per_camera(graphs.size());
  parallel_for(graphs.size(), [&](std::size_t g) {
    per_camera[g] = triangulate_graph(
        rig, graphs[g], labeling.runs[static_cast<std::size_t>(graphs[g].camera)], space, options);
  });
  std::size_t count = 0;
  for (const auto& part : per_camera) count += part.size();
  std::vector<MeasuredPoint> points;
  points.reserve(count);
  for (const auto& part : per_camera) points.insert(points.end(), part.begin(), part.end());
  return points;
}

}  // namespace pencilscan
