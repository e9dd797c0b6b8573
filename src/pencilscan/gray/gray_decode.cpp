#include "pencilscan/gray/gray_decode.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "pencilscan/core/check.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/gray/gray_crossings.h"
#include "pencilscan/pattern/gray_code.h"

namespace pencilscan {
namespace {

/// Of 8-bit images, whose noise may hide below the rounding.
constexpr double kRoundingNoise = 0.29 / 255;
constexpr float kFullScale = 0.996F;

/// Variance of a pixel: offset + slope * value (read and shot noise).
struct NoiseModel {
  double offset = 0;
  double slope = 0;
  [[nodiscard]] double variance(double value) const {
    return offset + slope * std::max(value, 0.0);
  }
};

struct LevelNoise {
  double value = 0;
  double deviation = 0;
};

/// Standard deviation from the second differences along both axes, which vanish on planes of grey
/// (Immerkaer, "Fast noise variance estimation", 1996). The lower quartile instead of the mean:
/// texture raises the rest.
LevelNoise level_noise(const cv::Mat& image, const cv::Mat_<std::uint8_t>& mask) {
  std::vector<float> residuals;
  std::vector<float> values;
  for (int v = 1; v + 1 < image.rows; v += 2) {
    const float* a = image.ptr<float>(v - 1);
    const float* b = image.ptr<float>(v);
    const float* c = image.ptr<float>(v + 1);
    for (int u = 1; u + 1 < image.cols; u += 2) {
      if (mask(v, u) == 0 || b[u] > kFullScale) continue;
      residuals.push_back(std::abs(a[u - 1] - 2 * a[u] + a[u + 1] - 2 * b[u - 1] + 4 * b[u] -
                                   2 * b[u + 1] + c[u - 1] - 2 * c[u] + c[u + 1]) /
                          6);
      values.push_back(b[u]);
    }
  }
  return {lower_quantile(values, 0.5),
          lower_quantile(residuals, 0.25) / kLowerQuartilePerDeviation};
}

NoiseModel noise_model(const GrayStack& stack) {
  cv::Mat contrast;
  cv::absdiff(stack.white, stack.black, contrast);
  std::vector<float> all;
  for (int v = 0; v < contrast.rows; v += 4)
    for (int u = 0; u < contrast.cols; u += 4) all.push_back(contrast.at<float>(v, u));
  const double bright = lower_quantile(all, 0.98);
  cv::Mat_<std::uint8_t> lit;
  cv::compare(contrast, 0.25 * bright, lit, cv::CMP_GT);
  const cv::Mat_<std::uint8_t> everywhere(contrast.size(), 255);
  const LevelNoise low = level_noise(stack.black, everywhere);
  const LevelNoise high = level_noise(stack.white, lit);
  const double floor = kRoundingNoise * kRoundingNoise;
  const double low_variance = std::max(low.deviation * low.deviation, floor);
  const double high_variance = std::max(high.deviation * high.deviation, low_variance);
  NoiseModel noise;
  if (high.value > low.value + 0.02)
    noise.slope = (high_variance - low_variance) / (high.value - low.value);
  noise.offset = std::max(low_variance - noise.slope * low.value, floor);
  return noise;
}

/// Bits of one axis at one pixel.
struct AxisBits {
  std::uint32_t gray = 0;
  int uncertain_coarse = 0;  ///< uncertain bits with a certain finer one
  int uncertain_fine = 0;    ///< uncertain bits at the fine end
};

AxisBits read_bits(const std::vector<cv::Mat>& difference, int u, int v, double least) {
  AxisBits bits;
  for (std::size_t k = difference.size(); k-- > 0;) {
    const double d = difference[k].at<float>(v, u);
    if (d > 0) bits.gray |= 1U << k;
    if (std::abs(d) < least) {
      ++bits.uncertain_fine;
    } else {
      bits.uncertain_coarse += bits.uncertain_fine;
      bits.uncertain_fine = 0;
    }
  }
  return bits;
}

class PixelDecoder {
 public:
  PixelDecoder(const GrayStack& stack, const NoiseModel& noise, const GrayDecodeOptions& options)
      : stack_(stack), noise_(noise), options_(options) {}

  PixelState decode(int u, int v, std::array<std::int32_t, 2>& code) const {
    const double white = stack_.white.at<float>(v, u);
    const double black = stack_.black.at<float>(v, u);
    const double contrast = white - black;
    const double deviation = std::sqrt(noise_.variance(white) + noise_.variance(black));
    if (black >= kFullScale) return PixelState::kSaturated;
    if (contrast < options_.lit_deviations * deviation) return PixelState::kUnlit;
    // Of 2 pattern - white - black the variance is 4 + 1 + 1 times a pixel's, of a pair 2 times.
    const double bit_deviation = (stack_.inverses ? 1 : std::sqrt(3.0)) * deviation;
    const double least =
        std::max(options_.bit_deviations * bit_deviation, options_.bit_contrast * contrast);
    // At low contrast a weaker bit must do; the neighbours tell when it errs.
    const double wanted = std::min(least, 0.5 * contrast);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const AxisBits bits = read_bits(stack_.difference[axis], u, v, wanted);
      if (bits.uncertain_fine > options_.max_blurred_bits) return PixelState::kBlurred;
      if (bits.uncertain_coarse > 1) return PixelState::kAmbiguous;
      code[axis] = static_cast<std::int32_t>(index_from_gray(bits.gray));
    }
    if (code[0] >= stack_.panel_width || code[1] >= stack_.panel_height)
      return PixelState::kOffPanel;
    return PixelState::kValid;
  }

