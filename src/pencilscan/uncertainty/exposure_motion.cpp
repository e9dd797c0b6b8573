#include "pencilscan/uncertainty/exposure_motion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>

#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Of sixteen frames of resting objects (docs/sequences.md) some reach a gain of 60, some eight
// deviations of the jackknife, some 1 % of the blur; none reaches all of them.
constexpr double kLeastGain = 30;        // of the squared deviations
constexpr double kLeastDeviations = 8;   // by the jackknife, of the best of all directions
constexpr double kBaselineError = 0.01;  // share of the blur's variance
constexpr std::size_t kLeastLines = 500;
constexpr std::size_t kLeastOfPair = 30;
constexpr std::size_t kLeastPairs = 6;
constexpr double kLeastDeviationPx2 = 0.02;  // relief and unmixing: no window is surer than this
constexpr double kHuber = 1.5;               // deviations
// Of the way: beside what profiles know of their noise, errors of bunny, cat and knot that go 2 to
// 4 footprints grow by so much of it; with it their sigma holds as often as at rest.
constexpr double kOfWay = 0.02;
constexpr int kTwist = 6;
constexpr int kProducts = kTwist * (kTwist + 1) / 2;

using Twist = Eigen::Matrix<double, kTwist, 1>;
using Products = Eigen::Matrix<double, kProducts, 1>;

/// Products of the components of a twist, upper triangle by rows; with their slopes.
Products products(const Twist& m) {
  Products q;
  int k = 0;
  for (int a = 0; a < kTwist; ++a) {
    for (int b = a; b < kTwist; ++b) q[k++] = m[a] * m[b];
  }
  return q;
}
Eigen::Matrix<double, kProducts, kTwist> product_slopes(const Twist& m) {
  Eigen::Matrix<double, kProducts, kTwist> J = Eigen::Matrix<double, kProducts, kTwist>::Zero();
  int k = 0;
  for (int a = 0; a < kTwist; ++a) {
    for (int b = a; b < kTwist; ++b, ++k) {
      J(k, a) += m[b];
      J(k, b) += m[a];
    }
  }
  return J;
}

/// Cameras or projectors that took part, in order.
std::map<int, Index> places_of(std::span<const LineBlur> lines, int LineBlur::*device) {
  std::map<int, Index> places;
  for (const LineBlur& line : lines) places.emplace(line.*device, 0);
  Index next = 0;
  for (auto& [index, place] : places) place = next++;
  return places;
}

double median_of(std::span<const LineBlur> lines, double LineBlur::*value) {
  std::vector<double> values;
  for (const LineBlur& line : lines) values.push_back(line.*value);
  return upper_median(std::move(values));
}

/// The equations' columns: baseline, then the products of the twist.
class Columns {
 public:
  explicit Columns(std::span<const LineBlur> lines)
      : lines_(lines),
        cameras_(places_of(lines, &LineBlur::camera)),
        projectors_(places_of(lines, &LineBlur::projector)),
        spacing_(median_of(lines, &LineBlur::px_per_line)),
        camera_depth_(median_of(lines, &LineBlur::camera_depth)),
        projector_depth_(median_of(lines, &LineBlur::projector_depth)) {
    for (const LineBlur& line : lines) pivot_ += line.point / static_cast<double>(lines.size());
    double square = 0;
    for (const LineBlur& line : lines) square += (line.point - pivot_).squaredNorm();
    reach_ = std::max(std::sqrt(square / static_cast<double>(lines.size())), 1e-9);
    baseline_ = static_cast<Index>(2 * cameras_.size() + 2 * projectors_.size()) + 5;
  }

  [[nodiscard]] Index baseline() const { return baseline_; }
  [[nodiscard]] Index count() const { return baseline_ + kProducts; }
  [[nodiscard]] const Vec3& pivot() const { return pivot_; }
  /// Root mean square distance of the places from the pivot: the unit of turns.
  [[nodiscard]] double reach() const { return reach_; }

  void row(std::size_t i, VectorXd& values) const {
    const LineBlur& line = lines_[i];
    values.setZero(count());
    const double spacing = line.px_per_line / spacing_;
    const double spacing2 = spacing * spacing;
    const Index camera = 2 * cameras_.at(line.camera);
    values[camera] = 1;
    values[camera + 1] = (line.camera_depth - camera_depth_) / reach_;
    const auto projector =
        2 * (static_cast<Index>(cameras_.size()) + projectors_.at(line.projector));
    values[projector] = spacing2;
    values[projector + 1] = spacing2 * (line.projector_depth - projector_depth_) / reach_;
    const double g2 = line.px_per_length * line.px_per_length;
    values.segment<5>(baseline_ - 5) << 1 / spacing2, 1 / (spacing2 * spacing2), g2,
        line.camera_cosine, line.projector_cosine;
    Twist g;
    g << line.normal, (line.point - pivot_).cross(line.normal) / reach_;
    Products q = products(line.px_per_length * g);
    int k = 0;
    for (int a = 0; a < kTwist; ++a) {
      for (int b = a; b < kTwist; ++b, ++k) q[k] *= a == b ? 1. / 12 : 2. / 12;
    }
    values.tail<kProducts>() = q;
  }

