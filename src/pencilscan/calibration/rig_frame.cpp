#include "pencilscan/calibration/rig_frame.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/core/median.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

Vec3 middle_of_points(const BundleProblem& problem) {
  std::array<std::vector<double>, 3> coordinates;
  for (std::size_t t = 0; t < problem.points.size(); ++t)
    if (problem.used[t] != 0)
      for (std::size_t k = 0; k < 3; ++k)
        coordinates[k].push_back(problem.points[t][static_cast<Eigen::Index>(k)]);
  Vec3 middle = Vec3::Zero();
  for (std::size_t k = 0; k < 3; ++k)
    middle[static_cast<Eigen::Index>(k)] = upper_median(std::move(coordinates[k]));
  return middle;
}

/// z against the mean of the cameras' y axes, x towards the first placed device.
RigidTransform own_frame(const BundleProblem& problem, std::size_t cameras) {
  const Vec3 origin = middle_of_points(problem);
  Vec3 up = Vec3::Zero();
  Vec3 towards = Vec3::Zero();
  for (std::size_t d = 0; d < problem.devices.size(); ++d) {
    if (!problem.devices[d].present) continue;
    if (d < cameras) up -= rotation_of(problem.devices[d]).row(1).transpose();
    if (towards.isZero()) towards = center_of(problem.devices[d]) - origin;
  }
  if (up.norm() < 1e-3) up = Vec3::UnitZ();
  up.normalize();
  Vec3 x = towards - towards.dot(up) * up;
  if (x.norm() < 1e-9) x = up.unitOrthogonal();
  x.normalize();
  Mat3 rotation;
  rotation.row(0) = x;
  rotation.row(1) = up.cross(x);
  rotation.row(2) = up;
  return {rotation, -(rotation * origin)};
}

}  // namespace

void move_solution(double scale, const RigidTransform& new_from_old, BundleProblem& problem) {
  const auto moved = [&](const Vec3& x) -> Vec3 {
    return scale * (new_from_old.rotation * x) + new_from_old.translation;
  };
  for (BundleDevice& device : problem.devices) {
    if (!device.present) continue;
    const Mat3 rotation = rotation_of(device) * new_from_old.rotation.transpose();
    const Vec3 center = moved(center_of(device));
    set_pose(device, rotation, -(rotation * center));
  }
  for (Vec3& point : problem.points) point = moved(point);
  for (auto& pose : problem.board_poses) {
    const RigidTransform old = transform_from(pose);
    pose = pose_from({new_from_old.rotation * old.rotation, moved(old.translation)});
  }
}

FixedFrame fix_frame(const CalibrationInput& input, BundleProblem& problem) {
  std::vector<Vec3> from;
  std::vector<Vec3> to;
  for (std::size_t d = 0; d < problem.devices.size(); ++d) {
    if (!problem.devices[d].present || !input.known[d].pose) continue;
    from.push_back(center_of(problem.devices[d]));
    to.push_back(device_at(input.rig, d).center());
  }
  bool scaled = !problem.board_views.empty();
  double scale = 1;
  double of_given = 1;
  if (from.size() >= 3) {
    Eigen::Matrix3Xd a(3, from.size());
    Eigen::Matrix3Xd b(3, from.size());
    for (std::size_t i = 0; i < from.size(); ++i) {
      a.col(static_cast<Eigen::Index>(i)) = from[i];
      b.col(static_cast<Eigen::Index>(i)) = to[i];
    }
    const auto scale_of = [](const Eigen::Matrix4d& similarity) {
      return similarity.block<3, 3>(0, 0).col(0).norm();
    };
    const Eigen::Matrix4d similarity = fit_similarity(a, b, !scaled);
    const double s = scale_of(similarity);
    move_solution(s, {similarity.block<3, 3>(0, 0) / s, similarity.block<3, 1>(0, 3)}, problem);
    if (scaled) of_given = 1 / scale_of(fit_similarity(a, b, true));  // in a board's millimetres
    scaled = scaled || input.rig.unit_known;
  } else {
    move_solution(1, own_frame(problem, input.rig.cameras.size()), problem);
    if (!scaled) {
      double sum = 0;
      std::size_t count = 0;
      for (const BundleDevice& device : problem.devices) {
        if (!device.present) continue;
        sum += center_of(device).norm();
        ++count;
      }
      if (sum > 0) scale = 1000 * static_cast<double>(count) / sum;
    }
  }
  if (input.distance) {
    const double now = (center_of(problem.devices[input.distance->a]) -
                        center_of(problem.devices[input.distance->b]))
                           .norm();
    if (now > 0 && problem.devices[input.distance->a].present &&
        problem.devices[input.distance->b].present) {
      scale = input.distance->mm / now;
      scaled = true;
    }
  }
  move_solution(scale, {}, problem);
  // Lengths that were given in millimetres stay what they are.
  const bool goes_on = from.size() >= 3 && !input.rig.unit_known;
  return {scaled, goes_on ? of_given * scale : 1};
}

}  // namespace pencilscan
