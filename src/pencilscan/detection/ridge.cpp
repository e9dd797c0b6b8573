#include "pencilscan/detection/ridge.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "pencilscan/detection/oriented_filter.h"
#include "pencilscan/detection/ridge_scales.h"

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

/// Standard deviation of the response to the rounding of 8 bits: 1 / 255 / sqrt(12) a pixel, times
/// the root of the sum of the filter's squared weights, .182 at sigma 1.3.
constexpr float kRoundingResponse = 0.182F * 0.00113F;

/// The strongest response near each place. What looks like a weak line beside strong ones is light
/// of these, whose colours, blur and reflections reach so far; where all is dim, it is a line on a
/// dark surface.
class StrongNearby {
 public:
  /// `area`: of the image within the padding.
  StrongNearby(const Hessian& h, const cv::Rect& area) {
    cv::Mat peaks((area.height + kCell - 1) / kCell, (area.width + kCell - 1) / kCell, CV_32F,
                  cv::Scalar(std::numeric_limits<float>::lowest()));
    for (int y = 0; y < area.height; ++y) {
      const float* xx = h.xx.ptr<float>(area.y + y) + area.x;
      const float* yy = h.yy.ptr<float>(area.y + y) + area.x;
      float* of_row = peaks.ptr<float>(y / kCell);
      for (int x = 0; x < area.width; ++x)
        of_row[x / kCell] = std::max(of_row[x / kCell], -(xx[x] + yy[x]));
    }
    cv::dilate(peaks, strongest_, cv::Mat::ones(2 * kAround + 1, 2 * kAround + 1, CV_8U));
  }

  [[nodiscard]] float at(int x, int y) const { return strongest_.at<float>(y / kCell, x / kCell); }
  /// Of all places in a rectangle of the image.
  [[nodiscard]] float least_in(const cv::Rect& area) const {
    const cv::Point first(area.x / kCell, area.y / kCell);
    const cv::Point last((area.br().x - 1) / kCell, (area.br().y - 1) / kCell);
    return lowest_value(strongest_, {first, last + cv::Point(1, 1)});
  }

 private:
  static constexpr int kCell = 8;    ///< px
  static constexpr int kAround = 2;  ///< cells beside the own one: 16 px, the filter's reach
  cv::Mat strongest_;
};

/// The image at one size, ready to be looked at.
struct Look {
  cv::Mat image;
  Hessian hessian;  ///< of the image with a border
  Levels levels;
};

/// The filter for every size.
class RidgeFilter {
 public:
  explicit RidgeFilter(const RidgeOptions& options)
      : options_(options),
        directions_(filter_directions(
            options.orientations, std::sqrt(options.sigma_along_px * options.sigma_along_px -
                                            options.sigma_across_px * options.sigma_across_px))),
        border_(filter_reach(directions_) + 1) {}

  [[nodiscard]] Look look_at(const cv::Mat& image) const {
    // A replicated border lets every tile read beyond the image without a test.
    const int beyond = border_ + FilterTile::kTile + kLanes;
    cv::Mat padded;
    cv::copyMakeBorder(image, padded, border_, beyond, border_, beyond, cv::BORDER_REPLICATE);
    Look look{image, gaussian_hessian(padded, options_.sigma_across_px), {}};
    look.levels = response_levels(look.hessian, {border_, border_, image.cols, image.rows});
    return look;
  }

  /// `nearby`: the strongest response there.
  [[nodiscard]] float threshold_of(const Levels& levels, float nearby) const {
    // Smoothing along a line keeps its response and divides that of white noise by about 2.
    const auto over_noise = static_cast<float>(options_.noise_factor) * 0.5F;
    const auto share = static_cast<float>(options_.relative_threshold);
    const float usual = share * levels.strong;
    // What is dim all around may be the steps of 8 bits, which no noise may hide.
    const float least = std::min(usual, over_noise * kRoundingResponse);
    return std::max({over_noise * levels.noise, std::min(usual, share * nearby), least});
  }

  /// In pixels of the look's image.
  [[nodiscard]] std::vector<Ridgel> ridgels(const Look& look) const {
    constexpr int kTile = FilterTile::kTile;
    std::vector<Ridgel> ridgels;
    if (look.levels.strong <= 0) return ridgels;
    const StrongNearby nearby(look.hessian, {border_, border_, look.image.cols, look.image.rows});
    FilterTile tile(directions_);
    std::vector<FilterMaximum> maxima;
    const Hessian& h = look.hessian;
    for (int y0 = 0; y0 < look.image.rows; y0 += kTile) {
      for (int x0 = 0; x0 < look.image.cols; x0 += kTile) {
        const int width = std::min(kTile, look.image.cols - x0);
        const int height = std::min(kTile, look.image.rows - y0);
        const cv::Rect area(x0 + border_, y0 + border_, width, height);
        const float threshold = threshold_of(look.levels, nearby.least_in({x0, y0, width, height}));
        if (-(lowest_value(h.xx, area) + lowest_value(h.yy, area)) < 0.7F * threshold)
          continue;  // nothing bright and thin in here
        tile.compute(h, area.x, area.y);
        tile.find_maxima(threshold, width, height, maxima);
        std::erase_if(maxima, [&](const FilterMaximum& m) {
          return m.at < threshold_of(look.levels, nearby.at(x0 + m.x, y0 + m.y));
        });
        add_ridgels(maxima, directions_, x0, y0, ridgels);
      }
    }
    return ridgels;
  }

 private:
  RidgeOptions options_;
  std::vector<FilterDirection> directions_;
  int border_;
};

/// Of the filter's scale: the widest line that an image shows best (ridge_scales.h).
constexpr double kWidest = 3.3;

/// The size that shows the usual line best, also where the surface turns away by 53 degrees.
std::size_t usual_size(const RidgeOptions& options, std::size_t sizes) {
  constexpr double kTurned = 0.6;
  std::size_t size = 0;
  for (double widest = kWidest * options.sigma_across_px;
       size + 1 < sizes && kTurned * options.usual_px > widest; widest *= 2)
    ++size;
  return size;
}

}  // namespace

std::vector<Ridgel> find_ridgels(const cv::Mat& presence, const RidgeOptions& options) {
  constexpr int kSmallestPx = 16;  // image: smaller than the filter, it shows no line
  const RidgeFilter filter(options);
  std::vector<SizedRidgels> sizes;
  float strong = 0;
  cv::Mat image = presence;
  for (double widest = kWidest * options.sigma_across_px;; widest *= 2) {
    const Look look = filter.look_at(image);
    sizes.push_back({image, filter.ridgels(look)});
    strong = std::max(strong, look.levels.strong);
    if (widest >= options.widest_px) break;
    cv::Mat half_size;
    cv::pyrDown(image, half_size);
    if (std::min(half_size.rows, half_size.cols) < kSmallestPx) break;
    image = half_size;
  }
  const float weakest = static_cast<float>(options.relative_threshold) * strong;
  return choose_sizes(sizes, weakest, usual_size(options, sizes.size()));
}

int sizes_of(const std::vector<Ridgel>& ridgels) {
  float smallest = 1;
  for (const Ridgel& r : ridgels) smallest = std::max(smallest, r.scale);
  return 1 + std::ilogb(smallest);
}

}  // namespace pencilscan
