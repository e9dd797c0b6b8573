#include "pencilscan/calibration/priors.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "pencilscan/calibration/structure.h"
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

void set_priors(const GivenCalibration& known, bool is_camera, const Device& device,
                BundleDevice& bundle) {
  const double width = device.width;
  const double height = device.height;
  auto& value = bundle.prior;
  auto& sigma = bundle.prior_sigma;
  value[kFx] = bundle.inner[kFx];
  value[kFy] = known.K ? bundle.inner[kFy] / bundle.inner[kFx] : 1;
  value[kCx] = known.K ? bundle.inner[kCx] : (width - 1) / 2;
  value[kCy] = known.K ? bundle.inner[kCy] : (height - 1) / 2;
  // Without a given focal length its prior only keeps it from running away.
  sigma[kFx] = (known.K ? 0.1 : 0.5) * bundle.inner[kFx];
  sigma[kFy] = is_camera ? 0.002 : 0.02;
  sigma[kCx] = (is_camera ? 0.02 : 0.04) * width;
  sigma[kCy] = (is_camera ? 0.02 * width : (known.K ? 0.1 : 0.5) * height);
  for (std::size_t i = kK1; i < kIntrinsics; ++i) value[i] = known.distortion ? bundle.inner[i] : 0;
  sigma[kK1] = 0.2;
  sigma[kK2] = 0.5;
  sigma[kP1] = sigma[kP2] = 0.002;
  sigma[kK3] = 0;
}

void hold_given(const GivenCalibration& known, BundleDevice& bundle) {
  if (known.K)
    for (const std::size_t i : {kFx, kFy, kCx, kCy}) bundle.prior_sigma[i] = 0;
  if (known.distortion)
    for (const std::size_t i : {kK1, kK2, kP1, kP2, kK3}) bundle.prior_sigma[i] = 0;
}

double unmodelled_k3(const Device& device) {
  constexpr double kShare = 5e-4;
  const double x = std::max(device.K(0, 2), device.width - 1 - device.K(0, 2)) / device.K(0, 0);
  const double y = std::max(device.K(1, 2), device.height - 1 - device.K(1, 2)) / device.K(1, 1);
  return kShare / std::pow(x * x + y * y, 3);
}

void expect_unmodelled(const Rig& sizes, BundleProblem& problem) {
  for (std::size_t d = 0; d < problem.devices.size(); ++d) {
    BundleDevice& bundle = problem.devices[d];
    if (!bundle.present || bundle.prior_sigma[kK1] == 0) continue;
    Device device = device_at(sizes, d);
    set_device(bundle, device);
    bundle.prior_sigma[kK3] = unmodelled_k3(device);
  }
}

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

bool fix_frame(const CalibrationInput& input, BundleProblem& problem) {
  std::vector<Vec3> from;
  std::vector<Vec3> to;
  for (std::size_t d = 0; d < problem.devices.size(); ++d) {
    if (!problem.devices[d].present || !input.known[d].pose) continue;
    from.push_back(center_of(problem.devices[d]));
    to.push_back(device_at(input.rig, d).center());
  }
  bool scaled = !problem.board_views.empty();
  double scale = 1;
  if (from.size() >= 3) {
    Eigen::Matrix3Xd a(3, from.size());
    Eigen::Matrix3Xd b(3, from.size());
    for (std::size_t i = 0; i < from.size(); ++i) {
      a.col(static_cast<Eigen::Index>(i)) = from[i];
      b.col(static_cast<Eigen::Index>(i)) = to[i];
    }
    const Eigen::Matrix4d similarity = fit_similarity(a, b, !scaled);
    const double s = similarity.block<3, 3>(0, 0).col(0).norm();
    move_solution(s, {similarity.block<3, 3>(0, 0) / s, similarity.block<3, 1>(0, 3)}, problem);
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
  return scaled;
}

}  // namespace pencilscan