 private:
  std::span<const LineBlur> lines_;
  std::map<int, Index> cameras_;
  std::map<int, Index> projectors_;
  double spacing_, camera_depth_, projector_depth_;
  Vec3 pivot_ = Vec3::Zero();
  double reach_ = 1;
  Index baseline_ = 0;
};

/// J' J, by half of the work that a product takes.
MatrixXd products_of(const MatrixXd& J) {
  MatrixXd result = MatrixXd::Zero(J.cols(), J.cols());
  result.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose());
  result.triangularView<Eigen::StrictlyUpper>() = result.transpose();
  return result;
}

/// Normal equations S q = h.
struct Equations {
  MatrixXd S;
  VectorXd h;

  explicit Equations(Index n) : S(MatrixXd::Zero(n, n)), h(VectorXd::Zero(n)) {}
  Equations& operator+=(const Equations& other) {
    S += other.S;
    h += other.h;
    return *this;
  }
  Equations& operator-=(const Equations& other) {
    S -= other.S;
    h -= other.h;
    return *this;
  }
  /// Of the last unknowns alone, the first `n` eliminated.
  [[nodiscard]] Equations without_first(Index n) const {
    const Index rest = h.size() - n;
    MatrixXd A = S.topLeftCorner(n, n);
    A.diagonal().array() += 1e-9 * A.trace() / static_cast<double>(n);
    MatrixXd right(n, rest + 1);
    right << S.topRightCorner(n, rest), h.head(n);
    const MatrixXd solved = A.ldlt().solve(right);
    Equations result(rest);
    result.S =
        S.bottomRightCorner(rest, rest) - S.bottomLeftCorner(rest, n) * solved.leftCols(rest);
    result.h = h.tail(rest) - S.bottomLeftCorner(rest, n) * solved.col(rest);
    return result;
  }
};

/// How much less the squared deviations are with a motion than without.
double gain(const Equations& of_products, const Twist& m) {
  const Products q = products(m);
  return 2 * of_products.h.dot(q) - q.dot(of_products.S * q);
}

/// The best motion near `start`, by damped Gauss-Newton; turns stay as they are where `may_turn` is
/// not set.
Twist best_motion(const Equations& of_products, Twist m, bool may_turn) {
  constexpr int kRounds = 60;
  const Index n = may_turn ? kTwist : 3;
  double damping = 1e-3;
  double now = gain(of_products, m);
  for (int round = 0; round < kRounds; ++round) {
    const auto J = product_slopes(m);
    const Twist slope = J.transpose() * (of_products.h - of_products.S * products(m));
    Twist step = Twist::Zero();
    MatrixXd A = (J.transpose() * of_products.S * J).topLeftCorner(n, n);
    A.diagonal() *= 1 + damping;
    A.diagonal().array() += 1e-9 * (1 + A.trace());
    step.head(n) = A.ldlt().solve(slope.head(n));
    const Twist next = m + step;
    const double then = gain(of_products, next);
    if (then > now) {
      const bool rests = then - now < 1e-9 * (1 + then);
      m = next;
      now = then;
      damping = std::max(1e-6, damping / 4);
      if (rests) break;
    } else {
      damping *= 8;
      if (damping > 1e9) break;
    }
  }
  return m;
}

/// Axes, and diagonals of faces and of the cube.
std::vector<Vec3> directions() {
  std::vector<Vec3> result;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        const int first = x != 0 ? x : y != 0 ? y : z;
        if (first > 0) result.push_back(Vec3(x, y, z).normalized());
      }
    }
  }
  return result;
}

Twist shift_along(const Vec3& direction) {
  Twist m = Twist::Zero();
  m.head<3>() = direction;
  return m;
}

/// Squared length of a shift into a direction that fits best, and its deviation.
std::pair<double, double> square_along(const Equations& of_products, const Vec3& direction) {
  const Products q = products(shift_along(direction));
  const double information = std::max(q.dot(of_products.S * q), 1e-12);
  return {q.dot(of_products.h) / information, 1 / std::sqrt(information)};
}

