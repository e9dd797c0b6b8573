#include "pencilscan/gray/gray_crossings.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"

namespace pencilscan {
namespace {

using Gradient = cv::Vec2f;  ///< per camera pixel

/// Edge of one bit between two neighbouring pixels.
struct BitEdge {
  float value = 0;  ///< panel coordinate
  int bit = -1;     ///< < 0: none
};

/// Where the panel coordinate is m + 1/2 between two pixels with codes a and b.
BitEdge edge_between(const std::vector<cv::Mat>& difference, cv::Point p, cv::Point q,
                     std::int32_t a, std::int32_t b, double steepest) {
  BitEdge best;
  if (a == b || std::abs(a - b) > steepest) return best;
  // The coarsest bit that changes has the widest stripes and so the steepest edge.
  for (std::int32_t m = std::min(a, b); m < std::max(a, b); ++m) {
    const int bit = std::countr_zero(static_cast<std::uint32_t>(m) + 1);
    if (bit <= best.bit || static_cast<std::size_t>(bit) >= difference.size()) continue;
    const float at_p = difference[static_cast<std::size_t>(bit)].at<float>(p);
    const float at_q = difference[static_cast<std::size_t>(bit)].at<float>(q);
    if ((at_p > 0) == (at_q > 0)) continue;
    best = {static_cast<float>(m) + 0.5F, bit};
  }
  return best;
}

Gradient gradient(const cv::Mat& image, cv::Point p) {
  const int left = std::max(p.x - 1, 0);
  const int right = std::min(p.x + 1, image.cols - 1);
  const int up = std::max(p.y - 1, 0);
  const int down = std::min(p.y + 1, image.rows - 1);
  return {(image.at<float>(p.y, right) - image.at<float>(p.y, left)) /
              static_cast<float>(std::max(right - left, 1)),
          (image.at<float>(down, p.x) - image.at<float>(up, p.x)) /
              static_cast<float>(std::max(down - up, 1))};
}

/// x with erf(x) = y, |y| < 1, by Newton's method.
double inverse_erf(double y) {
  double x = 0;
  for (int i = 0; i < 8; ++i)
    x -= (std::erf(x) - y) * 0.5 * std::sqrt(std::numbers::pi) * std::exp(x * x);
  return x;
}

/// Squared deviation of the blur of an edge, px^2, by the values of two pixels beside it; < 0 where
/// they do not tell. `contrast`: white - black.
double edge_blur(const cv::Mat& difference, const cv::Mat& contrast, cv::Point p, cv::Point q) {
  constexpr double kLeastAcross = 0.9;  // the edge runs across the step from p to q
  constexpr double kTail = 0.9;         // beyond, noise says more than the edge
  const double a = static_cast<double>(difference.at<float>(p) / contrast.at<float>(p));
  const double b = static_cast<double>(difference.at<float>(q) / contrast.at<float>(q));
  if (!(std::abs(a) < kTail && std::abs(b) < kTail)) return -1;
  const Gradient slope = gradient(difference, p) + gradient(difference, q);
  const float along = slope[q.x != p.x ? 0 : 1];
  const double across = static_cast<double>(std::abs(along)) / std::max(cv::norm(slope), 1e-9);
  if (across < kLeastAcross) return -1;
  const double steps = std::abs(inverse_erf(a) - inverse_erf(b));
  return steps > 0 ? across * across / (2 * steps * steps) : -1;
}

/// Edges of one view with what moves them.
class CrossingFinder {
 public:
  CrossingFinder(const GrayStack& stack, const GrayDecodeOptions& options, const DecodedView& view)
      : stack_(stack), options_(options), view_(view), contrast_(stack.white - stack.black) {
    constexpr double kSmooth = 1;  // px: noise of the gradient, well below the shapes of surfaces
    cv::GaussianBlur(contrast_, smooth_, {7, 7}, kSmooth);
    blur_ = camera_blur();
  }

  [[nodiscard]] cv::Vec2f find(std::size_t axis, cv::Point p, cv::Point q) const {
    const BitEdge edge = edge_of(axis, p, q);
    if (edge.bit < 0) return {-1, 0};
    const cv::Mat& difference = stack_.difference[axis][static_cast<std::size_t>(edge.bit)];
    return {place_of_edge(difference, p, q), edge.value};
  }

