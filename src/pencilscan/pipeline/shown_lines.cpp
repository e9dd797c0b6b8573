#include "pencilscan/pipeline/shown_lines.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "pencilscan/surface/point_grid.h"

namespace pencilscan {
namespace {

constexpr double kNear = 3;           // px
constexpr double kOn = 1;             // px
constexpr double kMostSigma = 0.5;    // px
constexpr double kLeastCosine = 0.5;  // between where a surface faces, about, and the camera

/// A curve point or what should lie on one: families are far from each other.
Vec3 place(const Vec2& pixel, int family) { return {pixel.x(), pixel.y(), 10 * kNear * family}; }

/// A point of another camera in this one's picture.
struct Seen {
  Vec2 pixel = Vec2::Zero();
  double depth = 0;
  int family = 0;
  bool faces = false;  ///< this camera, and its place is well known
};

/// The nearest points of each cell hide those behind them.
class NearestDepths {
 public:
  explicit NearestDepths(const Camera& camera)
      : columns_(camera.width / kCell + 1),
        focal_(camera.focal_px()),
        depths_(static_cast<std::size_t>(columns_ * (camera.height / kCell + 1)),
                std::numeric_limits<double>::max()) {}

  void add(const Seen& seen) {
    double& depth = depths_[cell(seen.pixel)];
    depth = std::min(depth, seen.depth);
  }
  [[nodiscard]] bool hides(const Seen& seen) const {
    return seen.depth > depths_[cell(seen.pixel)] * (1 + kCell / focal_);
  }

 private:
  static constexpr int kCell = 16;  // px

  [[nodiscard]] std::size_t cell(const Vec2& pixel) const {
    return static_cast<std::size_t>(pixel.y() / kCell) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(pixel.x() / kCell);
  }

  int columns_;
  double focal_;
  std::vector<double> depths_;
};

}  // namespace

ShownLines shown_lines(const Rig& rig, const std::vector<ColorFamily>& families,
                       const GridGraph& graph, std::span<const std::vector<MeasuredPoint>> points) {
  const Camera& camera = rig.camera(graph.camera);
  std::vector<Seen> seen;
  NearestDepths nearest(camera);
  for (std::size_t c = 0; c < points.size(); ++c) {
    if (static_cast<int>(c) == graph.camera) continue;
    for (const MeasuredPoint& p : points[c]) {
      const Vec3 x = position_of(p);
      const std::optional<Vec2> pixel = camera.project(x);
      if (!pixel || !camera.contains(*pixel)) continue;
      Seen s{*pixel, (camera.device_from_world * x).z(),
             family_of(families, {p.projector, p.pattern}), false};
      // A surface that one device sees and another one lights faces about the middle of them.
      const Vec3 facing = (rig.cameras[c].center() - x).normalized() +
                          (rig.projectors[p.projector].center() - x).normalized();
      s.faces = facing.normalized().dot((camera.center() - x).normalized()) > kLeastCosine &&
                double{p.sigma} * camera.focal_px() < kMostSigma * s.depth;
      nearest.add(s);
      seen.push_back(s);
    }
  }
  std::vector<Vec3> places;
  for (const Curve& curve : graph.curves) {
    for (const CurvePoint& point : curve.points)
      places.push_back(place(point.position.cast<double>(), curve.family));
  }
  const PointGrid curves(places, kNear);
  ShownLines shown;
  for (const Seen& s : seen) {
    if (!s.faces || nearest.hides(s)) continue;
    double least = std::numeric_limits<double>::max();
    curves.for_each_within(place(s.pixel, s.family), kNear,
                           [&](std::size_t, double squared) { least = std::min(least, squared); });
    shown.near += least <= kNear * kNear ? 1U : 0U;
    shown.on += least <= kOn * kOn ? 1U : 0U;
  }
  return shown;
}

}  // namespace pencilscan
