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

/// What an image of a pattern and that of its inverse are divided by: the lamp's flicker.
struct Flicker {
  double pattern = 1;
  double inverse = 1;
};

/// Values of one pixel, >= 0.
struct Exposures {
  double pattern, inverse, white, black;
};

/// |pattern - inverse| over the contrast: below, both show a good part of the light.
constexpr double kMixed = 0.4;

/// Pixels of a pattern and its inverse that are lit clearly and not at the end of their range:
/// those that one image lights for the most part tell its flicker, the others gamma.
struct PatternPixels {
  std::vector<Exposures> mostly_pattern, mostly_inverse, mixed;
};

PatternPixels pattern_pixels(const cv::Mat& white, const cv::Mat& black, const cv::Mat& pattern,
                             const cv::Mat& inverse, double least) {
  PatternPixels pixels;
  for (int v = 0; v < white.rows; v += kEvery) {
    for (int u = 0; u < white.cols; u += kEvery) {
      const auto at = [&](const cv::Mat& image) {
        return std::max(0.0, static_cast<double>(image.at<float>(v, u)));
      };
      const Exposures x{at(pattern), at(inverse), at(white), at(black)};
      const double contrast = x.white - x.black;
      if (contrast < least || x.white > static_cast<double>(kFullLight)) continue;
      const double share = (x.pattern - x.inverse) / contrast;
      if (std::abs(share) <= kMixed)
        pixels.mixed.push_back(x);
      else
        (share > 0 ? pixels.mostly_pattern : pixels.mostly_inverse).push_back(x);
    }
  }
  return pixels;
}

/// How much brighter an image is than white says where it shows most of the light, if light is
/// value^gamma: what the other image shows, which is divided by `of_other`, is taken off. All such
/// pixels count. Those where the other image is darkest would be those that noise darkened: a gamma
/// of 2.2 spreads the noise of the dark over a tenth of the range.
double flicker(const std::vector<Exposures>& pixels, double gamma, double Exposures::*bright,
               double Exposures::*other, double of_other) {
  std::vector<double> ratios;
  for (const Exposures& x : pixels) {
    const double light =
        std::pow(x.white, gamma) + std::pow(x.black, gamma) - std::pow(x.*other / of_other, gamma);
    if (light > 0) ratios.push_back(x.*bright / std::pow(light, 1 / gamma));
  }
  return ratios.size() < kLeastPixels ? 1 : upper_median(std::move(ratios));
}

Flicker flicker_of(const PatternPixels& pixels, double gamma, const Flicker& before) {
  using X = Exposures;
  return {flicker(pixels.mostly_pattern, gamma, &X::pattern, &X::inverse, before.inverse),
          flicker(pixels.mostly_inverse, gamma, &X::inverse, &X::pattern, before.pattern)};
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
  std::vector<PatternPixels> patterns;
  for (const auto& [pattern, inverse] : pattern_and_inverse)
    patterns.push_back(pattern_pixels(white, black, pattern, inverse, static_cast<double>(least)));
  std::vector<Flicker> flickers(patterns.size());
  std::vector<double> roots, whites;
  // Gamma moves the flicker little, which moves gamma: 1 % of flicker is 7 % of gamma.
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    if (round > 0) {
      const double gamma = upper_median(roots);
      for (std::size_t i = 0; i < patterns.size(); ++i)
        flickers[i] = flicker_of(patterns[i], gamma, flickers[i]);
    }
    roots.clear();
    whites.clear();
    for (std::size_t i = 0; i < patterns.size(); ++i) {
      for (const Exposures& x : patterns[i].mixed) {
        const double p = x.pattern / flickers[i].pattern;
        const double q = x.inverse / flickers[i].inverse;
        if (p <= x.black || q <= x.black) continue;
        if (const auto root = root_of_light(p, q, x.white, x.black)) {
          roots.push_back(*root);
          whites.push_back(x.white);
        }
      }
    }
    if (roots.size() < kLeastPixels) return std::nullopt;
  }
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
