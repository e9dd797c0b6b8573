#include "pencilscan/depth/shared_bends.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "pencilscan/depth/window_fit.h"

namespace pencilscan {
namespace {

using Bends = Eigen::Matrix<double, 5, 1>;  ///< of a Quadric: all but its depth
using BendsMatrix = Eigen::Matrix<double, 5, 5>;

constexpr int kReach = 2;  // nodes; windows farther off share no pixel with the node's own

/// With six or fewer, the covariance of five unknowns is singular or nearly so.
constexpr std::size_t kLeastSaid = 7;

double variance_of(const DepthNode& node) {
  const auto w = static_cast<double>(node.w);
  const double deviation = static_cast<double>(node.sigma) * w * w;
  return deviation * deviation;
}

/// What windows around say of one node's slopes and bends.
class BendPrior {
 public:
  /// Of like size for all: differences to the node's own.
  void add(const Bends& difference, double weight) {
    ++count_;
    weight_ += weight;
    sum_ += weight * difference;
    squares_ += (weight * difference) * difference.transpose();
  }
  /// False where too few said anything.
  [[nodiscard]] bool solve(Bends& mean, BendsMatrix& information) const {
    if (count_ < kLeastSaid) return false;
    constexpr double kRounding = 1e-6;
    mean = sum_ / weight_;
    // About the node's own: where a bend is greatest or least, it is farther from its neighbours'
    // than these are from one another.
    BendsMatrix covariance = squares_ / weight_;
    covariance.diagonal() *= 1 + kRounding;
    const Eigen::LLT<BendsMatrix> cholesky(covariance);
    if (cholesky.info() != Eigen::Success) return false;
    information = cholesky.solve(BendsMatrix::Identity());
    return information.allFinite();
  }

 private:
  std::size_t count_ = 0;
  double weight_ = 0;
  Bends sum_ = Bends::Zero();
  BendsMatrix squares_ = BendsMatrix::Zero();
};

/// What the nodes around say of this one, whose quadric is `own`.
BendPrior prior_of(const DepthMap& map, std::size_t node, const Quadric& own, int half) {
  BendPrior prior;
  const int row = static_cast<int>(node) / map.columns;
  const int column = static_cast<int>(node) % map.columns;
  for (int r = std::max(0, row - kReach); r <= std::min(map.rows - 1, row + kReach); ++r) {
    for (int c = std::max(0, column - kReach); c <= std::min(map.columns - 1, column + kReach);
         ++c) {
      const DepthNode& other = map.nodes[map.index(r, c)];
      if (!other.measured() || other.cut || (r == row && c == column)) continue;
      const Vec2 way = map.stride * Vec2(column - c, row - r);
      prior.add((quadric_at(other, way, half) - own).tail<5>(), 1 / variance_of(other));
    }
  }
  return prior;
}

}  // namespace

void share_bends(const FittedWindows& fitted, DepthMap& map) {
  std::vector<DepthNode> shared;
  shared.reserve(fitted.nodes.size());
  for (std::size_t k = 0; k < fitted.nodes.size(); ++k) {
    const DepthNode& node = shared.emplace_back(map.nodes[fitted.nodes[k]]);
    const Quadric own = quadric_at(node, Vec2::Zero(), fitted.half);
    Bends mean;
    BendsMatrix information;
    if (!prior_of(map, fitted.nodes[k], own, fitted.half).solve(mean, information)) continue;
    Mat6 all = fitted.information[k];
    all.bottomRightCorner<5, 5>() += information;
    const Eigen::LLT<Mat6> cholesky(all);
    Quadric right = Quadric::Zero();
    right.tail<5>() = information * mean;
    const Quadric q = own + cholesky.solve(right);
    const double variance = cholesky.solve(Quadric::Unit(0))[0];
    if (cholesky.info() != Eigen::Success || !q.allFinite() || !(q[0] > 0) || !(variance > 0))
      continue;
    set_quadric(q, fitted.half, shared.back());
    // A neighbour's word makes a depth surer, never less sure.
    const double deviation = std::sqrt(std::min(variance, variance_of(node)));
    shared.back().sigma = static_cast<float>(deviation / (q[0] * q[0]));
  }
  for (std::size_t k = 0; k < fitted.nodes.size(); ++k) map.nodes[fitted.nodes[k]] = shared[k];
}

}  // namespace pencilscan