Twist best_shift(const Equations& of_products) {
  Twist best = Twist::Zero();
  for (const Vec3& direction : directions()) {
    const double square = square_along(of_products, direction).first;
    if (square <= 0) continue;
    const Twist m = best_motion(of_products, std::sqrt(square) * shift_along(direction), false);
    if (gain(of_products, m) > gain(of_products, best)) best = m;
  }
  return best;
}

Twist best_with_turn(const Equations& of_products, const Twist& shift, double unit) {
  Twist best = shift;
  for (const double share : {1.0, 0.3}) {
    for (const Vec3& axis : directions()) {
      for (const double sign : {1.0, -1.0}) {
        Twist start = share * shift;
        start.tail<3>() = sign * unit * axis;
        const Twist m = best_motion(of_products, start, true);
        if (gain(of_products, m) > gain(of_products, best)) best = m;
      }
    }
  }
  return best;
}

class Fit {
 public:
  Fit(std::span<const LineBlur> lines, double overlap) : lines_(lines), columns_(lines) {
    rows_.resize(static_cast<Index>(lines.size()), columns_.count());
    root_.resize(static_cast<Index>(lines.size()));
    values_.resize(static_cast<Index>(lines.size()));
    VectorXd row;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const auto at = static_cast<Index>(i);
      columns_.row(i, row);
      root_[at] = 1 / std::hypot(lines[i].deviation_px2, kLeastDeviationPx2);
      rows_.row(at) = root_[at] * row.transpose();
      values_[at] = root_[at] * lines[i].variance_px2;
    }
    weigh();
    weight_ /= overlap;
  }

  [[nodiscard]] const Columns& columns() const { return columns_; }

  /// Of the products alone: all, and without each pair.
  [[nodiscard]] std::vector<Equations> equations() const {
    std::map<std::pair<int, int>, std::vector<Index>> members;
    for (std::size_t i = 0; i < lines_.size(); ++i)
      members[{lines_[i].camera, lines_[i].projector}].push_back(static_cast<Index>(i));
    std::vector<Equations> pairs;
    Equations all(columns_.count());
    for (const auto& [pair, rows] : members) {
      if (rows.size() < kLeastOfPair) continue;
      pairs.push_back(sum(rows));
      all += pairs.back();
    }
    std::vector<Equations> result = {all.without_first(columns_.baseline())};
    for (const Equations& pair : pairs) {
      Equations rest = all;
      rest -= pair;
      result.push_back(rest.without_first(columns_.baseline()));
    }
    return result;
  }

  /// Variances that the baseline with this motion has.
  [[nodiscard]] std::vector<double> expected(const Twist& m) const {
    const Index n = columns_.baseline();
    const VectorXd of_motion = rows_.rightCols<kProducts>() * products(m);
    const MatrixXd A = rows_.leftCols(n);
    MatrixXd normal = products_of(weight_.cwiseSqrt().asDiagonal() * A);
    normal.diagonal().array() += 1e-9 * normal.trace() / static_cast<double>(n);
    const VectorXd baseline =
        normal.ldlt().solve(A.transpose() * (weight_.cwiseProduct(values_ - of_motion)));
    const VectorXd fitted = A * baseline + of_motion;
    std::vector<double> result(lines_.size());
    for (std::size_t i = 0; i < lines_.size(); ++i)
      result[i] = fitted[static_cast<Index>(i)] / root_[static_cast<Index>(i)];
    return result;
  }

 private:
  /// Huber's weights over the noise, from fits of everything that is linear.
  void weigh() {
    constexpr int kRounds = 3;
    weight_ = VectorXd::Ones(values_.size());
    for (int round = 0; round < kRounds; ++round) {
      const MatrixXd weighted = weight_.cwiseSqrt().asDiagonal() * rows_;
      MatrixXd A = products_of(weighted);
      A.diagonal() *= 1 + 1e-9;
      A.diagonal().array() += 1e-12 * A.trace();
      const VectorXd x =
          A.ldlt().solve(weighted.transpose() * weight_.cwiseSqrt().cwiseProduct(values_));
      const VectorXd rest = values_ - rows_ * x;
      std::vector<double> sizes(rest.data(), rest.data() + rest.size());
      for (double& size : sizes) size = std::abs(size);
      const double noise = kDeviationPerMedian * upper_median(std::move(sizes));
      if (!(noise > 0)) return;
      for (Index i = 0; i < rest.size(); ++i)
        weight_[i] = 1 / std::max(1.0, std::abs(rest[i]) / (kHuber * noise));
      noise_ = noise;
    }
    weight_ /= noise_ * noise_;
  }

  [[nodiscard]] Equations sum(const std::vector<Index>& members) const {
    MatrixXd rows(static_cast<Index>(members.size()), rows_.cols());
    VectorXd values(rows.rows());
    VectorXd weight(rows.rows());
    for (std::size_t i = 0; i < members.size(); ++i) {
      const auto at = static_cast<Index>(i);
      rows.row(at) = rows_.row(members[i]);
      values[at] = values_[members[i]];
      weight[at] = weight_[members[i]];
    }
    Equations result(rows.cols());
    rows = weight.cwiseSqrt().asDiagonal() * rows;
    result.S = products_of(rows);
    result.h = rows.transpose() * weight.cwiseSqrt().cwiseProduct(values);
    return result;
  }

  std::span<const LineBlur> lines_;
  Columns columns_;
  MatrixXd rows_;    ///< over the deviations
  VectorXd root_;    ///< 1 / deviation
  VectorXd values_;  ///< variances over their deviations
  VectorXd weight_;
  double noise_ = 1;
};

