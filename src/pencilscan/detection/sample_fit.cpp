#include "pencilscan/detection/sample_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "pencilscan/detection/fitted_points.h"
#include "pencilscan/detection/profile_fit.h"
#include "pencilscan/view/nearest.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;

/// What lies within half a px of -7..7 px across one point.
struct Bins {
  std::array<float, kProfileSize> count{};
  std::array<float, kProfileSize> value{};   ///< sum
  std::array<float, kProfileSize> square{};  ///< sum
  std::array<float, kProfileSize> offset{};  ///< sum, px
};

/// Samples of a mosaic in the cell of each px across a point, half a px to either side along it: of
/// a lattice whose samples lie sqrt(2) px apart or more, each cell holds one at most.
Bins bins_across(const cv::Mat& residual, const cv::Mat& samples, const CurvePoint& p) {
  Bins bins;
  const Vector2f tangent = p.tangent();
  for (int b = 0; b < kProfileSize; ++b) {
    const Vector2f middle = p.position + static_cast<float>(b - kMaxHalf) * p.normal;
    const int x0 = static_cast<int>(std::floor(middle.x()));
    const int y0 = static_cast<int>(std::floor(middle.y()));
    for (int y = std::max(0, y0); y <= std::min(y0 + 1, residual.rows - 1); ++y) {
      for (int x = std::max(0, x0); x <= std::min(x0 + 1, residual.cols - 1); ++x) {
        if (samples.at<std::uint8_t>(y, x) == 0) continue;
        const Vector2f way = Vector2f(static_cast<float>(x), static_cast<float>(y)) - p.position;
        const float across = way.dot(p.normal);
        const float along = way.dot(tangent);
        if (std::abs(along) > 0.5F || std::abs(across - static_cast<float>(b - kMaxHalf)) > 0.5F)
          continue;
        const auto i = static_cast<std::size_t>(b);
        const float value = residual.at<float>(y, x);
        bins.count[i] += 1;
        bins.value[i] += value;
        bins.square[i] += value * value;
        bins.offset[i] += across;
      }
    }
  }
  return bins;
}

/// Height of the line profile at d px from its middle.
float profile_at(float width, float d) {
  float value = 0;
  add_line_profile(1, width, d, 1, 1, &value, 1);
  return value;
}

}  // namespace

void fit_to_samples(const cv::Mat& residual, const cv::Mat& samples, int half_arc, Curve& curve) {
  std::vector<CurvePoint>& points = curve.points;
  const int n = static_cast<int>(points.size());
  std::vector<Bins> bins;
  for (const CurvePoint& p : points) bins.push_back(bins_across(residual, samples, p));
  std::vector<ProfileFit> fits(points.size());
  for (int first = 0; first < n; first += kLanes) {
    SampledProfiles batch{};
    for (int k = 0; k < kLanes; ++k) {
      const int i = std::min(first + k, n - 1);
      const CurvePoint& p = points[static_cast<std::size_t>(i)];
      const int r = std::min({half_arc, i, n - 1 - i});
      const int half = std::clamp(nearest(2.4F * p.width_px) + 1, 4, kMaxHalf);
      Bins sum;
      for (int j = i - r; j <= i + r; ++j) {
        const Bins& b = bins[static_cast<std::size_t>(j)];
        for (std::size_t o = 0; o < kProfileSize; ++o) {
          sum.count[o] += b.count[o];
          sum.value[o] += b.value[o];
          sum.square[o] += b.square[o];
          sum.offset[o] += b.offset[o];
        }
      }
      // A full image has as many samples in each.
      const float unit = 1 / static_cast<float>(2 * half_arc + 1);
      for (std::size_t o = 0; o < kProfileSize; ++o) {
        const float count = sum.count[o];
        const bool counts = std::abs(static_cast<int>(o) - kMaxHalf) <= half && count > 0;
        if (!counts) continue;
        const float mean = sum.value[o] / count;
        const float offset = sum.offset[o] / count;
        batch.value[o][k] = mean + p.amplitude * profile_at(p.width_px, offset);
        batch.offset[o][k] = offset;
        batch.weight[o][k] = unit * count;
        batch.scatter[k] += unit * (sum.square[o] - count * mean * mean);
        batch.samples[k] += count;
      }
      batch.amplitude[k] = p.amplitude;
      batch.width[k] = p.width_px;
    }
    ProfileFits of;
    fit_sampled_profiles(batch, of);
    for (int k = 0; k < std::min(kLanes, n - first); ++k)
      fits[static_cast<std::size_t>(first + k)] = fit_of(of, k);
  }
  take_fits(fits, points);
}

}  // namespace pencilscan
