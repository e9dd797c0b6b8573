#include "pencilscan/bundle/uncertainty.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "pencilscan/bundle/board_corners.h"
#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/reduced_equations.h"
#include "pencilscan/bundle/triangulation.h"
#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/random.h"
#include "pencilscan/geometry/cross_matrix.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

constexpr Eigen::Index kPose = ReducedEquations::kPose;
constexpr Eigen::Index kBlock = ReducedEquations::kBlock;

/// How poses change under the similarities of the world about `middle`: turn, shift, and scale
/// where no board gives it.
Eigen::MatrixXd gauge(const BundleProblem& problem, const Vec3& middle) {
  const auto count = static_cast<Eigen::Index>(problem.devices.size());
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(kBlock * count, 7);
  for (Eigen::Index d = 0; d < count; ++d) {
    const BundleDevice& device = problem.devices[static_cast<std::size_t>(d)];
    if (!device.present) continue;
    const Mat3 R = rotation_of(device);
    // X' = X + w x (X - m) + v + s (X - m); the device's frame turns and moves along.
    G.block<3, 3>(kBlock * d, 0) = -R;
    for (Eigen::Index k = 0; k < 3; ++k)
      G.block<3, 1>(kBlock * d + 3, k) = R * middle.cross(Vec3::Unit(k)) * -1;
    G.block<3, 3>(kBlock * d + 3, 3) = -R;
    const Vec3 t(device.pose[3], device.pose[4], device.pose[5]);
    G.block<3, 1>(kBlock * d + 3, 6) = t + R * middle;
  }
  if (boards_join_devices(problem.board_views)) G.conservativeResize(Eigen::NoChange, 6);
  return G;
}

/// R with R R' = a symmetric positive semi-definite matrix.
Eigen::MatrixXd square_root(const Eigen::MatrixXd& matrix) {
  const SymmetricEigen eigen = symmetric_eigen(matrix);
  return eigen.vectors * eigen.values.cwiseMax(0).cwiseSqrt().asDiagonal();
}

struct Covariance {
  std::vector<Eigen::Index> at;  ///< rows of the full system that are free
  Eigen::MatrixXd matrix;
  Eigen::MatrixXd root;  ///< matrix = root * root'
};

/// Of random errors and of systematic ones; `found.shared_px` and its weight are found on the way.
Covariance invert(const ReducedEquations& normal, const BundleProblem& problem, const Vec3& middle,
                  double distance, Uncertainty& found) {
  Covariance result;
  for (Eigen::Index i = 0; i < normal.H().rows(); ++i)
    if (normal.is_free(i)) result.at.push_back(i);
  const auto n = static_cast<Eigen::Index>(result.at.size());
  // Scaled to comparable units: radians, shifts over the distance, focal lengths over themselves...
  Eigen::VectorXd unit(n);
  Eigen::MatrixXd H(n, n);
  Eigen::MatrixXd noise(n, n);
  const Eigen::MatrixXd noise_of_all = normal.random();
  const Eigen::MatrixXd full_gauge = gauge(problem, middle);
  Eigen::MatrixXd G(n, full_gauge.cols());
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index at = result.at[static_cast<std::size_t>(i)];
    const Eigen::Index kind = at % kBlock;
    unit[i] = kind < 3 ? 1 : kind < 6 ? distance : kind < kPose + kK1 ? 1000 : 1;
    // k3 of a narrow lens is a large number that does little.
    const double of_k3 = problem.devices[static_cast<std::size_t>(at / kBlock)].prior_sigma[kK3];
    if (kind == kPose + kK3 && std::isfinite(of_k3)) unit[i] = of_k3;
    G.row(i) = full_gauge.row(at) / unit[i];
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const Eigen::Index row = result.at[static_cast<std::size_t>(i)];
      const Eigen::Index column = result.at[static_cast<std::size_t>(j)];
      H(i, j) = normal.H()(row, column) * unit[i] * unit[j];
      noise(i, j) = noise_of_all(row, column) * unit[i] * unit[j];
    }
  }
  const Eigen::MatrixXd Q = orthonormal_basis(G);
  const Eigen::MatrixXd P = Eigen::MatrixXd::Identity(n, n) - Q * Q.transpose();
  const double weight = H.diagonal().mean();
  const Eigen::MatrixXd within = P * H * P + weight * Q * Q.transpose();
  const SymmetricEigen eigen = symmetric_eigen(within);
  Eigen::VectorXd values = eigen.values;
  const double least = 1e-14 * values.maxCoeff();
  for (double& v : values) v = 1 / std::max(v, least);
  const Eigen::MatrixXd root = P * eigen.vectors * values.cwiseSqrt().asDiagonal();
  found.shared_px = normal.shared_error(unit.asDiagonal() * root);
  found.track_weight = normal.fair_track_weight(found.shared_px);
  const Eigen::MatrixXd of_all = normal.systematic(found.shared_px);
  Eigen::MatrixXd systematic(n, of_all.cols());
  for (Eigen::Index i = 0; i < n; ++i)
    systematic.row(i) = unit[i] * of_all.row(result.at[static_cast<std::size_t>(i)]);
  result.root.resize(n, n + of_all.cols());
  result.root << root * (root.transpose() * square_root(noise)),
      root * (root.transpose() * systematic);
  result.root = unit.asDiagonal() * result.root;
  result.matrix = result.root * result.root.transpose();
  return result;
}

