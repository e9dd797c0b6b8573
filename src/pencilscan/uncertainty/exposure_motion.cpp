#include "pencilscan/uncertainty/exposure_motion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/uncertainty/blur_equations.h"

namespace pencilscan {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Of resting objects (docs/sequences.md) some frames reach gains of hundreds, some eight deviations
// of a jackknife, some the errors of the baseline; of 84 before few devices two reach all of them,
// both without any blur of a lens. Few pairs of camera and projector do not know their deviation:
// chance makes as much of it once in a hundred thousand frames.
constexpr double kLeastGain = 50;        // of the squared deviations
constexpr double kLeastDeviations = 8;   // by the jackknives, of the best of all directions
constexpr double kChance = 1e-5;         // of Student's t, as many degrees as pairs but one
constexpr double kBaselineError = 0.01;  // share of the blur's variance
constexpr double kPixelError = 0.05;     // share of a pixel's own: its shape is no Gaussian's
constexpr std::size_t kLeastLines = 500;
constexpr std::size_t kLeastPairs = 6;
// Of the way: beside what profiles know of their noise, errors of bunny, cat and knot that go 2 to
// 4 footprints grow by so much of it; with it their sigma holds as often as at rest.
constexpr double kOfWay = 0.02;
/// Slopes of products().
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

/// How much less the squared deviations are with a motion than without.
double gain(const BlurEquations& of_products, const Twist& m) {
  const Products q = products(m);
  return 2 * of_products.h.dot(q) - q.dot(of_products.S * q);
}

/// The best motion near `start`, by damped Gauss-Newton; turns stay as they are where `may_turn` is
/// not set.
Twist best_motion(const BlurEquations& of_products, Twist m, bool may_turn) {
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
std::pair<double, double> square_along(const BlurEquations& of_products, const Vec3& direction) {
  const Products q = products(shift_along(direction));
  const double information = std::max(q.dot(of_products.S * q), 1e-12);
  return {q.dot(of_products.h) / information, 1 / std::sqrt(information)};
}

Twist best_shift(const BlurEquations& of_products) {
  Twist best = Twist::Zero();
  for (const Vec3& direction : directions()) {
    const double square = square_along(of_products, direction).first;
    if (square <= 0) continue;
    const Twist m = best_motion(of_products, std::sqrt(square) * shift_along(direction), false);
    if (gain(of_products, m) > gain(of_products, best)) best = m;
  }
  return best;
}

Twist best_with_turn(const BlurEquations& of_products, const Twist& shift, double unit) {
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

/// Root mean square way of the places; the cross terms of shift and turn vanish about the pivot.
double way_of(std::span<const LineBlur> lines, const BlurColumns& columns, const Twist& m) {
  double square = 0;
  for (const LineBlur& line : lines)
    square += (m.head<3>() + m.tail<3>().cross((line.point - columns.pivot()) / columns.reach()))
                  .squaredNorm();
  return std::sqrt(square / static_cast<double>(lines.size()));
}

/// Deviation of the length of `m` along itself, or of its part from `first` on, by leaving out one
/// part of the lines after the other; 0 where there are none to leave out.
double jackknife(const std::vector<BlurEquations>& without, const Twist& m, bool may_turn,
                 Index first, Index count) {
  if (without.empty()) return 0;
  const auto along = m.segment(first, count).normalized();
  std::vector<double> lengths;
  for (const BlurEquations& rest : without) {
    Twist other = best_motion(rest, m, may_turn);
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

/// How often chance makes |t| larger (M. Abramowitz and I. Stegun, Handbook of Mathematical
/// Functions, 1964, 26.7.3 and 26.7.4).
double student_tail(double t, int degrees) {
  const double angle = std::atan(t / std::sqrt(static_cast<double>(degrees)));
  const double cosine2 = std::cos(angle) * std::cos(angle);
  const bool is_odd = degrees % 2 == 1;
  double term = is_odd ? std::cos(angle) : 1;
  double sum = 0;
  for (int k = is_odd ? 1 : 0; k + 1 < degrees; k += 2) {
    sum += term;
    term *= cosine2 * (k + 1) / (k + 2);
  }
  const double inside = std::sin(angle) * sum;
  return 1 - (is_odd ? 2 / M_PI * (angle + inside) : inside);
}

/// Deviations of a length, by pairs, cameras and projectors.
using Deviations = std::array<double, 3>;

Deviations deviations_of(const MotionEquations& equations, const Twist& m, bool may_turn,
                         Index first, Index count) {
  Deviations result;
  for (std::size_t kind = 0; kind < result.size(); ++kind)
    result[kind] = jackknife(equations.without[kind], m, may_turn, first, count);
  return result;
}

/// Whether a length is far beyond what any pair, camera or projector makes of it.
bool is_beyond_doubt(double length, const Deviations& deviations, std::size_t pairs) {
  return student_tail(length / deviations[0], static_cast<int>(pairs) - 1) <= kChance &&
         length > kLeastDeviations * *std::max_element(deviations.begin(), deviations.end());
}

}  // namespace

ExposureMotion exposure_motion(std::span<const LineBlur> lines, double unknown_px2,
                               std::vector<double>* expected) {
  ExposureMotion motion;
  if (lines.size() < kLeastLines) return motion;
  const BlurFit fit(lines);
  const MotionEquations equations = fit.equations();
  if (equations.pairs < kLeastPairs) return motion;
  motion.is_judged = true;
  const BlurEquations& all = equations.all;
  for (const Vec3& direction : directions()) {
    const auto [square, deviation] = square_along(all, direction);
    motion.at_most = std::max(motion.at_most, std::sqrt(std::max(0.0, square + 2 * deviation)));
  }
  // What an error of the baseline, a share of the blur, looks like.
  const double g = median_of(lines, &LineBlur::px_per_length);
  const double blur_px2 = std::max(0.0, median_of(lines, &LineBlur::variance_px2));
  const double unsure = std::sqrt(12 * (kBaselineError * blur_px2 + unknown_px2) + kPixelError) /
                        std::max(std::abs(g), 1e-9);
  motion.at_most = std::hypot(motion.at_most, unsure);
  const BlurColumns& columns = fit.columns();
  Twist m = best_shift(all);
  bool may_turn = false;
  const Twist turned = best_with_turn(all, m, unsure);
  if (gain(all, turned) - gain(all, m) > kLeastGain &&
      is_beyond_doubt(turned.tail<3>().norm(), deviations_of(equations, turned, true, 3, 3),
                      equations.pairs)) {
    m = turned;
    may_turn = true;
  }
  motion.way = way_of(lines, columns, m);
  const Deviations deviations = deviations_of(equations, m, may_turn, 0, kTwist);
  motion.way_deviation = m.isZero() ? 0 : deviations[0] * motion.way / m.norm();
  motion.is_seen = gain(all, m) > kLeastGain && motion.way > unsure &&
                   is_beyond_doubt(m.norm(), deviations, equations.pairs);
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
