#include "pencilscan/surface/supported.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/chunks.h"
#include "pencilscan/surface/point_grid.h"

namespace pencilscan {
namespace {

constexpr std::size_t kEvery = 4;  // points follow each other by a pixel

std::vector<Vec3> places_of(std::span<const MeasuredPoint> points) {
  std::vector<Vec3> places;
  for (std::size_t i = 0; i < points.size(); i += kEvery) places.push_back(position_of(points[i]));
  return places;
}

/// Places of some of the points, and whose camera saw each.
class Places {
 public:
  Places(std::span<const MeasuredPoint> points, double cell)
      : points_(points), grid_(places_of(points), cell) {}

  /// Squared distance to the nearest place within `radius` whose camera `is_faced`; `none` where
  /// there is none below that.
  [[nodiscard]] double nearest2(const Vec3& x, const std::vector<char>& is_faced, double radius,
                                double none) const {
    double nearest = none;
    grid_.for_each_within(x, radius, [&](std::size_t k, double d2) {
      if (d2 < nearest && is_faced[points_[kEvery * k].camera] != 0) nearest = d2;
    });
    return nearest;
  }

  /// Whether there is any such place.
  [[nodiscard]] bool any(const Vec3& x, const std::vector<char>& is_faced, double radius) const {
    return grid_.any_within(x, radius, [&](std::size_t k, double) {
      return is_faced[points_[kEvery * k].camera] != 0;
    });
  }

 private:
  std::span<const MeasuredPoint> points_;
  PointGrid grid_;
};

/// The camera that alone has depth where a place is; -1 where none or several have.
int only_camera(const Rig& rig, std::span<const DepthMap> maps, const Vec3& x) {
  constexpr double kOff = 2;  // node spacings, along a ray that meets the surface at 60 degrees
  int only = -1;
  for (const DepthMap& map : maps) {
    const Camera& camera = rig.camera(map.camera);
    const auto pixel = camera.project(x);
    if (!pixel || !camera.contains(*pixel)) continue;
    const auto node = [&](double px) { return static_cast<int>(std::lround(px / map.stride)); };
    const int row = std::min(node((*pixel)[1]), map.rows - 1);
    const int column = std::min(node((*pixel)[0]), map.columns - 1);
    const DepthNode& n = map.nodes[map.index(row, column)];
    const double z = (camera.device_from_world * x).z();
    const double off = kOff * map.stride * z / camera.focal_px();
    if (!n.measured() || std::abs(1 / static_cast<double>(n.w) - z) > off) continue;
    if (only >= 0) return -1;
    only = map.camera;
  }
  return only;
}

}  // namespace

std::vector<char> unsupported_vertices(const Rig& rig, const TriangleMesh& mesh,
                                       std::span<const DepthMap> maps,
                                       std::span<const MeasuredPoint> points,
                                       std::span<const MeasuredPoint> denied, double reach) {
  // Nearly every vertex has a point much nearer, which takes few looks to find.
  const double near = 0.25 * reach;
  const Places places(points, near);
  const Places denied_places(denied, near);
  const std::vector<Vec3> normals = vertex_normals(mesh);
  const double far = reach * reach;
  std::vector<char> unsupported(mesh.vertices.size(), 0);
  parallel_chunks(mesh.vertices.size(), [&](std::size_t v) {
    const Vec3& x = mesh.vertices[v];
    if (!(mesh.confidence[v] > 0)) return;
    thread_local std::vector<char> is_faced;
    is_faced.clear();
    for (const Camera& camera : rig.cameras)
      is_faced.push_back(normals[v].dot(camera.center() - x) > 0 ? 1 : 0);
    // How near does not matter where nothing denied is.
    if (!denied_places.any(x, is_faced, near) && places.any(x, is_faced, near)) return;
    double nearest = places.nearest2(x, is_faced, near, far);
    if (nearest == far) nearest = places.nearest2(x, is_faced, reach, far);
    bool is_supported = nearest < far;
    if (is_supported && nearest > near * near) {
      const int only = only_camera(rig, maps, x);
      if (only >= 0) {
        std::vector<char> alone(is_faced.size(), 0);
        alone[static_cast<std::size_t>(only)] = 1;
        is_supported = places.nearest2(x, alone, 2 * reach, 4 * far) < 4 * far;
      }
    }
    if (!is_supported || denied_places.nearest2(x, is_faced, std::sqrt(nearest), nearest) < nearest)
      unsupported[v] = 1;
  });
  return unsupported;
}

}  // namespace pencilscan
