#include "pencilscan/calibration/uncertainty.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <tuple>

#include "pencilscan/calibration/board_corners.h"
#include "pencilscan/calibration/structure.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/random.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

constexpr Eigen::Index kPose = 6;
constexpr Eigen::Index kBlock = kPose + kIntrinsics;

using Block = Eigen::Matrix<double, 2, kBlock>;

Mat3 cross_matrix(const Vec3& v) {
  Mat3 m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// Normal equations of all devices, 15 numbers each: a small rotation in the device's frame
/// (x -> x + r x (R X)), a shift t, and the inner parameters.
class NormalEquations {
 public:
  NormalEquations(const BundleProblem& problem, unsigned free_inner, double loss_scale,
                  double extra_sigma_px)
      : problem_(problem),
        loss_scale_(loss_scale),
        extra_(extra_sigma_px),
        H_(Eigen::MatrixXd::Zero(kBlock * count(), kBlock * count())) {
    for (const BundleDevice& device : problem.devices) rotations_.push_back(rotation_of(device));
    for (std::size_t t = 0; t < problem.tracks.size(); ++t)
      if (problem.used[t] != 0) add_track(t);
    add_boards();
    add_priors(free_inner);
  }

  [[nodiscard]] Eigen::Index count() const {
    return static_cast<Eigen::Index>(problem_.devices.size());
  }
  [[nodiscard]] const Eigen::MatrixXd& H() const { return H_; }
  [[nodiscard]] bool is_free(Eigen::Index i) const { return free_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] double variance_factor() const {
    const double scale = kDeviationPerMedian * lower_quantile(residuals_, 0.5);
    return scale * scale;
  }

 private:
  struct ViewRow {
    Eigen::Index device;
    Block device_part;
    Eigen::Matrix<double, 2, 3> point_part;
  };

  /// Weighted derivatives of a view of a point.
  [[nodiscard]] ViewRow row_of(const ViewLinearization& view, std::size_t device, const Vec3& point,
                               bool has_loss) const {
    // Derivatives by the point in the device's frame give those by the pose.
    const Mat3& R = rotations_[device];
    const Eigen::Matrix<double, 2, 3> by_local = view.point * R.transpose();
    const double weight =
        has_loss ? 1 / (1 + view.residual.squaredNorm() / (loss_scale_ * loss_scale_)) : 1;
    ViewRow row;
    row.device = static_cast<Eigen::Index>(device);
    row.device_part.leftCols<3>() = -by_local * cross_matrix(R * point);
    row.device_part.middleCols<3>(3) = by_local;
    row.device_part.rightCols<kIntrinsics>() = view.inner;
    row.device_part *= std::sqrt(weight);
    row.point_part = std::sqrt(weight) * view.point;
    return row;
  }

  void add_track(std::size_t t) {
    std::vector<ViewRow> rows;
    const auto& views = problem_.tracks[t].views;
    const double n = static_cast<double>(views.size()) - 1;
    for (std::size_t i = 0; i < views.size(); ++i) {
      const BundleDevice& device = problem_.devices[views[i].device];
      if (!device.present || !view_error(device, problem_.points[t], views[i])) continue;
      const ViewLinearization view =
          linearize(device, problem_.points[t], views[i], i == 0 ? 0 : extra_);
      if (i > 0)
        for (Eigen::Index k = 0; k < 2; ++k)
          residuals_.push_back(std::abs(view.residual[k]) * std::sqrt(2 * n / (2 * n - 1)));
      rows.push_back(row_of(view, views[i].device, problem_.points[t], i > 0));
    }
    if (rows.size() < 2) return;
    Mat3 V = Mat3::Zero();
    for (const ViewRow& row : rows) V += row.point_part.transpose() * row.point_part;
    const Mat3 V_inverse = V.inverse();
    if (!V_inverse.allFinite()) return;
    for (const ViewRow& a : rows) {
      const Eigen::Matrix<double, kBlock, 3> Wa = a.device_part.transpose() * a.point_part;
      H_.block<kBlock, kBlock>(kBlock * a.device, kBlock * a.device) +=
          a.device_part.transpose() * a.device_part;
      const Eigen::Matrix<double, kBlock, 3> WaV = Wa * V_inverse;
      for (const ViewRow& b : rows)
        H_.block<kBlock, kBlock>(kBlock * a.device, kBlock * b.device) -=
            WaV * (b.point_part.transpose() * b.device_part);
    }
  }

  /// The poses of boards are eliminated as points are.
  void add_boards() {
    using DeviceByBoard = Eigen::Matrix<double, kBlock, 6>;
    struct Sum {
      Mat6 board = Mat6::Zero();
      std::map<Eigen::Index, DeviceByBoard> by_device;
    };
    std::map<std::size_t, Sum> sums;
    for (const BoardView& seen : problem_.board_views) {
      const BundleDevice& device = problem_.devices[seen.view.device];
      const Vec3 point = corner_point(problem_, seen);
      const Vec3 arm = point - transform_from(problem_.board_poses[seen.board]).translation;
      if (!device.present || !view_error(device, point, seen.view)) continue;
      const ViewRow row =
          row_of(linearize(device, point, seen.view, extra_), seen.view.device, point, true);
      Eigen::Matrix<double, 2, 6> by_board;
      by_board << -row.point_part * cross_matrix(arm), row.point_part;
      Sum& sum = sums[seen.board];
      sum.board += by_board.transpose() * by_board;
      const auto [at, is_new] = sum.by_device.try_emplace(row.device, DeviceByBoard::Zero());
      at->second += row.device_part.transpose() * by_board;
      H_.block<kBlock, kBlock>(kBlock * row.device, kBlock * row.device) +=
          row.device_part.transpose() * row.device_part;
    }
    for (const auto& [board, sum] : sums)
      for (const auto& [a, Wa] : sum.by_device)
        for (const auto& [b, Wb] : sum.by_device)
          H_.block<kBlock, kBlock>(kBlock * a, kBlock * b) -=
              Wa * solve_symmetric(Eigen::MatrixXd(sum.board), Wb.transpose());
  }

  void add_priors(unsigned free_inner) {
    free_.assign(static_cast<std::size_t>(H_.rows()), false);
    for (Eigen::Index d = 0; d < count(); ++d) {
      const BundleDevice& device = problem_.devices[static_cast<std::size_t>(d)];
      if (!device.present) continue;
      for (Eigen::Index i = 0; i < kPose; ++i)
        free_[static_cast<std::size_t>(kBlock * d + i)] = true;
      for (std::size_t i = 0; i < kIntrinsics; ++i) {
        const Eigen::Index at = kBlock * d + kPose + static_cast<Eigen::Index>(i);
        const double sigma = device.prior_sigma[i];
        if (sigma == 0 || (free_inner >> i & 1U) == 0) continue;
        free_[static_cast<std::size_t>(at)] = true;
        if (!std::isfinite(sigma)) continue;
        if (i != kFy) {
          H_(at, at) += 1 / (sigma * sigma);
          continue;
        }
        // On fy / fx.
        const double fx = device.inner[kFx];
        const Eigen::Index fx_at = kBlock * d + kPose + kFx;
        Eigen::Vector2d row(-device.inner[kFy] / (fx * fx), 1 / fx);
        row /= sigma;
        for (const auto& [a, ia] : {std::pair(0, fx_at), std::pair(1, at)})
          for (const auto& [b, ib] : {std::pair(0, fx_at), std::pair(1, at)})
            H_(ia, ib) += row[a] * row[b];
      }
    }
  }

  const BundleProblem& problem_;
  double loss_scale_;
  double extra_;
  Eigen::MatrixXd H_;
  std::vector<Mat3> rotations_;
  std::vector<bool> free_;
  std::vector<double> residuals_;
};

/// How poses change under the similarities of the world about `middle`: turn, shift, scale. A board
/// fixes the scale.
Eigen::MatrixXd gauge(const BundleProblem& problem, const Vec3& middle) {
  const auto count = static_cast<Eigen::Index>(problem.devices.size());
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(kBlock * count, 7);
  for (Eigen::Index d = 0; d < count; ++d) {
    const BundleDevice& device = problem.devices[static_cast<std::size_t>(d)];
    if (!device.present) continue;
    const Mat3 R = rotation_of(device);
    // X' = X + w x (X - m) + v + s (X - m); the device's frame turns and moves along.
    G.block<3, 3>(kBlock * d, 0) = -R;
    G.block<3, 3>(kBlock * d + 3, 0) = R * cross_matrix(-middle);
    G.block<3, 3>(kBlock * d + 3, 3) = -R;
    const Vec3 t(device.pose[3], device.pose[4], device.pose[5]);
    G.block<3, 1>(kBlock * d + 3, 6) = t + R * middle;
  }
  if (!problem.board_views.empty()) G.conservativeResize(Eigen::NoChange, 6);
  return G;
}

/// By how much more the errors vary from one part of the images to the next than independent ones
/// would: the mean squared mean of a cell's errors, over that of as many independent errors. Lenses
/// unlike the model, bent boards and light from elsewhere make neighbours err alike, and many alike
/// errors weigh as one. At least 1.
double shared_variance(const BundleProblem& problem) {
  constexpr int kCells = 8;  // along an image's width
  constexpr double kFewest = 5;
  struct Cell {
    Vec2 sum = Vec2::Zero();
    double squares = 0;
    double count = 0;
  };
  std::map<std::tuple<std::size_t, int, int>, Cell> cells;
  for_each_residual(problem, [&](std::size_t, const TrackView& view, const Vec2& error) {
    const double size = (2 * problem.devices[view.device].prior[kCx] + 1) / kCells;
    Cell& cell = cells[{view.device, static_cast<int>(view.pixel.x() / size),
                        static_cast<int>(view.pixel.y() / size)}];
    cell.sum += error;
    cell.squares += error.squaredNorm();
    cell.count += 1;
  });
  double of_means = 0;
  double expected = 0;
  for (const auto& [key, cell] : cells) {
    if (cell.count < kFewest) continue;
    of_means += cell.sum.squaredNorm() / cell.count;
    expected += cell.squares / cell.count;
  }
  return expected > 0 ? std::max(1.0, of_means / expected) : 1;
}

struct Covariance {
  std::vector<Eigen::Index> at;  ///< rows of the full system that are free
  Eigen::MatrixXd matrix;
  Eigen::MatrixXd root;  ///< matrix = root * root'
};

Covariance invert(const NormalEquations& normal, const BundleProblem& problem, const Vec3& middle,
                  double distance) {
  Covariance result;
  for (Eigen::Index i = 0; i < normal.H().rows(); ++i)
    if (normal.is_free(i)) result.at.push_back(i);
  const auto n = static_cast<Eigen::Index>(result.at.size());
  // Scaled to comparable units: radians, shifts over the distance, focal lengths over themselves...
  Eigen::VectorXd unit(n);
  Eigen::MatrixXd H(n, n);
  const Eigen::MatrixXd full_gauge = gauge(problem, middle);
  Eigen::MatrixXd G(n, full_gauge.cols());
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index at = result.at[static_cast<std::size_t>(i)];
    const Eigen::Index kind = at % kBlock;
    unit[i] = kind < 3 ? 1 : kind < 6 ? distance : kind < kPose + kK1 ? 1000 : 1;
    G.row(i) = full_gauge.row(at) / unit[i];
  }
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      H(i, j) = normal.H()(result.at[static_cast<std::size_t>(i)],
                           result.at[static_cast<std::size_t>(j)]) *
                unit[i] * unit[j];
  const Eigen::MatrixXd Q = orthonormal_basis(G);
  const Eigen::MatrixXd P = Eigen::MatrixXd::Identity(n, n) - Q * Q.transpose();
  const double weight = H.diagonal().mean();
  const Eigen::MatrixXd within = P * H * P + weight * Q * Q.transpose();
  const SymmetricEigen eigen = symmetric_eigen(within);
  Eigen::VectorXd values = eigen.values;
  const double least = 1e-14 * values.maxCoeff();
  for (double& v : values) v = 1 / std::max(v, least);
  const Eigen::MatrixXd root = P * eigen.vectors * values.cwiseSqrt().asDiagonal();
  result.root = unit.asDiagonal() * root;
  result.matrix = result.root * result.root.transpose();
  return result;
}

