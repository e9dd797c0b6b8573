#include "pencilscan/grid/gamma_trace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "pencilscan/core/median.h"
#include "pencilscan/view/sample_color.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;

constexpr double kMostGamma = 4;  // and its inverse: beyond are no cameras
// Steps, in deviations of a profile: at the most, where a line has faded; at the least, where a
// third of its light is left.
constexpr float kMostStep = 2.5F;
constexpr float kLeastStep = 1.5F;
constexpr float kFull = 0.95F;     // values near the top of the range may be cut off
constexpr float kNoises = 3;       // of one value: what lines stand out by
constexpr float kOwnLight = 0.5F;  // of a line's most: below, colours leak from channel to channel
// So many say how far they scatter, to a fifth.
constexpr std::size_t kLeastCrossings = 30;

/// What is seen at a crossing, on one line beside it, on the other, and off both.
template <typename Value>
struct Sum {
  Value both, first, second, none;

  /// What light that adds has none of. It has no share in the two below.
  [[nodiscard]] Value excess() const { return both + none - first - second; }
  /// What one line adds to the light, and what the other does.
  [[nodiscard]] Value of_first() const { return (first - none + both - second) / 2; }
  [[nodiscard]] Value of_second() const { return (second - none + both - first) / 2; }
};
using ColorSum = Sum<Eigen::Array3f>;

double light_of(double value, double gamma) { return std::pow(std::max(value, 1e-6), gamma); }