 private:
  const GrayStack& stack_;
  NoiseModel noise_;
  GrayDecodeOptions options_;
};

void drop(DecodedView& view, const cv::Mat_<std::uint8_t>& wrong) {
  for (int v = 0; v < wrong.rows; ++v) {
    for (int u = 0; u < wrong.cols; ++u) {
      if (wrong(v, u) == 0) continue;
      view.state(v, u) = static_cast<std::uint8_t>(PixelState::kInconsistent);
      view.code[0](v, u) = view.code[1](v, u) = -1;
    }
  }
}

void drop_unsupported(DecodedView& view, const GrayDecodeOptions& options) {
  cv::Mat_<std::uint8_t> wrong(view.state.size(), 0);
  parallel_for(static_cast<std::size_t>(view.state.rows), [&](std::size_t row) {
    const int v = static_cast<int>(row);
    for (int u = 0; u < view.state.cols; ++u) {
      if (!view.valid(u, v)) continue;
      int support = -1;  // itself
      for (int y = std::max(v - 2, 0); y <= std::min(v + 2, view.state.rows - 1); ++y)
        for (int x = std::max(u - 2, 0); x <= std::min(u + 2, view.state.cols - 1); ++x)
          support += neighbors_agree(view, {u, v}, {x, y}, options.steepest_code) ? 1 : 0;
      if (support < options.least_support) wrong(v, u) = 1;
    }
  });
  drop(view, wrong);
}

/// Pieces connected by agreeing neighbours that are smaller than the least.
void drop_small_pieces(DecodedView& view, const GrayDecodeOptions& options) {
  cv::Mat_<std::uint8_t> seen(view.state.size(), 0);
  cv::Mat_<std::uint8_t> wrong(view.state.size(), 0);
  std::vector<cv::Point> piece;
  for (int v = 0; v < view.state.rows; ++v) {
    for (int u = 0; u < view.state.cols; ++u) {
      if (!view.valid(u, v) || seen(v, u) != 0) continue;
      piece.assign(1, {u, v});
      seen(v, u) = 1;
      for (std::size_t i = 0; i < piece.size(); ++i) {
        const cv::Point at = piece[i];
        for (const cv::Point step : {cv::Point(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
          const cv::Point next = at + step;
          if (!cv::Rect({0, 0}, view.state.size()).contains(next) || seen(next) != 0) continue;
          if (!neighbors_agree(view, at, next, options.steepest_code)) continue;
          seen(next) = 1;
          piece.push_back(next);
        }
      }
      if (piece.size() < static_cast<std::size_t>(options.least_component_px))
        for (const cv::Point at : piece) wrong(at) = 1;
    }
  }
  drop(view, wrong);
}

double inverted_share(const GrayStack& stack, double noise) {
  std::size_t below = 0;
  std::size_t above = 0;
  for (int v = 0; v < stack.white.rows; v += 2) {
    for (int u = 0; u < stack.white.cols; u += 2) {
      const float d = stack.white.at<float>(v, u) - stack.black.at<float>(v, u);
      above += d > 10 * noise ? 1U : 0U;
      below += d < -10 * noise ? 1U : 0U;
    }
  }
  return above + below == 0 ? 0 : static_cast<double>(below) / static_cast<double>(above + below);
}

}  // namespace

bool neighbors_agree(const DecodedView& view, cv::Point a, cv::Point b, double steepest_code) {
  if (!view.valid(b.x, b.y)) return false;
  const double reach = 1 + steepest_code * std::max(std::abs(b.x - a.x), std::abs(b.y - a.y));
  return std::abs(view.code[0](a) - view.code[0](b)) <= reach &&
         std::abs(view.code[1](a) - view.code[1](b)) <= reach;
}

std::string to_string(PixelState state) {
  switch (state) {
    case PixelState::kValid:
      return "valid";
    case PixelState::kUnlit:
      return "unlit";
    case PixelState::kSaturated:
      return "saturated";
    case PixelState::kAmbiguous:
      return "ambiguous";
    case PixelState::kBlurred:
      return "blurred";
    case PixelState::kOffPanel:
      return "off_panel";
    case PixelState::kInconsistent:
      return "inconsistent";
  }
  return "unknown";
}

double DecodedView::valid_share() const {
  const std::size_t all = std::accumulate(counts.begin(), counts.end(), std::size_t{0});
  const std::size_t lit = all - counts[static_cast<std::size_t>(PixelState::kUnlit)];
  return lit == 0 ? 0 : static_cast<double>(counts[0]) / static_cast<double>(lit);
}

DecodedView decode_gray_stack(const GrayStack& stack, const GrayDecodeOptions& options) {
  PENCILSCAN_CHECK(stack.white.type() == CV_32FC1 && stack.black.size() == stack.white.size());
  DecodedView view;
  const cv::Size size = stack.white.size();
  view.state = cv::Mat_<std::uint8_t>(size, 0);
  for (auto& code : view.code) code = cv::Mat_<std::int32_t>(size, -1);
  const NoiseModel noise = noise_model(stack);
  view.noise = std::sqrt(noise.variance(0.3));
  view.inverted_share = inverted_share(stack, view.noise);
  const PixelDecoder decoder(stack, noise, options);
  parallel_for(static_cast<std::size_t>(size.height), [&](std::size_t row) {
    const int v = static_cast<int>(row);
    for (int u = 0; u < size.width; ++u) {
      std::array<std::int32_t, 2> code{-1, -1};
      const PixelState state = decoder.decode(u, v, code);
      view.state(v, u) = static_cast<std::uint8_t>(state);
      if (state != PixelState::kValid) continue;
      view.code[0](v, u) = code[0];
      view.code[1](v, u) = code[1];
    }
  });
  drop_unsupported(view, options);
  drop_small_pieces(view, options);
  find_crossings(stack, options, view);
  for (const std::uint8_t state : view.state) ++view.counts[state];
  return view;
}

}  // namespace pencilscan
