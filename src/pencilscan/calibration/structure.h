#pragma once

#include "pencilscan/bundle/bundle.h"

namespace pencilscan {

struct StructureOptions {
  std::size_t tracks = 500;       ///< that the first guess rests on, >= 50
  double pose_tolerance = 0.01;   ///< RANSAC for a pose: reprojection error over the image width
  double least_angle_rad = 0.05;  ///< between the rays of a triangulated point
  std::size_t least_matches = 20;
  std::vector<char> trusted;  ///< per device: inner parameters are known well; empty: of none
  /// Starts with two trusted devices where some pair of them shares enough, and finds focal length
  /// and lens shift of the others with their poses, on a grid.
  bool resects = false;
};

/// First guess of poses and points from devices with roughly known inner parameters: an essential
/// matrix for the best pair, then device after device by its pose against the points so far
/// (perspective n points), each followed by a small adjustment of poses, points and focal lengths.
/// Devices that are `present` on entry keep their poses as a start (points are triangulated first).
/// Returns the robust cost per view; devices that cannot be joined stay absent.
double build_structure(BundleProblem& problem, unsigned free_inner,
                       const StructureOptions& options = {});

}  // namespace pencilscan