 private:
  [[nodiscard]] BitEdge edge_of(std::size_t axis, cv::Point p, cv::Point q) const {
    if (!view_.valid(p.x, p.y) || !neighbors_agree(view_, p, q, options_.steepest_code)) return {};
    return edge_between(stack_.difference[axis], p, q, view_.code[axis](p), view_.code[axis](q),
                        options_.steepest_code);
  }

  /// Squared deviation of the camera's blur, px^2.
  [[nodiscard]] double camera_blur() const {
    constexpr int kWideBit = 2;         // stripes of eight panel px and more
    constexpr double kSharpest = 0.25;  // share of the edges
    constexpr double kUsual = 0.4;      // px^2, where no edge tells
    constexpr std::size_t kLeastEdges = 100;
    std::vector<double> blurs;
    for (int v = 1; v + 2 < contrast_.rows; v += 3) {
      for (int u = 1; u + 2 < contrast_.cols; ++u) {
        const BitEdge edge = edge_of(0, {u, v}, {u + 1, v});
        if (edge.bit < kWideBit) continue;
        const double blur = edge_blur(stack_.difference[0][static_cast<std::size_t>(edge.bit)],
                                      contrast_, {u, v}, {u + 1, v});
        if (blur >= 0) blurs.push_back(blur);
      }
    }
    if (blurs.size() < kLeastEdges) return kUsual;
    return std::min(lower_quantile(std::move(blurs), kSharpest), 4.0);
  }

  /// Where the edge between p and q lies, in [0, 1]: where it shows, moved towards the light.
  [[nodiscard]] float place_of_edge(const cv::Mat& difference, cv::Point p, cv::Point q) const {
    constexpr float kSteepest = 0.2F;  // per px: beyond, the surface ends or is another one
    constexpr float kMost = 0.15F;     // px
    const float at_p = difference.at<float>(p);
    const float at_q = difference.at<float>(q);
    const float light_p = smooth_.at<float>(p);
    const float light_q = smooth_.at<float>(q);
    const Gradient growth =
        (gradient(smooth_, p) + gradient(smooth_, q)) * (1 / (light_p + light_q));
    if (!(light_p > 0 && light_q > 0) || cv::norm(growth) > static_cast<double>(kSteepest))
      return at_p / (at_p - at_q);
    // Of equal light on both sides the difference is straight between them.
    const float shown = at_p / (at_p - at_q * (light_p / light_q));
    const Gradient slope = gradient(difference, p) + gradient(difference, q);
    const float along = slope[q.x != p.x ? 0 : 1];
    const float shift = static_cast<float>(blur_) * growth.dot(slope) / along;
    const float moved = std::isfinite(shift) ? std::clamp(shift, -kMost, kMost) : 0.F;
    return std::clamp(shown + moved, 0.F, 1.F);
  }

  const GrayStack& stack_;
  const GrayDecodeOptions& options_;
  const DecodedView& view_;
  cv::Mat contrast_;
  cv::Mat smooth_;
  double blur_ = 0;
};

}  // namespace

void find_crossings(const GrayStack& stack, const GrayDecodeOptions& options, DecodedView& view) {
  for (auto& axis : view.crossing)
    for (auto& crossing : axis) crossing = cv::Mat_<cv::Vec2f>(view.state.size(), cv::Vec2f(-1, 0));
  const CrossingFinder finder(stack, options, view);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    for (std::size_t direction = 0; direction < 2; ++direction) {
      auto& crossing = view.crossing[axis][direction];
      const cv::Point step = direction == 0 ? cv::Point(1, 0) : cv::Point(0, 1);
      parallel_for(static_cast<std::size_t>(view.state.rows - step.y), [&](std::size_t row) {
        const int v = static_cast<int>(row);
        for (int u = 0; u + step.x < view.state.cols; ++u)
          crossing(v, u) = finder.find(axis, {u, v}, cv::Point(u, v) + step);
      });
    }
  }
}

}  // namespace pencilscan
