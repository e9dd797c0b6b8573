#include "pencilscan/bundle/reduced_equations.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/bundle/board_corners.h"
#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/extra_variance.h"
#include "pencilscan/geometry/cross_matrix.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

/// How a corner moves, in the board's frame, by one standard deviation of each error of its shape.
/// Printed boards are stretched by a part in a thousand along one side (paper, rollers), half of
/// which is size, and bent by as much of their diagonal.
class BoardShape {
 public:
  explicit BoardShape(const std::vector<BoardView>& views) {
    Vec2 low = views.front().position_mm;
    Vec2 high = low;
    for (const BoardView& v : views) {
      low = low.cwiseMin(v.position_mm);
      high = high.cwiseMax(v.position_mm);
    }
    middle_ = (low + high) / 2;
    half_diagonal_ = (high - low).norm() / 2;
  }

  using Moves = Eigen::Matrix<double, 3, ReducedEquations::kBoardShapes>;
  [[nodiscard]] Moves moves(const Vec2& position_mm) const {
    constexpr double kStretch = 1e-3;
    constexpr double kBend = 1e-3;  // of the diagonal, at the end of half of it
    const Vec2 x = position_mm - middle_;
    const double sag = 2 * kBend / half_diagonal_;
    Moves moves = Moves::Zero();
    moves.col(0) = kStretch / 2 * Vec3(x.x(), -x.y(), 0);
    moves.col(1) = kStretch / 2 * Vec3(x.y(), x.x(), 0);
    moves(2, 2) = sag * x.x() * x.x();
    moves(2, 3) = sag * x.x() * x.y();
    moves(2, 4) = sag * x.y() * x.y();
    moves.col(5) = kStretch / 2 * Vec3(x.x(), x.y(), 0);
    return moves;
  }

 private:
  Vec2 middle_;
  double half_diagonal_ = 1;
};

/// Share of the variance of given K that is one error of all of them. Nobody states it, and
/// adjustment does not show it: a ring fits with all focal lengths wrong alike. With all shares
/// from 0 to 1 alike likely, the variance of any estimate, which is linear in the share, has in the
/// mean that of a half.
constexpr double kCommonOfGivenK = 0.5;

}  // namespace

ReducedEquations::ReducedEquations(const BundleProblem& problem, const BundleOptions& adjusted)
    : problem_(problem),
      adjusted_(adjusted),
      H_(Eigen::MatrixXd::Zero(kBlock * count(), kBlock * count())),
      patches_(Eigen::MatrixXd::Zero(kBlock * count(), 2 * kPatches * kPatches * count())),
      cells_(Eigen::MatrixXd::Zero(kBlock * count(), 2 * kCells * kCells * count())),
      in_cells_(static_cast<std::size_t>(kCells * kCells * count())),
      shapes_(Eigen::MatrixXd::Zero(kBlock * count(), kBoardShapes)),
      of_given_K_(Eigen::MatrixXd::Zero(kBlock * count(), kBlock * count())),
      given_K_(Eigen::MatrixXd::Zero(kBlock * count(), kOfGivenK)),
      patch_views_(Eigen::VectorXd::Zero(patches_.cols())) {
  for (const BundleDevice& device : problem.devices) rotations_.push_back(rotation_of(device));
  for (std::size_t t = 0; t < problem.tracks.size(); ++t)
    if (problem.used[t] != 0) add_track(t);
  of_tracks_ = H_;
  if (!problem.board_views.empty()) add_boards();
  add_priors();
}

double ReducedEquations::variance_factor() const {
  constexpr double kLeast = 0.05;  // without noise a rig would be exact
  if (loss_.slope == 0) return 1;
  return std::max(loss_.weight * loss_.influence / (loss_.slope * loss_.slope), kLeast);
}

Eigen::MatrixXd ReducedEquations::random() const {
  // Boards count three times their scatter and priors are deviations: these are as they are.
  const double of_tracks = adjusted_.track_weight * variance_factor();
  return H_ + (of_tracks - 1) * of_tracks_ - kCommonOfGivenK * of_given_K_;
}

