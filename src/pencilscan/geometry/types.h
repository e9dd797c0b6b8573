#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace pencilscan {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat6 = Eigen::Matrix<double, 6, 6>;

/// x_in_b = rotation * x_in_a + translation, for a value named b_from_a.
struct RigidTransform {
  Mat3 rotation = Mat3::Identity();
  Vec3 translation = Vec3::Zero();  ///< mm

  [[nodiscard]] Vec3 operator*(const Vec3& x) const { return rotation * x + translation; }
  [[nodiscard]] RigidTransform operator*(const RigidTransform& other) const {
    return {rotation * other.rotation, rotation * other.translation + translation};
  }
  [[nodiscard]] RigidTransform inverse() const {
    return {rotation.transpose(), -(rotation.transpose() * translation)};
  }
};

/// Half-line origin + t * direction, t > 0; the direction has unit length.
struct Ray {
  Vec3 origin = Vec3::Zero();
  Vec3 direction = Vec3::UnitZ();
};

struct Sphere {
  Vec3 center = Vec3::Zero();
  double radius = 1;  ///< > 0
};

}  // namespace pencilscan