/// The problem's devices moved by one draw of the covariance.
std::vector<BundleDevice> drawn_devices(const BundleProblem& problem, const Covariance& covariance,
                                        double factor, Random& random) {
  Eigen::VectorXd z(covariance.root.cols());
  for (double& v : z) v = random.normal();
  const Eigen::VectorXd change = factor * (covariance.root * z);
  std::vector<BundleDevice> devices = problem.devices;
  std::vector<Eigen::Matrix<double, kBlock, 1>> changes(devices.size());
  for (auto& c : changes) c.setZero();
  for (std::size_t i = 0; i < covariance.at.size(); ++i)
    changes[static_cast<std::size_t>(covariance.at[i] / kBlock)][covariance.at[i] % kBlock] =
        change[static_cast<Eigen::Index>(i)];
  for (std::size_t d = 0; d < devices.size(); ++d) {
    if (!devices[d].present) continue;
    const Vec3 turn = changes[d].head<3>();
    const Mat3 R =
        (turn.norm() > 0 ? Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix()
                         : Mat3::Identity().eval()) *
        rotation_of(devices[d]);
    const Eigen::AngleAxisd axis(R);
    for (Eigen::Index k = 0; k < 3; ++k) {
      devices[d].pose[static_cast<std::size_t>(k)] = axis.angle() * axis.axis()[k];
      devices[d].pose[static_cast<std::size_t>(3 + k)] += changes[d][3 + k];
    }
    for (std::size_t i = 0; i < kIntrinsics; ++i)
      devices[d].inner[i] += changes[d][kPose + static_cast<Eigen::Index>(i)];
  }
  return devices;
}