using DeviceChange = Eigen::Matrix<double, kBlock, 1>;

/// Turned by the first three numbers in its own frame, shifted by the next, the others added to
/// its inner parameters.
BundleDevice changed(BundleDevice device, const DeviceChange& change) {
  const Vec3 turn = change.head<3>();
  const Mat3 R =
      (turn.norm() > 0 ? Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix()
                       : Mat3::Identity().eval()) *
      rotation_of(device);
  const Eigen::AngleAxisd axis(R);
  for (Eigen::Index k = 0; k < 3; ++k) {
    device.pose[static_cast<std::size_t>(k)] = axis.angle() * axis.axis()[k];
    device.pose[static_cast<std::size_t>(3 + k)] += change[3 + k];
  }
  for (std::size_t i = 0; i < kIntrinsics; ++i)
    device.inner[i] += change[kPose + static_cast<Eigen::Index>(i)];
  return device;
}

/// The problem's devices moved by one draw of the covariance.
std::vector<BundleDevice> drawn_devices(const BundleProblem& problem, const Covariance& covariance,
                                        Random& random) {
  Eigen::VectorXd z(covariance.root.cols());
  for (double& v : z) v = random.normal();
  const Eigen::VectorXd change = covariance.root * z;
  std::vector<BundleDevice> devices = problem.devices;
  std::vector<DeviceChange> changes(devices.size(), DeviceChange::Zero());
  for (std::size_t i = 0; i < covariance.at.size(); ++i)
    changes[static_cast<std::size_t>(covariance.at[i] / kBlock)][covariance.at[i] % kBlock] =
        change[static_cast<Eigen::Index>(i)];
  for (std::size_t d = 0; d < devices.size(); ++d)
    if (devices[d].present) devices[d] = changed(devices[d], changes[d]);
  return devices;
}

/// Some points of the volume, seen without error by the rig as found.
BundleProblem exact_points(const BundleProblem& problem) {
  constexpr std::size_t kPoints = 200;
  BundleProblem exact;
  exact.devices = problem.devices;
  std::vector<std::size_t> used;
  for (std::size_t t = 0; t < problem.tracks.size(); ++t)
    if (problem.used[t] != 0) used.push_back(t);
  for (const std::size_t t : evenly_picked(used, kPoints)) {
    Track track = problem.tracks[t];
    for (TrackView& view : track.views) {  // as the rig itself would see the point
      const auto error = view_error(problem.devices[view.device], problem.points[t], view);
      if (error) view.pixel += *error;
    }
    exact.tracks.push_back(track);
    exact.points.push_back(problem.points[t]);
  }
  return exact;
}