Eigen::MatrixXd ReducedEquations::systematic(double shared_px) const {
  Eigen::MatrixXd all(H_.rows(), patches_.cols() + shapes_.cols() + given_K_.cols());
  all << shared_px * patches_, shapes_, std::sqrt(kCommonOfGivenK) * given_K_;
  return all;
}

Eigen::MatrixXd ReducedEquations::free_rows(const Eigen::MatrixXd& all) const {
  Eigen::MatrixXd rows(std::count(free_.begin(), free_.end(), true), all.cols());
  Eigen::Index row = 0;
  for (Eigen::Index i = 0; i < all.rows(); ++i)
    if (is_free(i)) rows.row(row++) = all.row(i);
  return rows;
}

double ReducedEquations::visible_shared_variance(const Eigen::MatrixXd& root) const {
  constexpr double kFewest = 5;  // views in a cell
  // With J the derivatives of whitened residuals, points taken out, and C = root root', residuals
  // keep I - J C J' of errors, so (I - J C J')^2 of their covariance.
  const Eigen::MatrixXd by_free = free_rows(free_rows(of_tracks_).transpose());
  const Eigen::MatrixXd of_root = root.transpose() * by_free * root;
  const Eigen::MatrixXd cells = root.transpose() * free_rows(cells_);
  double squares = 0;
  double weight = 0;
  double freedom = 0;  // of the means
  double within = 0;   // what scatter within cells makes of `squares`, with all of `freedom_within`
  double freedom_within = 0;
  for (std::size_t i = 0; i < in_cells_.size(); ++i) {
    const Cell& cell = in_cells_[i];
    const double views = cell.weight2 > 0 ? cell.weight * cell.weight / cell.weight2 : 0;
    if (views < kFewest) continue;
    const auto columns = cells.middleCols<2>(2 * static_cast<Eigen::Index>(i));
    const double taken =
        2 * columns.squaredNorm() - (columns.transpose() * of_root * columns).trace();
    const double of_mean = cell.error.squaredNorm();
    squares += of_mean / cell.weight;
    weight += 2 * cell.weight;
    freedom += (cell.freedom - taken) / cell.weight;
    within += (cell.squares - of_mean / views) / (1 - 1 / views) / cell.weight;
    freedom_within += cell.freedom / cell.weight;
  }
  if (freedom <= 0) return 0;
  return mean_extra_variance(squares, freedom, within / freedom_within, weight / freedom);
}

double ReducedEquations::shared_error(const Eigen::MatrixXd& root) const {
  // A camera and a projector before a plane, the weakest rig there, show .2 (docs/calibration.md).
  constexpr double kLeastShare = 0.05;
  constexpr double kLeastFreedom = 3;  // Student's t has a variance above 2 only
  if (patch_views_.isZero()) return 0;
  const double fitted = (root.transpose() * free_rows(patches_)).squaredNorm();
  const double all = patch_views_.sum();
  const double share =
      std::max((after_points_ - fitted) / (adjusted_.track_weight * all), kLeastShare);
  const double numbers = all * all / patch_views_.squaredNorm();
  const double freedom = std::max(share * numbers, kLeastFreedom);
  return std::sqrt(visible_shared_variance(root) * freedom / (share * (freedom - 2)));
}

double ReducedEquations::fair_track_weight(double shared_px) const {
  if (patch_views_.isZero()) return 1;
  const double by_square_px = patch_views_.squaredNorm() / patch_views_.sum();
  return 1 / (1 + by_square_px * shared_px * shared_px / variance_factor());
}

