#pragma once

#include <limits>
#include <memory>
#include <optional>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// Ray queries against one mesh, on Embree. Immutable after construction; queries are thread safe.
/// Distances are good to float precision (about 1e-4 mm at 1 m); hits are re-intersected in double.
class RayScene {
 public:
  explicit RayScene(const TriangleMesh& mesh);
  ~RayScene();
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(RayScene&&) noexcept;

  struct Hit {
    double distance = 0;  ///< mm along the unit direction
    std::size_t face = 0;
    Vec3 barycentric = Vec3::Zero();  ///< weights of the face's three vertices
    Vec3 point = Vec3::Zero();
  };
  [[nodiscard]] std::optional<Hit> first_hit(
      const Ray& ray, double max_distance = std::numeric_limits<double>::infinity()) const;
  /// True when the open segment between the points is free, `margin_mm` off both ends ignored.
  [[nodiscard]] bool visible(const Vec3& from, const Vec3& to, double margin_mm) const;

  struct Closest {
    double distance = 0;  ///< mm
    std::size_t face = 0;
    Vec3 point = Vec3::Zero();
  };
  /// Exact closest point of the mesh (double precision), within max_distance.
  [[nodiscard]] std::optional<Closest> closest_point(
      const Vec3& point, double max_distance = std::numeric_limits<double>::infinity()) const;

  [[nodiscard]] const TriangleMesh& mesh() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pencilscan
