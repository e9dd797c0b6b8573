#pragma once

#include "pencilscan/calibration/bundle.h"

namespace pencilscan {

struct StructureOptions {
  std::size_t tracks = 500;       ///< that the first guess rests on, >= 50
  double pose_tolerance = 0.01;   ///< RANSAC for a pose: reprojection error over the image width
  double least_angle_rad = 0.05;  ///< between the rays of a triangulated point
  std::size_t least_matches = 20;
};

/// First guess of poses and points from devices with roughly known inner parameters: an essential
/// matrix for the best pair, then device after device by its pose against the points so far
/// (perspective n points), each followed by a small adjustment of poses, points and focal lengths.
/// Devices that are `present` on entry keep their poses as a start (points are triangulated first).
/// Returns the robust cost per view; devices that cannot be joined stay absent.
double build_structure(BundleProblem& problem, unsigned free_inner,
                       const StructureOptions& options = {});

/// Point nearest to the rays of the present devices; nothing when they are parallel or it lies
/// behind one.
[[nodiscard]] std::optional<Vec3> triangulate(const BundleProblem& problem, const Track& track,
                                              double least_angle_rad);
/// Points of all tracks anew; those without one become unused.
void triangulate_all(BundleProblem& problem, double least_angle_rad);

/// Direction (z = 1) of a pixel in the device's frame.
[[nodiscard]] Vec3 device_ray(const BundleDevice& device, const Vec2& pixel);
/// Poses as the adjustment holds them (angle-axis, then translation), and back.
[[nodiscard]] RigidTransform transform_from(const std::array<double, 6>& pose);
[[nodiscard]] std::array<double, 6> pose_from(const RigidTransform& transform);
[[nodiscard]] Mat3 rotation_of(const BundleDevice& device);
[[nodiscard]] Vec3 center_of(const BundleDevice& device);

}  // namespace pencilscan
