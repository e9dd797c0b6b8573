#include "pencilscan/detection/ridge.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "pencilscan/detection/oriented_filter.h"
#include "pencilscan/view/cell_index.h"
#include "pencilscan/view/nearest.h"

namespace pencilscan {
namespace {

/// Gaussian second derivatives, as one smoothing followed by the exact 3-tap differences.
Hessian gaussian_hessian(const cv::Mat& image, double sigma) {
  const int radius = static_cast<int>(std::ceil(3.5 * sigma));
  cv::Mat g(1, 2 * radius + 1, CV_32F);
  cv::Mat d1(1, 2 * radius + 1, CV_32F);
  cv::Mat d2(1, 2 * radius + 1, CV_32F);
  double sum = 0;
  for (int i = -radius; i <= radius; ++i) sum += std::exp(-0.5 * i * i / (sigma * sigma));
  double d2_mean = 0;
  for (int i = -radius; i <= radius; ++i) {
    const double value = std::exp(-0.5 * i * i / (sigma * sigma)) / sum;
    const double s2 = sigma * sigma;
    g.at<float>(0, i + radius) = static_cast<float>(value);
    d1.at<float>(0, i + radius) =
        static_cast<float>(i / s2 * value);  // correlation, not convolution
    d2.at<float>(0, i + radius) = static_cast<float>((i * i / s2 - 1) / s2 * value);
    d2_mean += (i * i / s2 - 1) / s2 * value;
  }
  d2 -= cv::Scalar(d2_mean / (2 * radius + 1));  // no response to a constant
  Hessian h;
  cv::sepFilter2D(image, h.xx, CV_32F, d2, g);
  cv::sepFilter2D(image, h.yy, CV_32F, g, d2);
  cv::sepFilter2D(image, h.xy, CV_32F, d1, d1);
  return h;
}

/// Response level of pure noise, from the weak responses of the image, which is mostly background
/// or smooth; and the strong response, 99th percentile of what exceeds that.
struct Levels {
  float noise = 0;
  float strong = 0;
};

/// Over `area`: the padding around it holds no noise.
Levels response_levels(const Hessian& h, const cv::Rect& area) {
  std::vector<float> values;
  for (int y = area.y + 1; y < area.br().y; y += 3) {
    for (int x = area.x + 1; x < area.br().x; x += 3) {
      values.push_back(-(h.xx.at<float>(y, x) + h.yy.at<float>(y, x)));
    }
  }
  if (values.empty()) return {};
  std::vector<float> magnitude(values.size());
  std::transform(values.begin(), values.end(), magnitude.begin(),
                 [](float v) { return std::abs(v); });
  // The lower decile of |N(0, s)| is 0.1257 s: background even if lines cover most of the image.
  const auto decile = magnitude.begin() + static_cast<std::ptrdiff_t>(magnitude.size() / 10);
  std::nth_element(magnitude.begin(), decile, magnitude.end());
  Levels levels;
  levels.noise = *decile / 0.1257F / std::numbers::sqrt2_v<float>;
  const float floor = 5 * levels.noise;
  std::erase_if(values, [&](float v) { return v <= floor; });
  if (!values.empty()) {
    const auto top = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 99 / 100);
    std::nth_element(values.begin(), top, values.end());
    levels.strong = *top;
  }
  return levels;
}

/// Offset of the maximum of the parabola through (-1, before), (0, at), (1, after).
float parabola_offset(float before, float at, float after) {
  const float curvature = before - 2 * at + after;
  return curvature < 0 ? 0.5F * (before - after) / curvature : 0.F;
}

/// Adds the ridgels of a tile whose first pixel is (x0, y0).
void add_ridgels(const std::vector<FilterMaximum>& maxima,
                 const std::vector<FilterDirection>& directions, int x0, int y0,
                 std::vector<Ridgel>& ridgels) {
  const auto step = std::numbers::pi_v<float> / static_cast<float>(directions.size());
  for (const FilterMaximum& m : maxima) {
    const FilterDirection& d = directions[static_cast<std::size_t>(m.direction)];
    const float offset = parabola_offset(m.low, m.at, m.high);
    // The maximum must lie in the pixel's own square, or a neighbour reports it too.
    if (std::max(std::abs(offset * d.nx), std::abs(offset * d.ny)) > 0.51F) continue;
    const float turn = parabola_offset(m.before, m.at, m.after) * step;
    const float nx = d.nx - turn * d.ny;
    const float ny = d.ny + turn * d.nx;
    const float norm = std::sqrt(nx * nx + ny * ny);
    ridgels.push_back({static_cast<float>(x0 + m.x) + offset * d.nx,
                       static_cast<float>(y0 + m.y) + offset * d.ny, nx / norm, ny / norm, m.at});
  }
}

std::vector<Ridgel> ridgels_at_scale(const cv::Mat& presence, const RidgeOptions& options) {
  constexpr int kTile = FilterTile::kTile;
  const double sigma = std::sqrt(options.sigma_along_px * options.sigma_along_px -
                                 options.sigma_across_px * options.sigma_across_px);
  const std::vector<FilterDirection> directions = filter_directions(options.orientations, sigma);
  // A replicated border lets every tile read beyond the image without a test.
  const int border = filter_reach(directions) + 1;
  const int beyond = border + kTile + kLanes;
  cv::Mat padded;
  cv::copyMakeBorder(presence, padded, border, beyond, border, beyond, cv::BORDER_REPLICATE);
  const Hessian h = gaussian_hessian(padded, options.sigma_across_px);
  const Levels levels = response_levels(h, {border, border, presence.cols, presence.rows});
  // Smoothing along a line keeps its response and divides that of white noise by about 2.
  const float threshold = std::max(static_cast<float>(options.noise_factor) * 0.5F * levels.noise,
                                   static_cast<float>(options.relative_threshold) * levels.strong);
  std::vector<Ridgel> ridgels;
  if (levels.strong <= 0) return ridgels;
  FilterTile tile(directions);
  std::vector<FilterMaximum> maxima;
  for (int y0 = 0; y0 < presence.rows; y0 += kTile) {
    for (int x0 = 0; x0 < presence.cols; x0 += kTile) {
      const int width = std::min(kTile, presence.cols - x0);
      const int height = std::min(kTile, presence.rows - y0);
      const cv::Rect area(x0 + border, y0 + border, width, height);
      if (-(lowest_value(h.xx, area) + lowest_value(h.yy, area)) < 0.7F * threshold)
        continue;  // nothing bright and thin in here
      tile.compute(h, area.x, area.y);
      tile.find_maxima(threshold, width, height, maxima);
      add_ridgels(maxima, directions, x0, y0, ridgels);
    }
  }
  return ridgels;
}

float value_at(const cv::Mat& image, float x, float y) {
  const int ix = std::clamp(nearest(x), 0, image.cols - 1);
  const int iy = std::clamp(nearest(y), 0, image.rows - 1);
  return image.at<float>(iy, ix);
}

/// Adds the ridgels of wide lines and removes the edges that the finer look took for lines.
std::vector<Ridgel> merged_scales(const cv::Mat& presence, const std::vector<Ridgel>& fine,
                                  const std::vector<Ridgel>& wide) {
  constexpr float kSameLinePx = 1.3F;  // a fine ridgel this near to the middle is the line itself
  constexpr float kReachPx = 5.5F;     // half the width of the widest line
  constexpr float kAlongPx = 2;
  constexpr float kParallelCosine = 0.94F;
  constexpr float kFlatTop = 0.88F;
  constexpr float kWideLinePx = 2.6F;
  constexpr int kCellPx = 4;
  const CellIndex index(presence.size(), kCellPx, fine.size(),
                        [&](std::size_t i) { return std::pair(fine[i].x, fine[i].y); });
  std::vector<char> is_edge(fine.size(), 0);
  std::vector<Ridgel> result;
  std::vector<std::size_t> beside;
  for (const Ridgel& w : wide) {
    bool is_middle = true;
    beside.clear();
    const auto look = [&](float radius, float max_across) {
      index.around(w.x, w.y, radius, [&](int item) {
        const auto i = static_cast<std::size_t>(item);
        const Ridgel& f = fine[i];
        const float across = std::abs((f.x - w.x) * w.nx + (f.y - w.y) * w.ny);
        const float along = std::abs(-(f.x - w.x) * w.ny + (f.y - w.y) * w.nx);
        if (across > max_across || along > kAlongPx) return true;
        if (std::abs(f.nx * w.nx + f.ny * w.ny) < kParallelCosine) return true;
        if (across < kSameLinePx) is_middle = false;
        beside.push_back(i);
        return is_middle;
      });
    };
    look(std::hypot(kSameLinePx, kAlongPx), kSameLinePx);  // mostly, this is a fine line too
    if (!is_middle) continue;
    beside.clear();
    look(kReachPx, kReachPx);
    const float middle = value_at(presence, w.x, w.y);
    for (const std::size_t i : beside) {
      is_middle = is_middle && middle >= kFlatTop * value_at(presence, fine[i].x, fine[i].y);
    }
    if (!is_middle) continue;
    for (const std::size_t i : beside) is_edge[i] = 1;
    result.push_back(w);
    result.back().width_px = kWideLinePx;
  }
  for (std::size_t i = 0; i < fine.size(); ++i) {
    if (is_edge[i] == 0) result.push_back(fine[i]);
  }
  return result;
}

/// Ridgels of the half-size image in full-size pixels: two for each, so that they stay about one
/// pixel apart along the line.
std::vector<Ridgel> enlarged(const std::vector<Ridgel>& half_size) {
  std::vector<Ridgel> result;
  result.reserve(2 * half_size.size());
  for (const Ridgel& r : half_size) {
    for (const float along : {-0.5F, 0.5F}) {
      Ridgel twice = r;
      twice.x = 2 * r.x - along * r.ny;
      twice.y = 2 * r.y + along * r.nx;
      result.push_back(twice);
    }
  }
  return result;
}

}  // namespace

std::vector<Ridgel> find_ridgels(const cv::Mat& presence, const RidgeOptions& options) {
  std::vector<Ridgel> fine = ridgels_at_scale(presence, options);
  if (!options.find_wide) return fine;
  cv::Mat half_size;
  cv::pyrDown(presence, half_size);
  return merged_scales(presence, fine, enlarged(ridgels_at_scale(half_size, options)));
}

}  // namespace pencilscan
