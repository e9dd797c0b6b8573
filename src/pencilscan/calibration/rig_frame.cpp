#include "pencilscan/calibration/rig_frame.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/core/median.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

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

/// Centres of the devices that have a pose and were given one: as found and as given; and the
/// directions of their y and z axes, two columns per centre.
struct GivenCenters {
  Eigen::Matrix3Xd found;
  Eigen::Matrix3Xd given;
  Eigen::Matrix3Xd found_axes;
  Eigen::Matrix3Xd given_axes;
};

GivenCenters given_centers(const CalibrationInput& input, const BundleProblem& problem) {
  GivenCenters centers;
  for (std::size_t d = 0; d < problem.devices.size(); ++d) {
    if (!problem.devices[d].present || !input.known[d].pose) continue;
    const Eigen::Index at = centers.found.cols();
    centers.found.conservativeResize(Eigen::NoChange, at + 1);
    centers.given.conservativeResize(Eigen::NoChange, at + 1);
    centers.found.col(at) = center_of(problem.devices[d]);
    centers.given.col(at) = device_at(input.rig, d).center();
    centers.found_axes.conservativeResize(Eigen::NoChange, 2 * at + 2);
    centers.given_axes.conservativeResize(Eigen::NoChange, 2 * at + 2);
    centers.found_axes.rightCols<2>() = rotation_of(problem.devices[d]).bottomRows<2>().transpose();
    centers.given_axes.rightCols<2>() =
        device_at(input.rig, d).device_from_world.rotation.bottomRows<2>().transpose();
  }
  return centers;
}

/// Root mean squares about the middle along the principal axes, the largest first.
Vec3 spread_of(const Eigen::Matrix3Xd& points) {
  const Eigen::Matrix3Xd offsets = points.colwise() - points.rowwise().mean();
  const SymmetricEigen axes = symmetric_eigen(
      Eigen::MatrixXd(offsets * offsets.transpose() / static_cast<double>(points.cols())));
  return Vec3(axes.values.reverse()).cwiseMax(0).cwiseSqrt();
}

struct Similarity {
  double scale = 1;
  RigidTransform motion;
};

/// Centres with the points that lie on the axes of each, as far away as centres spread.
Eigen::Matrix3Xd with_axes(const Eigen::Matrix3Xd& centers, const Eigen::Matrix3Xd& axes) {
  const double spread = spread_of(centers)(0);
  Eigen::Matrix3Xd all(3, centers.cols() + axes.cols());
  all.leftCols(centers.cols()) = centers;
  for (Eigen::Index i = 0; i < axes.cols(); ++i)
    all.col(centers.cols() + i) = centers.col(i / 2) + spread * axes.col(i);
  return all;
}

/// By the centres alone, since rough poses turn devices more than they misplace them; of devices in
/// a line by their axes, too: centres leave them free to turn about it.
Similarity similarity_of(const GivenCenters& centers) {
  constexpr double kInALine = 0.05;  // across it over along it
  const Vec3 spread = spread_of(centers.given);
  const bool in_a_line = spread(1) < kInALine * spread(0);
  const Eigen::Matrix4d S = in_a_line
                                ? fit_similarity(with_axes(centers.found, centers.found_axes),
                                                 with_axes(centers.given, centers.given_axes), true)
                                : fit_similarity(centers.found, centers.given, true);
  const double scale = S.block<3, 3>(0, 0).col(0).norm();
  return {scale, {S.block<3, 3>(0, 0) / scale, S.block<3, 1>(0, 3)}};
}

/// By how much, as a logarithm, two measured scales may differ that are both right.
constexpr double kMeasured = 2 * kTapeDeviation;

/// The same of a measured scale and given poses. Poses that were measured alike err by as much;
/// rough ones miss the solution.
double scale_tolerance(const GivenCenters& centers, const Similarity& given_from_found) {
  constexpr double kDeviations = 3;
  const auto& [scale, motion] = given_from_found;
  const Eigen::Matrix3Xd moved =
      (scale * motion.rotation * centers.found).colwise() + motion.translation;
  return kMeasured + kDeviations * pose_scale_deviation(moved, centers.given);
}

/// What the known distance makes of the solution's lengths; nothing without one.
std::optional<double> scale_by_distance(const CalibrationInput& input,
                                        const BundleProblem& problem) {
  if (!input.distance) return std::nullopt;
  const BundleDevice& a = problem.devices[input.distance->a];
  const BundleDevice& b = problem.devices[input.distance->b];
  const double now = (center_of(a) - center_of(b)).norm();
  if (!a.present || !b.present || !(now > 0)) return std::nullopt;
  return input.distance->mm / now;
}

/// What makes the mean distance of the devices from the origin 1000.
double usual_scale(const BundleProblem& problem) {
  double sum = 0;
  for (const BundleDevice& device : problem.devices)
    if (device.present) sum += center_of(device).norm();
  return sum > 0 ? 1000 * static_cast<double>(present_devices(problem)) / sum : 1;
}

/// Moves the solution to the given poses. `measured`: what the distance or the board makes of its
/// lengths.
FixedFrame fix_given_frame(const GivenCenters& centers, bool is_unit_known,
                           std::optional<double> measured, BundleProblem& problem) {
  FixedFrame frame;
  frame.is_given = true;
  frame.is_scaled = is_unit_known || measured;
  const auto [scale, motion] = similarity_of(centers);
  const double factor = measured ? *measured / scale : 1;
  const double tolerance = scale_tolerance(centers, {scale, motion});
  const bool goes_on = is_unit_known && !(std::abs(std::log(factor)) > tolerance);
  // Lengths that were given in millimetres stay what they are, and the middle of the poses stays
  // where it is. Others are in another unit, about the same origin.
  const Vec3 fixed = goes_on ? Vec3(centers.given.rowwise().mean()) : Vec3(Vec3::Zero());
  move_solution(factor * scale,
                {motion.rotation, factor * motion.translation + (1 - factor) * fixed}, problem);
  if (!goes_on) frame.of_given = factor;
  frame.contradicts_given = is_unit_known && !goes_on;
  return frame;
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

double pose_scale_deviation(const Eigen::Matrix3Xd& found, const Eigen::Matrix3Xd& given) {
  const Vec3 middle = given.rowwise().mean();
  const double misses = (found - given).norm();
  const double spread = (given.colwise() - middle).norm();
  const double freedom = 3 * static_cast<double>(given.cols()) - 7;
  return misses / (std::sqrt(freedom) * spread);
}

FixedFrame fix_frame(const CalibrationInput& input, BundleProblem& problem) {
  std::optional<double> measured = scale_by_distance(input, problem);
  const bool is_by_board = !problem.board_views.empty();  // the solution is in its millimetres
  std::optional<double> of_board;
  if (is_by_board && measured && std::abs(std::log(*measured)) > kMeasured) of_board = measured;
  if (!measured && is_by_board) measured = 1;
  const GivenCenters centers = given_centers(input, problem);
  FixedFrame frame;
  if (centers.found.cols() >= 3) {
    frame = fix_given_frame(centers, input.rig.unit_known, measured, problem);
    frame.of_board = of_board;
    return frame;
  }
  move_solution(1, own_frame(problem, input.rig.cameras.size()), problem);
  move_solution(measured.value_or(usual_scale(problem)), {}, problem);
  frame.is_scaled = measured.has_value();
  frame.of_board = of_board;
  return frame;
}

}  // namespace pencilscan