ReducedEquations::ViewRow ReducedEquations::row_of(const ViewLinearization& view,
                                                   const TrackView& seen, const Vec3& point,
                                                   Counts counts) const {
  // Derivatives by the point in the device's frame give those by the pose.
  const Mat3& R = rotations_[seen.device];
  const Eigen::Matrix<double, 2, 3> by_local = view.point * R.transpose();
  const bool is_hub = counts == Counts::kExactly;
  double weight = 1;
  if (!is_hub)
    weight /= 1 + view.residual.squaredNorm() / (adjusted_.loss_scale * adjusted_.loss_scale);
  if (counts == Counts::kAsTrack) weight *= adjusted_.track_weight;
  ViewRow row;
  row.device = static_cast<Eigen::Index>(seen.device);
  row.device_part.leftCols<3>() = -by_local * cross_matrix(R * point);
  row.device_part.middleCols<3>(3) = by_local;
  row.device_part.rightCols<kIntrinsics>() = view.inner;
  row.device_part *= std::sqrt(weight);
  row.point_part = std::sqrt(weight) * view.point;
  row.by_px = std::sqrt(weight) / std::hypot(seen.sigma_px, is_hub ? 0 : adjusted_.extra_sigma_px);
  row.residual = std::sqrt(weight) * view.residual;
  row.patch = row.cell = -1;
  if (is_hub) return row;
  // Squares: rows beyond the last one count with it.
  const auto square = [&](Eigen::Index parts) {
    const double px =
        static_cast<double>(problem_.devices[seen.device].width) / static_cast<double>(parts);
    const auto place = [&](double x) {
      return std::clamp<Eigen::Index>(static_cast<Eigen::Index>(x / px), 0, parts - 1);
    };
    return 2 * (parts * parts * row.device + parts * place(seen.pixel.y()) + place(seen.pixel.x()));
  };
  row.patch = square(kPatches);
  row.cell = square(kCells);
  return row;
}

void ReducedEquations::add_to_loss(double squared, double freedom) {
  const double c2 = adjusted_.loss_scale * adjusted_.loss_scale;
  const double weight = 1 / (1 + squared / c2);
  const double influence = weight * weight * squared;
  loss_.weight += freedom * weight;
  loss_.influence += influence;
  loss_.slope += freedom * weight - 2 * influence / c2;
}

void ReducedEquations::add_track(std::size_t t) {
  std::vector<ViewRow> rows;
  const auto& views = problem_.tracks[t].views;
  const double n = static_cast<double>(views.size()) - 1;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const BundleDevice& device = problem_.devices[views[i].device];
    if (!device.present || !view_error(device, problem_.points[t], views[i])) continue;
    const ViewLinearization view =
        linearize(device, problem_.points[t], views[i], i == 0 ? 0 : adjusted_.extra_sigma_px);
    // The point takes one degree of freedom of all its views: its place on the hub's ray.
    if (i > 0) add_to_loss(view.residual.squaredNorm(), (2 * n - 1) / n);
    rows.push_back(
        row_of(view, views[i], problem_.points[t], i == 0 ? Counts::kExactly : Counts::kAsTrack));
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
    for (const ViewRow& b : rows) {
      H_.block<kBlock, kBlock>(kBlock * a.device, kBlock * b.device) -=
          WaV * (b.point_part.transpose() * b.device_part);
      if (b.patch < 0) continue;
      Eigen::Matrix<double, kBlock, 2> by_shared = -b.by_px * WaV * b.point_part.transpose();
      if (&a == &b) by_shared += b.by_px * b.device_part.transpose();
      patches_.block<kBlock, 2>(kBlock * a.device, b.patch) += by_shared;
      cells_.block<kBlock, 2>(kBlock * a.device, b.cell) += by_shared;
    }
  }
  for (const ViewRow& row : rows) {
    if (row.patch < 0) continue;
    const double left = 2 - (row.point_part * V_inverse * row.point_part.transpose()).trace();
    const double square = row.by_px * row.by_px;
    patch_views_.segment<2>(row.patch).array() += square / adjusted_.track_weight;
    after_points_ += square * left;
    Cell& cell = in_cells_[static_cast<std::size_t>(row.cell / 2)];
    cell.error += row.by_px * row.residual;
    cell.weight += square;
    cell.weight2 += square * square;
    cell.squares += square * row.residual.squaredNorm();
    cell.freedom += square * left;
  }
}

