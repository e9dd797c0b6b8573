#include "pencilscan/pipeline/shown_lines.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "pencilscan/pipeline/seen_depths.h"
#include "pencilscan/surface/point_grid.h"

namespace pencilscan {
namespace {

constexpr double kNear = 3;           // px
constexpr double kOn = 1;             // px
constexpr double kMostSigma = 0.5;    // px
constexpr int kHidingCell = 16;       // px
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

}  // namespace

ShownLines shown_lines(const Rig& rig, const std::vector<ColorFamily>& families,
                       const GridGraph& graph, std::span<const std::vector<MeasuredPoint>> points) {
  const Camera& camera = rig.camera(graph.camera);
  std::vector<Seen> seen;
  SeenDepths depths(camera, kHidingCell);
  for (std::size_t c = 0; c < points.size(); ++c) {
    if (static_cast<int>(c) == graph.camera) continue;
    for (const MeasuredPoint& p : points[c]) {
      const Vec3 x = position_of(p);
      const std::optional<Vec2> pixel = camera.project(x);
      if (!pixel || !camera.contains(*pixel)) continue;
      Seen s{*pixel, (camera.device_from_world * x).z(),
             family_of(families, {p.projector, p.pattern}), false};
      s.faces = about_facing(rig, p).dot((camera.center() - x).normalized()) > kLeastCosine &&
                double{p.sigma} * camera.focal_px() < kMostSigma * s.depth;
      depths.add(s.pixel, s.depth);
      seen.push_back(s);
    }
  }
  std::vector<Vec3> places;
  for (const Curve& curve : graph.curves) {
    for (const CurvePoint& point : curve.points)
      places.push_back(place(point.position.cast<double>(), curve.family));
  }
  const PointGrid curves(places, kNear);
  // A surface that falls away from the camera by 45 degrees is not hidden by what it has in a cell.
  const double within_cell = 1 + kHidingCell / camera.focal_px();
  const auto is_hidden = [&](const Seen& s) {
    const SeenDepths::Range* range = depths.at(s.pixel);
    return range != nullptr && s.depth > range->nearest * within_cell;
  };
  ShownLines shown;
  for (const Seen& s : seen) {
    if (!s.faces || is_hidden(s)) continue;
    double least = std::numeric_limits<double>::max();
    curves.for_each_within(place(s.pixel, s.family), kNear,
                           [&](std::size_t, double squared) { least = std::min(least, squared); });
    shown.near += least <= kNear * kNear ? 1U : 0U;
    shown.on += least <= kOn * kOn ? 1U : 0U;
  }
  return shown;
}

}  // namespace pencilscan
