#include "pencilscan/detection/ridge.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "pencilscan/detection/nearest.h"

namespace pencilscan {
namespace {

constexpr int kTile = 32;

/// One direction of the filter bank: normal (nx, ny) and the taps of the smoothing along the line.
struct Direction {
  float nx = 1;
  float ny = 0;
  struct Tap {
    int dx = 0;
    int dy = 0;
    float weight = 0;
  };
  std::vector<Tap> taps;
};

Direction make_direction(int index, const RidgeOptions& options) {
  const double theta = std::numbers::pi * index / options.orientations;
  Direction direction{static_cast<float>(std::cos(theta)), static_cast<float>(std::sin(theta)), {}};
  const double tx = -std::sin(theta);
  const double ty = std::cos(theta);
  const double sigma = std::sqrt(options.sigma_along_px * options.sigma_along_px -
                                 options.sigma_across_px * options.sigma_across_px);
  const bool major_x = std::abs(tx) > std::abs(ty);
  const double slope = major_x ? ty / tx : tx / ty;
  const double step = std::hypot(1, slope);
  const int stride = sigma > 2 ? 2 : 1;  // of a long Gaussian every second tap is enough
  const int reach = stride * static_cast<int>(std::ceil(2.5 * sigma / step / stride));
  double sum = 0;
  for (int j = -reach; j <= reach; j += stride)
    sum += std::exp(-0.5 * std::pow(j * step / sigma, 2));
  for (int j = -reach; j <= reach; j += stride) {
    const double weight = std::exp(-0.5 * std::pow(j * step / sigma, 2)) / sum;
    const double minor = j * slope;
    const int low = static_cast<int>(std::floor(minor));
    const double fraction = minor - low;
    for (int k = 0; k < 2; ++k) {
      const double w = weight * (k == 0 ? 1 - fraction : fraction);
      if (w < 1e-6) continue;
      const int m = low + k;
      direction.taps.push_back({major_x ? j : m, major_x ? m : j, static_cast<float>(w)});
    }
  }
  return direction;
}

struct Hessian {
  cv::Mat xx, xy, yy;
};

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

/// The bank's responses over one tile with a border of one pixel.
class TileResponses {
 public:
  static constexpr int kSize = kTile + 2;

  TileResponses(const Hessian& h, const std::vector<Direction>& directions, int margin)
      : h_(h), directions_(directions), margin_(margin), side_(kSize + 2 * margin) {
    responses_.resize(directions.size() * kSize * kSize);
    steered_.resize(static_cast<std::size_t>(side_ * side_));
  }

  /// h must extend `margin + 1` px beyond the tile on all sides.
  void compute(int x0, int y0) {
    for (std::size_t k = 0; k < directions_.size(); ++k) {
      const Direction& d = directions_[k];
      const float a = -d.nx * d.nx;
      const float b = -2 * d.nx * d.ny;
      const float c = -d.ny * d.ny;
      for (int y = 0; y < side_; ++y) {
        const int row = y0 - 1 - margin_ + y;
        const float* xx = h_.xx.ptr<float>(row) + x0 - 1 - margin_;
        const float* xy = h_.xy.ptr<float>(row) + x0 - 1 - margin_;
        const float* yy = h_.yy.ptr<float>(row) + x0 - 1 - margin_;
        float* out = steered_.data() + y * side_;
        for (int x = 0; x < side_; ++x) out[x] = a * xx[x] + b * xy[x] + c * yy[x];
      }
      float* result = responses_.data() + k * kSize * kSize;
      std::fill(result, result + kSize * kSize, 0.F);
      for (const Direction::Tap& tap : d.taps) {
        for (int y = 0; y < kSize; ++y) {
          const float* in = steered_.data() + (y + margin_ + tap.dy) * side_ + margin_ + tap.dx;
          float* out = result + y * kSize;
          for (int x = 0; x < kSize; ++x) out[x] += tap.weight * in[x];
        }
      }
    }
  }

  [[nodiscard]] const float* direction(std::size_t k) const {
    return responses_.data() + k * kSize * kSize;
  }