/// The gamma with which light adds, at most kMostGamma, at least its inverse.
double gamma_of(const Sum<double>& s) {
  double low = 1 / kMostGamma;
  double high = kMostGamma;
  for (int round = 0; round < 20; ++round) {
    const double middle = std::sqrt(low * high);
    const auto light = [&](double value) { return light_of(value, middle); };
    const Sum<double> of_light{light(s.both), light(s.first), light(s.second), light(s.none)};
    (of_light.excess() < 0 ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

/// How fast the excess grows with log(gamma) at a gamma of 1, of light that adds.
double slope_of(const Sum<double>& s) {
  const auto slope = [](double value) { return value * std::log(std::max(value, 1e-6)); };
  const double a = s.of_first();
  const double b = s.of_second();
  const double none = std::max(0.0, (s.both + s.first + s.second + s.none) / 4 - (a + b) / 2);
  return slope(none + a + b) + slope(none) - slope(none + a) - slope(none + b);
}

/// The curve's point at a fractional index, and its direction.
std::pair<Vector2f, Vector2f> along(const Curve& curve, float at) {
  const float last = static_cast<float>(curve.points.size() - 1);
  const auto& p = curve.points[static_cast<std::size_t>(std::lround(std::clamp(at, 0.F, last)))];
  return {p.position, p.tangent()};
}

float width_at(const Curve& curve, float at) {
  return curve.points[static_cast<std::size_t>(std::lround(at))].width_px;
}

/// Distance along a curve to its next crossing, on the nearer side, px; by curve and position.
class NextCrossings {
 public:
  explicit NextCrossings(const GridGraph& graph) : at_(graph.curves.size()) {
    for (const Crossing& x : graph.crossings) {
      at_[static_cast<std::size_t>(x.curve_a)].push_back(x.at_a);
      at_[static_cast<std::size_t>(x.curve_b)].push_back(x.at_b);
    }
    for (auto& of_curve : at_) std::sort(of_curve.begin(), of_curve.end());
  }
  [[nodiscard]] float room(int curve, float at, std::size_t points) const {
    const auto& all = at_[static_cast<std::size_t>(curve)];
    const auto here = std::lower_bound(all.begin(), all.end(), at);
    float room = std::min(at, static_cast<float>(points - 1) - at);
    if (here != all.begin()) room = std::min(room, at - *(here - 1));
    if (here != all.end() && here + 1 != all.end()) room = std::min(room, *(here + 1) - at);
    return room;
  }

 private:
  std::vector<std::vector<float>> at_;
};

/// Mean over places; NaN when one of them is outside.
template <std::size_t kCount>
Eigen::Array3f mean_at(const cv::Mat& values, const std::array<Vector2f, kCount>& places) {
  Eigen::Array3f sum = Eigen::Array3f::Zero();
  for (const Vector2f& place : places)
    sum += sample_color(values, static_cast<double>(place.x()), static_cast<double>(place.y()));
  return sum / static_cast<float>(kCount);
}

/// What a crossing shows; nothing where other crossings are too near.
std::optional<ColorSum> sum_at(const GridGraph& graph, const NextCrossings& next, const Crossing& x,
                               const cv::Mat& values) {
  const Curve& a = graph.curves[static_cast<std::size_t>(x.curve_a)];
  const Curve& b = graph.curves[static_cast<std::size_t>(x.curve_b)];
  const Vector2f ta = along(a, x.at_a).second;
  const Vector2f tb = along(b, x.at_b).second;
  const float sine = std::abs(ta.x() * tb.y() - ta.y() * tb.x());
  const float width_a = width_at(a, x.at_a) / sine;  // along b
  const float width_b = width_at(b, x.at_b) / sine;  // along a
  // Half-way to the next line it is darkest.
  const float step_a =
      std::min(kMostStep * width_b, next.room(x.curve_a, x.at_a, a.points.size()) / 2);
  const float step_b =
      std::min(kMostStep * width_a, next.room(x.curve_b, x.at_b, b.points.size()) / 2);
  if (step_a < kLeastStep * width_b || step_b < kLeastStep * width_a) return std::nullopt;
  const Vector2f o = x.position;
  const Vector2f a1 = along(a, x.at_a + step_a).first - o, a2 = along(a, x.at_a - step_a).first - o;
  const Vector2f b1 = along(b, x.at_b + step_b).first - o, b2 = along(b, x.at_b - step_b).first - o;
  const ColorSum sum{
      mean_at(values, std::array<Vector2f, 1>{o}),
      mean_at(values, std::array<Vector2f, 2>{o + a1, o + a2}),
      mean_at(values, std::array<Vector2f, 2>{o + b1, o + b2}),
      mean_at(values, std::array<Vector2f, 4>{o + a1 + b1, o + a1 + b2, o + a2 + b1, o + a2 + b2})};
  if (sum.excess().hasNaN()) return std::nullopt;
  return sum;
}

/// Noise of one value, by how sums scatter.
Eigen::Array3f noise_of(const std::vector<ColorSum>& sums) {
  Eigen::Array3f noise;
  for (Eigen::Index k = 0; k < 3; ++k) {
    std::vector<float> excess;
    for (const ColorSum& sum : sums) excess.push_back(sum.excess()[k]);
    const float middle = upper_median(excess);
    for (float& value : excess) value = std::abs(value - middle);
    noise[k] = static_cast<float>(kDeviationPerMedian) * upper_median(std::move(excess)) / 2;
  }
  return noise;
}

/// The sum in the channel that tells most: one that both lines have as their own light, green if it
/// is one, since mosaics and JPEG keep it best.
std::optional<Sum<double>> telling_channel(const ColorSum& sum, const Eigen::Array3f& noise) {
  const Eigen::Array3f first = sum.of_first();
  const Eigen::Array3f second = sum.of_second();
  const float least_first = kOwnLight * first.maxCoeff();
  const float least_second = kOwnLight * second.maxCoeff();
  std::optional<Eigen::Index> best;
  float most = kNoises;
  for (const Eigen::Index k : {1, 0, 2}) {
    if (best == 1) break;
    const float ratio = std::min(first[k], second[k]) / noise[k];
    if (first[k] < least_first || second[k] < least_second || !(ratio > most)) continue;
    if (std::max({sum.both[k], sum.first[k], sum.second[k]}) > kFull) continue;
    best = k;
    most = ratio;
  }
  if (!best) return std::nullopt;
  const auto in = [k = *best](const Eigen::Array3f& rgb) { return static_cast<double>(rgb[k]); };
  return Sum<double>{in(sum.both), in(sum.first), in(sum.second), in(sum.none)};
}

/// The value below which half of the weight lies. Value, weight.
double weighted_median(std::vector<std::pair<double, double>> values) {
  std::sort(values.begin(), values.end());
  double half = 0;
  for (const auto& [value, weight] : values) half += weight / 2;
  double below = 0;
  for (const auto& [value, weight] : values) {
    below += weight;
    if (below >= half) return value;
  }
  return 0;
}

}  // namespace

std::vector<CrossingGamma> gammas_at_crossings(const GridGraph& graph, const cv::Mat& values) {
  const NextCrossings next(graph);
  std::vector<ColorSum> sums;
  for (const Crossing& x : graph.crossings)
    if (const auto sum = sum_at(graph, next, x, values)) sums.push_back(*sum);
  const Eigen::Array3f noise = noise_of(sums);
  std::vector<CrossingGamma> said;
  for (const ColorSum& sum : sums) {
    const auto in_channel = telling_channel(sum, noise);
    if (!in_channel) continue;
    const double weight = slope_of(*in_channel);
    if (weight > 0) said.push_back({std::log(gamma_of(*in_channel)), weight});
  }
  return said;
}

std::optional<GammaTrace> gamma_of_crossings(std::span<const CrossingGamma> said) {
  if (said.size() < kLeastCrossings) return std::nullopt;
  std::vector<std::pair<double, double>> values;
  double sum = 0;
  double squares = 0;
  for (const CrossingGamma& one : said) {
    values.emplace_back(one.log_gamma, one.weight);
    sum += one.weight;
    squares += one.weight * one.weight;
  }
  const double middle = weighted_median(values);
  for (auto& [value, weight] : values) value = std::abs(value - middle);
  GammaTrace trace;
  trace.gamma = std::exp(middle);
  trace.crossings = said.size();
  // A median of normal values scatters sqrt(pi / 2) times as much as their mean.
  trace.deviation = kDeviationPerMedian * weighted_median(std::move(values)) *
                    std::sqrt(std::numbers::pi / 2 * squares) / sum;
  return trace;
}

}  // namespace pencilscan
