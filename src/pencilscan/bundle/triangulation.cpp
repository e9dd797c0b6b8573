#include "pencilscan/bundle/triangulation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {

std::optional<Vec3> triangulate(const BundleProblem& problem, const Track& track,
                                double least_angle_rad) {
  Mat3 normal = Mat3::Zero();
  Vec3 right = Vec3::Zero();
  std::vector<std::pair<Vec3, Vec3>> rays;
  for (const TrackView& view : track.views) {
    const BundleDevice& device = problem.devices[view.device];
    if (!device.present) continue;
    const Mat3 R = rotation_of(device);
    const Vec3 direction = (R.transpose() * device_ray(device, view.pixel)).normalized();
    const Vec3 center = -R.transpose() * Vec3(device.pose[3], device.pose[4], device.pose[5]);
    const Mat3 across = Mat3::Identity() - direction * direction.transpose();
    normal += across;
    right += across * center;
    rays.emplace_back(center, direction);
  }
  if (rays.size() < 2) return std::nullopt;
  double widest = 0;
  for (std::size_t i = 1; i < rays.size(); ++i)
    widest = std::max(widest, rays[0].second.cross(rays[i].second).norm());
  if (widest < std::sin(least_angle_rad)) return std::nullopt;
  const Vec3 point = solve_symmetric(normal, right);
  for (const auto& [center, direction] : rays)
    if (!(direction.dot(point - center) > 0)) return std::nullopt;
  return point;
}

void triangulate_all(BundleProblem& problem, double least_angle_rad) {
  problem.used.assign(problem.tracks.size(), 0);
  problem.points.resize(problem.tracks.size(), Vec3::Zero());
  for (std::size_t t = 0; t < problem.tracks.size(); ++t) {
    const auto point = triangulate(problem, problem.tracks[t], least_angle_rad);
    if (!point) continue;
    problem.points[t] = *point;
    problem.used[t] = 1;
  }
}

}  // namespace pencilscan