 private:
  const Hessian& h_;
  const std::vector<Direction>& directions_;
  int margin_;
  int side_;
  std::vector<float> responses_;
  std::vector<float> steered_;
};

float bilinear(const float* image, int stride, float x, float y) {
  const int ix = static_cast<int>(x);
  const int iy = static_cast<int>(y);
  const float fx = x - static_cast<float>(ix);
  const float fy = y - static_cast<float>(iy);
  const float* p = image + iy * stride + ix;
  return (1 - fy) * ((1 - fx) * p[0] + fx * p[1]) +
         fy * ((1 - fx) * p[stride] + fx * p[stride + 1]);
}

/// Offset of the maximum of the parabola through (-1, before), (0, at), (1, after).
float parabola_offset(float before, float at, float after) {
  const float curvature = before - 2 * at + after;
  return curvature < 0 ? 0.5F * (before - after) / curvature : 0.F;
}

void collect_tile(const TileResponses& tile, const std::vector<Direction>& directions,
                  float threshold, int x0, int y0, int width, int height,
                  std::vector<Ridgel>& ridgels) {
  constexpr int kSize = TileResponses::kSize;
  const std::size_t n = directions.size();
  const auto step = std::numbers::pi_v<float> / static_cast<float>(n);
  for (int y = 1; y <= height; ++y) {
    for (int x = 1; x <= width; ++x) {
      const int at = y * kSize + x;
      for (std::size_t k = 0; k < n; ++k) {
        const float r = tile.direction(k)[at];
        if (r < threshold) continue;
        const float before = tile.direction((k + n - 1) % n)[at];
        const float after = tile.direction((k + 1) % n)[at];
        if (r < before || r <= after) continue;
        const Direction& d = directions[k];
        const auto fx = static_cast<float>(x);
        const auto fy = static_cast<float>(y);
        const float* image = tile.direction(k);
        const float low = bilinear(image, kSize, fx - d.nx, fy - d.ny);
        const float high = bilinear(image, kSize, fx + d.nx, fy + d.ny);
        if (r < low || r <= high) continue;
        const float offset = parabola_offset(low, r, high);
        // The maximum must lie in the pixel's own square, or a neighbour reports it too.
        if (std::max(std::abs(offset * d.nx), std::abs(offset * d.ny)) > 0.51F) continue;
        const float turn = parabola_offset(before, r, after) * step;
        const float nx = d.nx - turn * d.ny;
        const float ny = d.ny + turn * d.nx;
        const float norm = std::hypot(nx, ny);
        ridgels.push_back({static_cast<float>(x0 + x - 1) + offset * d.nx,
                           static_cast<float>(y0 + y - 1) + offset * d.ny, nx / norm, ny / norm,
                           r});
      }
    }
  }
}

std::vector<Ridgel> ridgels_at_scale(const cv::Mat& presence, const RidgeOptions& options) {
  std::vector<Direction> directions;
  int margin = 0;
  for (int k = 0; k < options.orientations; ++k) {
    directions.push_back(make_direction(k, options));
    for (const auto& tap : directions.back().taps) {
      margin = std::max({margin, std::abs(tap.dx), std::abs(tap.dy)});
    }
  }
  // A replicated border lets every tile read beyond the image without a test.
  const int border = margin + 1;
  cv::Mat padded;
  cv::copyMakeBorder(presence, padded, border, border + kTile, border, border + kTile,
                     cv::BORDER_REPLICATE);
  const Hessian h = gaussian_hessian(padded, options.sigma_across_px);
  const Levels levels = response_levels(h, {border, border, presence.cols, presence.rows});
  // Smoothing along a line keeps its response and divides that of white noise by about 2.
  const float threshold = std::max(static_cast<float>(options.noise_factor) * 0.5F * levels.noise,
                                   static_cast<float>(options.relative_threshold) * levels.strong);
  std::vector<Ridgel> ridgels;
  if (levels.strong <= 0) return ridgels;
  TileResponses tile(h, directions, margin);
  for (int y0 = 0; y0 < presence.rows; y0 += kTile) {
    for (int x0 = 0; x0 < presence.cols; x0 += kTile) {
      const int width = std::min(kTile, presence.cols - x0);
      const int height = std::min(kTile, presence.rows - y0);
      const cv::Rect area(x0 + border, y0 + border, width, height);
      double low_xx = 0;
      double low_yy = 0;
      cv::minMaxLoc(h.xx(area), &low_xx);
      cv::minMaxLoc(h.yy(area), &low_yy);
      if (-(low_xx + low_yy) < 0.7 * threshold) continue;  // nothing bright and thin in here
      tile.compute(x0 + border, y0 + border);
      collect_tile(tile, directions, threshold, x0, y0, width, height, ridgels);
    }
  }
  return ridgels;
}

/// Ridgels in buckets of their pixel rows, to find those around a place.
class RidgelRows {
 public:
  RidgelRows(const std::vector<Ridgel>& ridgels, int rows) : ridgels_(ridgels) {
    rows_.resize(static_cast<std::size_t>(rows));
    for (std::size_t i = 0; i < ridgels.size(); ++i) row_of(ridgels[i].y).push_back(i);
    for (auto& row : rows_) {
      std::sort(row.begin(), row.end(), [&](std::size_t a, std::size_t b) {
        return ridgels[a].x != ridgels[b].x ? ridgels[a].x < ridgels[b].x : a < b;
      });
    }
  }