/// Root mean square way of the places; the cross terms of shift and turn vanish about the pivot.
double way_of(std::span<const LineBlur> lines, const Columns& columns, const Twist& m) {
  double square = 0;
  for (const LineBlur& line : lines)
    square += (m.head<3>() + m.tail<3>().cross((line.point - columns.pivot()) / columns.reach()))
                  .squaredNorm();
  return std::sqrt(square / static_cast<double>(lines.size()));
}

/// Deviation of the length of `m` along itself, or of its part from `first` on, by leaving out one
/// pair after the other.
double jackknife(const std::vector<Equations>& equations, const Twist& m, bool may_turn,
                 Index first, Index count) {
  const auto along = m.segment(first, count).normalized();
  std::vector<double> lengths;
  for (std::size_t k = 1; k < equations.size(); ++k) {
    Twist other = best_motion(equations[k], m, may_turn);
    if (other.dot(m) < 0) other = -other;
    lengths.push_back(along.dot(other.segment(first, count)));
  }
  double mean = 0;
  for (const double length : lengths) mean += length / static_cast<double>(lengths.size());
  double square = 0;
  for (const double length : lengths) square += (length - mean) * (length - mean);
  const auto n = static_cast<double>(lengths.size());
  return std::sqrt((n - 1) / n * square);
}

}  // namespace

ExposureMotion exposure_motion(std::span<const LineBlur> lines, double overlap,
                               std::vector<double>* expected) {
  ExposureMotion motion;
  if (lines.size() < kLeastLines) return motion;
  const Fit fit(lines, overlap);
  const std::vector<Equations> equations = fit.equations();
  if (equations.size() < kLeastPairs + 1) return motion;
  motion.is_judged = true;
  const Equations& all = equations.front();
  for (const Vec3& direction : directions()) {
    const auto [square, deviation] = square_along(all, direction);
    motion.at_most = std::max(motion.at_most, std::sqrt(std::max(0.0, square + 2 * deviation)));
  }
  // What an error of the baseline, a share of the blur, looks like.
  const double g = median_of(lines, &LineBlur::px_per_length);
  const double unsure =
      std::sqrt(12 * kBaselineError * std::max(0.0, median_of(lines, &LineBlur::variance_px2))) /
      std::max(std::abs(g), 1e-9);
  motion.at_most = std::hypot(motion.at_most, unsure);
  const Columns& columns = fit.columns();
  Twist m = best_shift(all);
  bool may_turn = false;
  const Twist turned = best_with_turn(all, m, unsure);
  if (gain(all, turned) - gain(all, m) > kLeastGain &&
      turned.tail<3>().norm() > kLeastDeviations * jackknife(equations, turned, true, 3, 3)) {
    m = turned;
    may_turn = true;
  }
  motion.way = way_of(lines, columns, m);
  const double deviation = jackknife(equations, m, may_turn, 0, kTwist);
  motion.way_deviation = m.isZero() ? 0 : deviation * motion.way / m.norm();
  motion.is_seen = gain(all, m) > kLeastGain && motion.way > unsure &&
                   motion.way > kLeastDeviations * motion.way_deviation;
  if (expected != nullptr) *expected = fit.expected(m);
  if (!motion.is_seen) return motion;
  motion.at_most = std::max(motion.at_most, motion.way + 2 * motion.way_deviation);
  motion.pivot = columns.pivot();
  motion.shift = m.head<3>();
  motion.turn = m.tail<3>() / columns.reach();
  return motion;
}

double motion_sigma(const Vec3& way, const Vec3& normal, const Vec3* ray) {
  constexpr double kLeastCosine = 0.2;  // as surface_check.cpp
  if (normal.isZero()) return kOfWay * way.norm();
  const double across = kOfWay * std::abs(way.dot(normal));
  return ray == nullptr ? across : across / std::max(std::abs(normal.dot(*ray)), kLeastCosine);
}

}  // namespace pencilscan