/// Errors of points measured with drawn rigs.
void measure_volume(const BundleProblem& exact, const Covariance& covariance, std::uint64_t seed,
                    Uncertainty& result) {
  constexpr int kDraws = 30;
  const std::size_t count = exact.tracks.size();
  std::vector<double> squares(count, 0);
  std::vector<int> draws(count, 0);
  Random random(seed);
  for (int draw = 0; draw < kDraws; ++draw) {
    BundleProblem moved = exact;
    moved.devices = drawn_devices(exact, covariance, random);
    std::vector<std::size_t> found;
    Eigen::Matrix3Xd a(3, count);
    Eigen::Matrix3Xd b(3, count);
    for (std::size_t i = 0; i < count; ++i) {
      const auto point = triangulate(moved, moved.tracks[i], kLeastAngle);
      if (!point) continue;
      a.col(static_cast<Eigen::Index>(found.size())) = *point;
      b.col(static_cast<Eigen::Index>(found.size())) = exact.points[i];
      found.push_back(i);
    }
    if (found.size() < 4) continue;
    const auto n = static_cast<Eigen::Index>(found.size());
    const Eigen::Matrix4d S = fit_similarity(a.leftCols(n), b.leftCols(n), true);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Vec3 error = (S * a.col(i).homogeneous()).head<3>() - b.col(i);
      squares[found[static_cast<std::size_t>(i)]] += error.squaredNorm();
      ++draws[found[static_cast<std::size_t>(i)]];
    }
  }
  std::vector<double> sigmas;
  for (std::size_t i = 0; i < count; ++i)
    if (draws[i] > 0) sigmas.push_back(std::sqrt(squares[i] / draws[i]));
  result.volume_median = lower_quantile(sigmas, 0.5);
  result.volume_p95 = lower_quantile(sigmas, 0.95);
}

/// How a device's centre moves, in the device's frame, by its pose: a turn by r and a shift of t by
/// dt move it by -(t x r + dt).
Eigen::Matrix<double, 3, kPose> center_by_pose(const BundleDevice& device) {
  Eigen::Matrix<double, 3, kPose> by_pose;
  by_pose << cross_matrix(rotation_of(device) * center_of(device)), -Mat3::Identity();
  return by_pose;
}

/// By how much the logarithm of the size of `exact`'s points changes where parameter `kind` of a
/// device moves, and the points are measured anew.
double size_by_parameter(const BundleProblem& exact, const Vec3& middle, double square_size,
                         std::size_t d, Eigen::Index kind, double sigma) {
  constexpr double kStep = 0.1;  // deviations: what the covariance holds for is linear
  std::array<BundleProblem, 2> moved{exact, exact};
  for (const int side : {0, 1}) {
    DeviceChange change = DeviceChange::Zero();
    change[kind] = (side == 0 ? -kStep : kStep) * sigma;
    moved[static_cast<std::size_t>(side)].devices[d] = changed(exact.devices[d], change);
  }
  double sum = 0;
  for (std::size_t i = 0; i < exact.tracks.size(); ++i) {
    if (view_in(exact.tracks[i], d) == nullptr) continue;
    const auto before = triangulate(moved[0], exact.tracks[i], kLeastAngle);
    const auto after = triangulate(moved[1], exact.tracks[i], kLeastAngle);
    if (before && after) sum += (exact.points[i] - middle).dot(*after - *before);
  }
  return sum / (2 * kStep * sigma * square_size);
}

