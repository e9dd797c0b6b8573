#include "pencilscan/color/color_response.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "pencilscan/core/median.h"
#include "pencilscan/pattern/solid_color.h"

namespace pencilscan {
namespace {

constexpr float kFullLight = 0.98F;
constexpr std::size_t kLeastPixels = 300;
constexpr int kEvery = 2;  ///< pixels looked at, each way

/// Median, and its deviation were they independent. (1.25: of a median over a mean.)
MeasuredNumber median_of(const std::vector<double>& values) {
  const double middle = upper_median(values);
  std::vector<double> distances;
  distances.reserve(values.size());
  for (const double v : values) distances.push_back(std::abs(v - middle));
  return {middle, 1.25 * kDeviationPerMedian * upper_median(std::move(distances)) /
                      std::sqrt(static_cast<double>(values.size()))};
}

/// Least white - black of pixels that count, as a share of what bright ones have.
float least_contrast(const cv::Mat& white, const cv::Mat& black) {
  constexpr double kShare = 0.25;
  std::vector<float> contrast;
  for (int v = 0; v < white.rows; v += 4)
    for (int u = 0; u < white.cols; u += 4)
      contrast.push_back(white.at<float>(v, u) - black.at<float>(v, u));
  // Of an object that covers a small part of the image, too.
  return static_cast<float>(kShare) * lower_quantile(std::move(contrast), 0.99);
}

/// f(gamma) = p^g + q^g - w^g - b^g, p and q between b and w, falls through zero once.
std::optional<double> root_of_light(double p, double q, double w, double b) {
  double low = 0.25;
  double high = 6;
  const auto f = [&](double g) {
    return std::pow(p / w, g) + std::pow(q / w, g) - 1 - std::pow(b / w, g);
  };
  if (!(f(low) > 0 && f(high) < 0)) return std::nullopt;
  constexpr int kRounds = 24;
  for (int i = 0; i < kRounds; ++i) {
    const double middle = 0.5 * (low + high);
    (f(middle) > 0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// How much brighter an image's lit parts are than white's: the lamp's flicker.
double flicker(const cv::Mat& image, const cv::Mat& other, const cv::Mat& white,
               const cv::Mat& black, float least) {
  // Of the light is in `image`: far enough below 1 that noise does not choose the bright ones.
  constexpr float kWhole = 0.9F;
  std::vector<double> ratios;
  for (int v = 0; v < white.rows; v += kEvery) {
    for (int u = 0; u < white.cols; u += kEvery) {
      const float w = white.at<float>(v, u);
      const float contrast = w - black.at<float>(v, u);
      const float at = image.at<float>(v, u);
      if (contrast < least || w > kFullLight || at - other.at<float>(v, u) < kWhole * contrast)
        continue;
      ratios.push_back(
          static_cast<double>((at + other.at<float>(v, u)) / (w + black.at<float>(v, u))));
    }
  }
  return ratios.size() < kLeastPixels ? 1 : upper_median(std::move(ratios));
}

cv::Vec3f light_above(const cv::Mat& image, const cv::Mat& black, int v, int u) {
  return image.at<cv::Vec3f>(v, u) - black.at<cv::Vec3f>(v, u);
}

/// Where all channels of white are clearly lit and none is at the end of its range.
std::vector<cv::Point> lit_places(const cv::Mat& white, const cv::Mat& black) {
  std::array<cv::Mat, 3> w, b;
  std::array<float, 3> least{};
  for (std::size_t c = 0; c < 3; ++c) {
    cv::extractChannel(white, w[c], static_cast<int>(c));
    cv::extractChannel(black, b[c], static_cast<int>(c));
    least[c] = std::max(least_contrast(w[c], b[c]), 1e-3F);
  }
  std::vector<cv::Point> places;
  for (int v = 0; v < white.rows; v += kEvery) {
    for (int u = 0; u < white.cols; u += kEvery) {
      bool is_lit = true;
      for (std::size_t c = 0; c < 3; ++c) {
        const float at = w[c].at<float>(v, u);
        is_lit = is_lit && at < kFullLight && at - b[c].at<float>(v, u) > least[c];
      }
      if (is_lit) places.emplace_back(u, v);
    }
  }
  return places;
}

std::optional<MeasuredNumber> projector_gamma(const cv::Mat& white, const cv::Mat& black,
                                              const std::map<std::string, cv::Mat>& solids,
                                              const std::vector<cv::Point>& places) {
  std::vector<double> exponents;
  for (const SolidImage& image : solid_images()) {
    const auto at = solids.find(image.name);
    const double value = image.value[0];
    if (at == solids.end() || image.value[1] != value || image.value[2] != value) continue;
    for (const cv::Point& place : places) {
      const float whole = light_above(white, black, place.y, place.x)[1];
      const float part = light_above(at->second, black, place.y, place.x)[1];
      if (part > 0)
        exponents.push_back(std::log(static_cast<double>(part / whole)) / std::log(value));
    }
  }
  if (exponents.size() < kLeastPixels) return std::nullopt;
  return median_of(exponents);
}

}  // namespace

std::optional<MeasuredNumber> camera_gamma(
    const cv::Mat& white, const cv::Mat& black,
    std::span<const std::pair<cv::Mat, cv::Mat>> pattern_and_inverse) {
  constexpr float kLeastContrast = 0.12F;  // below, a fraction of a level in black tells too much
  const float least = std::max(least_contrast(white, black), kLeastContrast);
  std::vector<double> roots, whites;
  for (const auto& [pattern, inverse] : pattern_and_inverse) {
    const double brighter_p = flicker(pattern, inverse, white, black, least);
    const double brighter_q = flicker(inverse, pattern, white, black, least);
    for (int v = 0; v < white.rows; v += kEvery) {
      for (int u = 0; u < white.cols; u += kEvery) {
        const double w = static_cast<double>(white.at<float>(v, u));
        const double b = std::max(0.0, static_cast<double>(black.at<float>(v, u)));
        const double p = static_cast<double>(pattern.at<float>(v, u)) / brighter_p;
        const double q = static_cast<double>(inverse.at<float>(v, u)) / brighter_q;
        constexpr double kMixed = 0.4;  // |p - q| over the contrast: both show a good part
        if (w - b < static_cast<double>(least) || w > static_cast<double>(kFullLight) ||
            std::abs(p - q) > kMixed * (w - b) || p <= b || q <= b)
          continue;
        if (const auto root = root_of_light(p, q, w, b)) {
          roots.push_back(*root);
          whites.push_back(w);
        }
      }
    }
  }
  if (roots.size() < kLeastPixels) return std::nullopt;
  MeasuredNumber gamma = median_of(roots);
  // An error of black of a third of a level, d(f) / d(gamma) = -ln 2 / 2 at half light.
  const double of_black = 0.33 / 255 / (0.35 * upper_median(std::move(whites)));
  gamma.sigma = std::hypot(gamma.sigma, of_black);
  return gamma;
}

std::optional<ColorResponse> color_response(const cv::Mat& white, const cv::Mat& black,
                                            const std::map<std::string, cv::Mat>& solids) {
  std::array<const cv::Mat*, 3> of_color{};
  for (std::size_t k = 0; k < 3; ++k) {
    constexpr std::array<const char*, 3> kNames{"red", "green", "blue"};
    const auto at = solids.find(kNames[k]);
    if (at == solids.end()) return std::nullopt;
    of_color[k] = &at->second;
  }
  const std::vector<cv::Point> places = lit_places(white, black);
  if (places.size() < kLeastPixels) return std::nullopt;
  std::array<std::array<std::vector<double>, 3>, 3> shares;
  for (const cv::Point& place : places) {
    std::array<cv::Vec3f, 3> light;
    for (std::size_t k = 0; k < 3; ++k)
      light[k] = light_above(*of_color[k], black, place.y, place.x);
    for (int c = 0; c < 3; ++c) {
      const float sum = light[0][c] + light[1][c] + light[2][c];
      if (!(sum > 0)) continue;
      for (std::size_t k = 0; k < 3; ++k)
        shares[static_cast<std::size_t>(c)][k].push_back(static_cast<double>(light[k][c] / sum));
    }
  }
  for (const auto& of_channel : shares)
    if (of_channel[0].size() < kLeastPixels) return std::nullopt;  // blind to all three
  ColorResponse response;
  for (Eigen::Index c = 0; c < 3; ++c) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      const MeasuredNumber share =
          median_of(shares[static_cast<std::size_t>(c)][static_cast<std::size_t>(k)]);
      response.matrix(c, k) = share.value;
      response.matrix_sigma(c, k) = share.sigma;
    }
    response.matrix.row(c) /= response.matrix.row(c).sum();
  }
  // Of a grey camera whose pictures are stored as colours all rows are one. Channels that share
  // nothing have a determinant of 1; with each half of the others' light it is .125.
  constexpr double kLeastDeterminant = 0.05;
  if (!(std::abs(response.matrix.determinant()) >= kLeastDeterminant)) return std::nullopt;
  response.projector_gamma = projector_gamma(white, black, solids, places);
  return response;
}

}  // namespace pencilscan