void ReducedEquations::add_boards() {
  using DeviceByBoard = Eigen::Matrix<double, kBlock, 6>;
  using BoardByShape = Eigen::Matrix<double, 6, kBoardShapes>;
  struct Sum {
    Mat6 board = Mat6::Zero();
    BoardByShape by_shape = BoardByShape::Zero();
    std::map<Eigen::Index, DeviceByBoard> by_device;
  };
  const BoardShape shape(problem_.board_views);
  std::map<std::size_t, Sum> sums;
  for (const BoardView& seen : problem_.board_views) {
    const BundleDevice& device = problem_.devices[seen.view.device];
    const Vec3 point = corner_point(problem_, seen);
    const RigidTransform world_from_board = transform_from(problem_.board_poses[seen.board]);
    const Vec3 arm = point - world_from_board.translation;
    if (!device.present || !view_error(device, point, seen.view)) continue;
    const ViewRow row = row_of(linearize(device, point, seen.view, adjusted_.extra_sigma_px),
                               seen.view, point, Counts::kAsCorner);
    Eigen::Matrix<double, 2, 6> by_board;
    by_board << -row.point_part * cross_matrix(arm), row.point_part;
    const Eigen::Matrix<double, 2, kBoardShapes> by_shape =
        row.point_part * world_from_board.rotation * shape.moves(seen.position_mm);
    Sum& sum = sums[seen.board];
    sum.board += by_board.transpose() * by_board;
    sum.by_shape += by_board.transpose() * by_shape;
    const auto [at, is_new] = sum.by_device.try_emplace(row.device, DeviceByBoard::Zero());
    at->second += row.device_part.transpose() * by_board;
    H_.block<kBlock, kBlock>(kBlock * row.device, kBlock * row.device) +=
        row.device_part.transpose() * row.device_part;
    shapes_.middleRows<kBlock>(kBlock * row.device) += row.device_part.transpose() * by_shape;
  }
  for (const auto& [board, sum] : sums) {
    const Eigen::MatrixXd M(sum.board);
    for (const auto& [a, Wa] : sum.by_device) {
      for (const auto& [b, Wb] : sum.by_device)
        H_.block<kBlock, kBlock>(kBlock * a, kBlock * b) -= Wa * solve_symmetric(M, Wb.transpose());
      shapes_.middleRows<kBlock>(kBlock * a) -= Wa * solve_symmetric(M, sum.by_shape);
    }
  }
}

void ReducedEquations::add_priors() {
  free_.assign(static_cast<std::size_t>(H_.rows()), false);
  for (Eigen::Index d = 0; d < count(); ++d) {
    const BundleDevice& device = problem_.devices[static_cast<std::size_t>(d)];
    if (!device.present) continue;
    for (Eigen::Index i = 0; i < kPose; ++i) free_[static_cast<std::size_t>(kBlock * d + i)] = true;
    for (std::size_t i = 0; i < kIntrinsics; ++i) {
      const Eigen::Index at = kBlock * d + kPose + static_cast<Eigen::Index>(i);
      const double sigma = device.prior_sigma[i];
      if (sigma == 0 || (adjusted_.free_inner >> i & 1U) == 0) continue;
      free_[static_cast<std::size_t>(at)] = true;
      if (!std::isfinite(sigma)) continue;
      if (i != kFy) {
        H_(at, at) += 1 / (sigma * sigma);
        if (device.is_K_given && i <= kCy) add_given_K(at, i, sigma);
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

void ReducedEquations::add_given_K(Eigen::Index at, std::size_t intrinsic, double sigma) {
  of_given_K_(at, at) = 1 / (sigma * sigma);
  given_K_(at, intrinsic == kFx ? 0 : intrinsic == kCx ? 1 : 2) = 1 / sigma;
}

}  // namespace pencilscan
