#include "pencilscan/grid/gamma_trace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "pencilscan/core/median.h"
#include "pencilscan/view/sample_color.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;

constexpr double kMostGamma = 4;  // and its inverse: beyond are no cameras
constexpr float kApart = 2.5F;    // deviations of a profile: there its line has faded
constexpr float kFull = 0.95F;    // values near the top of the range may be cut off
constexpr std::size_t kLeastCrossings = 50;

/// What is seen at a crossing, on one line beside it, on the other, and off both.
struct Sum {
  double both, first, second, none;
};

/// The gamma with which light adds; nothing when that is none of a camera's.
std::optional<double> gamma_of(const Sum& s) {
  const auto excess = [&](double gamma) {
    const auto light = [&](double v) { return std::pow(std::max(v, 1e-6), gamma); };
    return light(s.both) + light(s.none) - light(s.first) - light(s.second);
  };
  double low = 1 / kMostGamma;
  double high = kMostGamma;
  if (!(excess(low) < 0 && excess(high) > 0)) return std::nullopt;
  for (int round = 0; round < 20; ++round) {
    const double middle = std::sqrt(low * high);
    (excess(middle) < 0 ? low : high) = middle;
  }
  return std::sqrt(low * high);
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

/// The channel in which both lines are brightest.
std::optional<Sum> sum_at(const GridGraph& graph, const NextCrossings& next, const Crossing& x,
                          const cv::Mat& values) {
  const Curve& a = graph.curves[static_cast<std::size_t>(x.curve_a)];
  const Curve& b = graph.curves[static_cast<std::size_t>(x.curve_b)];
  const Vector2f ta = along(a, x.at_a).second;
  const Vector2f tb = along(b, x.at_b).second;
  const float sine = std::abs(ta.x() * tb.y() - ta.y() * tb.x());
  const float from_b = kApart * width_at(b, x.at_b) / sine;  // along a, out of b's light
  const float from_a = kApart * width_at(a, x.at_a) / sine;
  // The lines beside these two must be as far from those places.
  if (next.room(x.curve_a, x.at_a, a.points.size()) < 2 * from_b ||
      next.room(x.curve_b, x.at_b, b.points.size()) < 2 * from_a)
    return std::nullopt;
  const Vector2f o = x.position;
  const Vector2f a1 = along(a, x.at_a + from_b).first - o, a2 = along(a, x.at_a - from_b).first - o;
  const Vector2f b1 = along(b, x.at_b + from_a).first - o, b2 = along(b, x.at_b - from_a).first - o;
  const auto both = mean_at(values, std::array<Vector2f, 1>{o});
  const auto first = mean_at(values, std::array<Vector2f, 2>{o + a1, o + a2});
  const auto second = mean_at(values, std::array<Vector2f, 2>{o + b1, o + b2});
  const auto none =
      mean_at(values, std::array<Vector2f, 4>{o + a1 + b1, o + a1 + b2, o + a2 + b1, o + a2 + b2});
  if ((both + first + second + none).hasNaN()) return std::nullopt;
  Eigen::Index k = 0;
  const float least = first.min(second).maxCoeff(&k);
  // A line counts where it is at least as bright above the dark as the dark itself.
  if (least < 2 * none[k] || both[k] > kFull) return std::nullopt;
  const auto in = [k](const Eigen::Array3f& rgb) { return static_cast<double>(rgb[k]); };
  return Sum{in(both), in(first), in(second), in(none)};
}

}  // namespace

std::vector<double> log_gammas_at_crossings(const GridGraph& graph, const cv::Mat& values) {
  const NextCrossings next(graph);
  std::vector<double> logs;
  for (const Crossing& x : graph.crossings) {
    const auto sum = sum_at(graph, next, x, values);
    const auto gamma = sum ? gamma_of(*sum) : std::nullopt;
    if (gamma) logs.push_back(std::log(*gamma));
  }
  return logs;
}

std::optional<GammaTrace> gamma_of_crossings(const std::vector<double>& logs) {
  if (logs.size() < kLeastCrossings) return std::nullopt;
  const double middle = upper_median(logs);
  std::vector<double> off;
  for (const double value : logs) off.push_back(std::abs(value - middle));
  GammaTrace trace;
  trace.gamma = std::exp(middle);
  trace.crossings = logs.size();
  // A median of normal values scatters sqrt(pi / 2) times as much as their mean.
  trace.deviation = kDeviationPerMedian * upper_median(std::move(off)) *
                    std::sqrt(std::numbers::pi / 2 / static_cast<double>(trace.crossings));
  return trace;
}

}  // namespace pencilscan