  template <class Visit>
  void around(float x, float y, float radius, Visit visit) const {
    const int low = std::max(0, static_cast<int>(std::floor(y - radius)));
    const int high =
        std::min(static_cast<int>(rows_.size()) - 1, static_cast<int>(std::ceil(y + radius)));
    for (int r = low; r <= high; ++r) {
      const auto& row = rows_[static_cast<std::size_t>(r)];
      auto it = std::lower_bound(row.begin(), row.end(), x - radius,
                                 [&](std::size_t i, float v) { return ridgels_[i].x < v; });
      for (; it != row.end() && ridgels_[*it].x <= x + radius; ++it) visit(*it);
    }
  }

 private:
  std::vector<std::size_t>& row_of(float y) {
    const int row = std::clamp(nearest(y), 0, static_cast<int>(rows_.size()) - 1);
    return rows_[static_cast<std::size_t>(row)];
  }

  const std::vector<Ridgel>& ridgels_;
  std::vector<std::vector<std::size_t>> rows_;
};

float value_at(const cv::Mat& image, float x, float y) {
  const int ix = std::clamp(nearest(x), 0, image.cols - 1);
  const int iy = std::clamp(nearest(y), 0, image.rows - 1);
  return image.at<float>(iy, ix);
}

/// Adds the ridgels of wide lines and removes the edges that the finer look took for lines.
std::vector<Ridgel> merged_scales(const cv::Mat& presence, const std::vector<Ridgel>& fine,
                                  const std::vector<Ridgel>& wide) {
  constexpr float kSameLinePx = 1.3F;  // a fine ridgel this near to the middle is the line itself
  constexpr float kReachPx = 5;        // half the width of the widest line
  constexpr float kParallelCosine = 0.94F;
  constexpr float kFlatTop = 0.88F;
  constexpr float kWideLinePx = 2.6F;
  const RidgelRows rows(fine, presence.rows);
  std::vector<char> is_edge(fine.size(), 0);
  std::vector<Ridgel> result;
  std::vector<std::size_t> beside;
  for (const Ridgel& w : wide) {
    bool is_middle = true;
    beside.clear();
    rows.around(w.x, w.y, kReachPx, [&](std::size_t i) {
      const Ridgel& f = fine[i];
      if (std::abs(f.nx * w.nx + f.ny * w.ny) < kParallelCosine) return;
      const float across = std::abs((f.x - w.x) * w.nx + (f.y - w.y) * w.ny);
      const float along = std::abs(-(f.x - w.x) * w.ny + (f.y - w.y) * w.nx);
      if (along > 2) return;
      if (across < kSameLinePx) is_middle = false;
      beside.push_back(i);
    });
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
