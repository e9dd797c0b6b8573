#include "pencilscan/evaluation/closest_lattice.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/chunks.h"

namespace pencilscan {

ClosestLattice::ClosestLattice(const RayScene& surface) {
  constexpr int kMostNodes = 64;  // along the longest side: 1.6 % of it apart
  const BoundingBox box = bounding_box(surface.mesh());
  const Vec3 margin = Vec3::Constant((box.high - box.low).norm() / 4);
  low_ = box.low - margin;
  const Vec3 size = box.high + margin - low_;
  step_mm_ = size.maxCoeff() / (kMostNodes - 1);
  for (int axis = 0; axis < 3; ++axis)
    count_[static_cast<std::size_t>(axis)] = static_cast<int>(std::ceil(size[axis] / step_mm_)) + 1;
  const auto across = static_cast<std::size_t>(count_[0]);
  const auto along = static_cast<std::size_t>(count_[1]);
  nodes_.resize(across * along * static_cast<std::size_t>(count_[2]));
  parallel_chunks(nodes_.size(), [&](std::size_t i) {
    const Vec3 place = low_ + step_mm_ * Vec3(static_cast<double>(i % across),
                                              static_cast<double>(i / across % along),
                                              static_cast<double>(i / across / along));
    const auto closest = surface.closest_point(place);
    if (closest) nodes_[i] = {closest->point, face_normal(surface.mesh(), closest->face)};
  });
}

const ClosestLattice::Node& ClosestLattice::nearest(const Vec3& place) const {
  std::size_t index = 0;  // a coordinate that is no number counts as the first
  for (int axis = 2; axis >= 0; --axis) {
    const int count = count_[static_cast<std::size_t>(axis)];
    const double at =
        std::min(std::max(0.0, (place[axis] - low_[axis]) / step_mm_ + 0.5), count - 0.5);
    index = index * static_cast<std::size_t>(count) + static_cast<std::size_t>(at);
  }
  return nodes_[index];
}

}  // namespace pencilscan