/// Errors of points measured with drawn rigs.
void measure_volume(const BundleProblem& problem, const Covariance& covariance, double factor,
                    std::uint64_t seed, Uncertainty& result) {
  constexpr std::size_t kPoints = 200;
  constexpr int kDraws = 30;
  BundleProblem exact;
  exact.devices = problem.devices;
  std::vector<std::size_t> used;
  for (std::size_t t = 0; t < problem.tracks.size(); ++t)
    if (problem.used[t] != 0) used.push_back(t);
  const std::size_t count = std::min(used.size(), kPoints);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t t = used[i * used.size() / count];
    Track track = problem.tracks[t];
    for (TrackView& view : track.views) {  // as the rig itself would see the point
      const auto error = view_error(problem.devices[view.device], problem.points[t], view);
      if (error) view.pixel += *error;
    }
    exact.tracks.push_back(track);
    exact.points.push_back(problem.points[t]);
  }
  std::vector<double> squares(count, 0);
  std::vector<int> draws(count, 0);
  Random random(seed);
  for (int draw = 0; draw < kDraws; ++draw) {
    BundleProblem moved = exact;
    moved.devices = drawn_devices(problem, covariance, factor, random);
    std::vector<std::size_t> found;
    Eigen::Matrix3Xd a(3, count);
    Eigen::Matrix3Xd b(3, count);
    for (std::size_t i = 0; i < count; ++i) {
      const auto point = triangulate(moved, moved.tracks[i], 0.02);
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

}  // namespace

Uncertainty uncertainty(const BundleProblem& problem, unsigned free_inner, double loss_scale,
                        double extra_sigma_px, std::uint64_t seed) {
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

  const NormalEquations normal(problem, free_inner, loss_scale, extra_sigma_px);
  result.shared_variance = shared_variance(problem);
  result.variance_factor = std::max(normal.variance_factor(), 0.05) * result.shared_variance;
  const Covariance covariance = invert(normal, problem, middle, distance);
  const double factor = std::sqrt(result.variance_factor);
  for (std::size_t i = 0; i < covariance.at.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const auto d = static_cast<std::size_t>(covariance.at[i] / kBlock);
    const auto kind = covariance.at[i] % kBlock;
    const double sigma = factor * std::sqrt(covariance.matrix(row, row));
    DeviceUncertainty& device = result.devices[d];
    if (kind < 3) device.rotation_rad = std::hypot(device.rotation_rad, sigma / std::sqrt(3.0));
    if (kind >= 3 && kind < kPose) device.position[kind - 3] = sigma;
    if (kind >= kPose) device.inner[static_cast<std::size_t>(kind - kPose)] = sigma;
  }
  for (std::size_t d = 0; d < result.devices.size(); ++d) {
    for (std::size_t i = 0; i < kIntrinsics; ++i) {
      double prior = problem.devices[d].prior_sigma[i];
      if (i == kFy) prior *= problem.devices[d].inner[kFx];
      // fy moves with fx: its prior says nothing about it alone.
      result.devices[d].is_prior[i] =
          i != kFy && result.devices[d].inner[i] > 0 && result.devices[d].inner[i] > 0.6 * prior;
    }
  }
  measure_volume(problem, covariance, factor, seed, result);
  return result;
}

}  // namespace pencilscan
