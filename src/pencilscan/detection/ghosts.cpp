#include "pencilscan/detection/ghosts.h"

#include <algorithm>
#include <span>
#include <utility>

#include "pencilscan/core/median.h"
#include "pencilscan/core/stretches.h"
#include "pencilscan/detection/refine.h"
#include "pencilscan/detection/refine_scales.h"
#include "pencilscan/view/nearest.h"

namespace pencilscan {
namespace {

constexpr float kJudgedWidths = 8;    // to either side of a place
constexpr float kHeightWidths = 3;    // of the mean height
constexpr float kDark = 0.4F;         // of the line's height
constexpr std::size_t kFifth = 5;     // the lower one
constexpr std::size_t kTogether = 4;  // places that are judged as one

/// Means of values along a curve over `half` of them to either side.
std::vector<float> means(std::span<const float> values, std::size_t half) {
  std::vector<float> sums{0};
  for (const float value : values) sums.push_back(sums.back() + value);
  std::vector<float> result;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t low = i - std::min(i, half);
    const std::size_t high = std::min(values.size(), i + half + 1);
    result.push_back((sums[high] - sums[low]) / static_cast<float>(high - low));
  }
  return result;
}

/// The presence along a curve over the line's height around, which follows what the light falls on.
std::vector<float> light_along(const cv::Mat& presence, std::span<const CurvePoint> points,
                               float width) {
  std::vector<float> light;
  std::vector<float> heights;
  for (const CurvePoint& p : points) {
    light.push_back(sample_bilinear(presence, p.position.x(), p.position.y()));
    heights.push_back(p.amplitude);
  }
  light = means(light, static_cast<std::size_t>(nearest(width)));
  heights = means(heights, static_cast<std::size_t>(nearest(kHeightWidths * width)));
  for (std::size_t i = 0; i < light.size(); ++i) light[i] /= heights[i];
  return light;
}

/// Per point, 1 where it is one of a ghost.
std::vector<char> ghostly(const cv::Mat& presence, std::span<const CurvePoint> points) {
  const float width = std::max(1.F, median_width(points));
  const auto reach = static_cast<std::size_t>(nearest(kJudgedWidths * width));
  const std::vector<float> light = light_along(presence, points, width);
  const std::size_t n = points.size();
  const std::size_t window = std::min(n, 2 * reach + 1);
  std::vector<char> is_ghost(n, 0);
  std::vector<std::size_t> dark_before{0};  // of each point
  for (const float value : light) dark_before.push_back(dark_before.back() + (value < kDark));
  for (std::size_t first = 0; first < n; first += kTogether) {
    const std::size_t middle = std::min(first + kTogether / 2, n - 1);
    const std::size_t low = std::min(middle - std::min(middle, reach), n - window);
    if (dark_before[low + window] - dark_before[low] <= window / kFifth) continue;
    for (std::size_t i = first; i < std::min(first + kTogether, n); ++i) is_ghost[i] = 1;
  }
  return is_ghost;
}

}  // namespace

std::vector<Curve> without_ghosts(const cv::Mat& presence, std::vector<Curve> curves,
                                  int min_points) {
  std::vector<Curve> kept;
  for (Curve& curve : curves) {
    if (curve.points.empty()) continue;
    const std::vector<char> is_ghost = ghostly(presence, curve.points);
    if (std::find(is_ghost.begin(), is_ghost.end(), 1) == is_ghost.end()) {
      kept.push_back(std::move(curve));
      continue;
    }
    for_each_stretch(is_ghost, [&](int begin, int end) {
      if (is_ghost[static_cast<std::size_t>(begin)] != 0 || end - begin < min_points) return;
      Curve& part = kept.emplace_back();
      part.family = curve.family;
      part.points.assign(curve.points.begin() + begin, curve.points.begin() + end);
    });
  }
  return kept;
}

}  // namespace pencilscan