Eigen::MatrixXd size_and_centers(const BundleProblem& exact, const Covariance& covariance) {
  if (exact.points.empty()) return {};
  Vec3 middle = Vec3::Zero();
  for (const Vec3& x : exact.points) middle += x / static_cast<double>(exact.points.size());
  double square_size = 0;
  for (const Vec3& x : exact.points) square_size += (x - middle).squaredNorm();
  if (!(square_size > 0)) return {};
  const auto devices = static_cast<Eigen::Index>(exact.devices.size());
  Eigen::MatrixXd by_free = Eigen::MatrixXd::Zero(1 + 3 * devices, covariance.matrix.rows());
  for (std::size_t i = 0; i < covariance.at.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    const Eigen::Index d = covariance.at[i] / kBlock;
    const Eigen::Index kind = covariance.at[i] % kBlock;
    const BundleDevice& device = exact.devices[static_cast<std::size_t>(d)];
    const double sigma = std::sqrt(covariance.matrix(column, column));
    if (sigma > 0)
      by_free(0, column) =
          size_by_parameter(exact, middle, square_size, static_cast<std::size_t>(d), kind, sigma);
    if (kind < kPose)
      by_free.block<3, 1>(1 + 3 * d, column) =
          rotation_of(device).transpose() * center_by_pose(device).col(kind);
  }
  const Eigen::MatrixXd root = by_free * covariance.root;
  return root * root.transpose();
}

/// Deviations of a device's centre along its axes: turn and shift both go into it, and how they go
/// together.
Vec3 center_deviation(const BundleDevice& device, std::size_t d,
                      const Eigen::MatrixXd& of_size_and_centers) {
  const Eigen::Index at = 1 + 3 * static_cast<Eigen::Index>(d);
  const Mat3 in_world = of_size_and_centers.block<3, 3>(at, at);
  const Mat3 R = rotation_of(device);
  return (R * in_world * R.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
}

}  // namespace

Uncertainty uncertainty(const BundleProblem& problem, const BundleOptions& adjusted,
                        std::uint64_t seed) {
  Uncertainty result;
  result.devices.resize(problem.devices.size());
  Vec3 middle = Vec3::Zero();
  std::size_t points = 0;
  for (std::size_t t = 0; t < problem.points.size(); ++t) {
    if (problem.used[t] == 0) continue;
    middle += problem.points[t];
    ++points;
  }
  if (points == 0) return result;
  middle /= static_cast<double>(points);
  std::vector<double> radii;
  for (std::size_t t = 0; t < problem.points.size(); ++t)
    if (problem.used[t] != 0) radii.push_back((problem.points[t] - middle).norm());
  result.volume_radius = lower_quantile(radii, 0.9);
  double distance = 0;
  for (const BundleDevice& device : problem.devices)
    if (device.present) distance = std::max(distance, (center_of(device) - middle).norm());

  const ReducedEquations normal(problem, adjusted);
  result.variance_factor = normal.variance_factor();
  const Covariance covariance = invert(normal, problem, middle, distance, result);
  for (std::size_t i = 0; i < covariance.at.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const auto d = static_cast<std::size_t>(covariance.at[i] / kBlock);
    const auto kind = covariance.at[i] % kBlock;
    const double sigma = std::sqrt(covariance.matrix(row, row));
    DeviceUncertainty& device = result.devices[d];
    if (kind < 3) device.rotation[kind] = sigma;
    if (kind >= kPose) device.inner[static_cast<std::size_t>(kind - kPose)] = sigma;
  }
  const BundleProblem exact = exact_points(problem);
  result.size_and_centers = size_and_centers(exact, covariance);
  for (std::size_t d = 0; d < result.devices.size(); ++d) {
    if (problem.devices[d].present && result.size_and_centers.size() > 0)
      result.devices[d].position = center_deviation(problem.devices[d], d, result.size_and_centers);
    for (std::size_t i = 0; i < kIntrinsics; ++i) {
      const double prior = problem.devices[d].prior_sigma[i];
      // fy moves with fx: its prior says nothing about it alone.
      result.devices[d].is_prior[i] =
          i != kFy && result.devices[d].inner[i] > 0 && result.devices[d].inner[i] > 0.6 * prior;
    }
  }
  measure_volume(exact, covariance, seed, result);
  return result;
}

}  // namespace pencilscan
