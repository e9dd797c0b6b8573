#include "pencilscan/detection/code_evidence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "pencilscan/core/lanes.h"
#include "pencilscan/core/median.h"
#include "pencilscan/detection/curve_rendering.h"
#include "pencilscan/detection/profile_fit.h"

namespace pencilscan {
namespace {

constexpr int kHalf = 4;  ///< profile half-length, samples
/// Widths that the half-length of a wide line holds: a box has ended at 1.7. Of lines that the full
/// size shows, samples are 1 px apart.
constexpr float kHalfWidths = 2.2F;
constexpr int kColorUnknowns = 4;  ///< own line, other families, background level and slope

constexpr int kRightSides = 3;  ///< red, green, blue

/// Normal equations of each point of a curve, number by number: the upper triangle of the matrix by
/// rows, then the right sides of each unknown; zeros before the first and after the last point.
class PointSums {
 public:
  static constexpr std::size_t kMatrix = kColorUnknowns * (kColorUnknowns + 1) / 2;
  static constexpr std::size_t kNumbers = kMatrix + kColorUnknowns * kRightSides;

  PointSums(int points, int margin)
      : margin_(margin), row_(static_cast<std::size_t>(points + 2 * margin + kLanes)) {
    numbers_.assign(kNumbers * row_, 0.F);
  }
  [[nodiscard]] float* at(std::size_t number, int point) {
    return numbers_.data() + number * row_ + static_cast<std::size_t>(point + margin_);
  }
  [[nodiscard]] const float* at(std::size_t number, int point) const {
    return numbers_.data() + number * row_ + static_cast<std::size_t>(point + margin_);
  }

 private:
  int margin_;
  std::size_t row_;
  std::vector<float> numbers_;
};

/// The images that are read along a curve.
struct Images {
  const cv::Mat& color;   ///< CV_32FC3
  const cv::Mat& others;  ///< CV_32FC1, light of the other families
};

struct EightPoints {
  Lanes x;
  Lanes y;
  Lanes nx;
  Lanes ny;
  Lanes width;
};

/// Sums over the profiles of eight points.
PENCILSCAN_CLONES
void sum_profiles(const Images& images, const EightPoints& points,
                  std::array<Lanes, PointSums::kNumbers>& sums) {
  sums = {};
  Lanes step = points.width * (kHalfWidths / static_cast<float>(kHalf));
  step = points.width > kMaxLineWidth ? step : step - step + 1;
  const auto* color = images.color.ptr<float>();
  const auto* others = images.others.ptr<float>();
  const auto color_row = static_cast<int>(images.color.step1());
  const auto others_row = static_cast<int>(images.others.step1());
  const Lanes zero{};
  for (int o = -kHalf; o <= kHalf; ++o) {
    // Nearest pixels; the shift makes truncation round.
    constexpr int kShift = 4096;
    const Lanes offset = static_cast<float>(o) * step;
    const Lanes fx = points.x + offset * points.nx + (kShift + 0.5F);
    const Lanes fy = points.y + offset * points.ny + (kShift + 0.5F);
    IntLanes x = __builtin_convertvector(fx, IntLanes) - kShift;
    IntLanes y = __builtin_convertvector(fy, IntLanes) - kShift;
    const IntLanes is_inside =
        (x >= 0) & (y >= 0) & (x < images.color.cols) & (y < images.color.rows);
    x &= is_inside;
    y &= is_inside;
    const Lanes d = (__builtin_convertvector(x, Lanes) - points.x) * points.nx +
                    (__builtin_convertvector(y, Lanes) - points.y) * points.ny;
    std::array<Lanes, kColorUnknowns> unknown;
    exponential(-0.5F * d * d / (points.width * points.width), unknown[0]);
    gather(others, y * others_row + x, unknown[1]);
    unknown[2] = zero + 1;
    unknown[3] = d / (step * static_cast<float>(kHalf));
    for (Lanes& u : unknown) u = is_inside ? u : zero;
    std::size_t number = 0;
    for (std::size_t i = 0; i < kColorUnknowns; ++i) {
      for (std::size_t j = i; j < kColorUnknowns; ++j) sums[number++] += unknown[i] * unknown[j];
    }
    const IntLanes at = y * color_row + 3 * x;
    for (std::size_t c = 0; c < kRightSides; ++c) {
      Lanes value{};
      gather(color + c, at, value);
      for (std::size_t i = 0; i < kColorUnknowns; ++i)
        sums[PointSums::kMatrix + i * kRightSides + c] += unknown[i] * value;
    }
  }
}

/// Solves for the amplitudes of eight lines from `first` on, over +-half_arc points.
PENCILSCAN_CLONES
void solve_amplitudes(const PointSums& sums, int first, int half_arc,
                      std::array<Lanes, kRightSides>& rgb) {
  std::array<Lanes, PointSums::kNumbers> total{};
  for (std::size_t number = 0; number < total.size(); ++number) {
    const float* from = sums.at(number, first);
    for (int j = -half_arc; j <= half_arc; ++j) {
      Lanes value;
      load(from + j, value);
      total[number] += value;
    }
  }
  // The line itself last: elimination then ends with its amplitude.
  constexpr std::array<std::size_t, kColorUnknowns> kOrder = {3, 2, 1, 0};
  std::array<std::array<Lanes, kColorUnknowns>, kColorUnknowns> matrix{};
  std::array<std::array<Lanes, kRightSides>, kColorUnknowns> right{};
  std::size_t number = 0;
  for (std::size_t i = 0; i < kColorUnknowns; ++i) {
    for (std::size_t j = i; j < kColorUnknowns; ++j) matrix[kOrder[j]][kOrder[i]] = total[number++];
  }
  for (std::size_t i = 0; i < kColorUnknowns; ++i) {
    for (std::size_t c = 0; c < kRightSides; ++c) right[kOrder[i]][c] = total[number++];
  }
  for (std::size_t i = 0; i < kColorUnknowns; ++i) matrix[i][i] += 1e-4F;
  // The others' coefficient lies between 0 and about 1: a ridge keeps it there when unobserved.
  matrix[kOrder[1]][kOrder[1]] += 1e-3F;
  for (std::size_t i = 0; i + 1 < kColorUnknowns; ++i) {
    const Lanes inverse = 1 / matrix[i][i];
    for (std::size_t j = i + 1; j < kColorUnknowns; ++j) {
      const Lanes factor = matrix[i][j] * inverse;
      for (std::size_t k = j; k < kColorUnknowns; ++k) matrix[j][k] -= factor * matrix[i][k];
      for (std::size_t c = 0; c < kRightSides; ++c) right[j][c] -= factor * right[i][c];
    }
  }
  for (std::size_t c = 0; c < kRightSides; ++c)
    rgb[c] = right[kColorUnknowns - 1][c] / matrix[kColorUnknowns - 1][kColorUnknowns - 1];
}

/// Colour amplitude of each point of a curve.
struct ColorAmplitude {
  Eigen::Vector3f rgb = Eigen::Vector3f::Zero();
};

std::vector<ColorAmplitude> color_amplitudes(const Images& images, const Curve& curve,
                                             int half_arc) {
  const int n = static_cast<int>(curve.points.size());
  PointSums sums(n, half_arc);
  for (int first = 0; first < n; first += kLanes) {
    EightPoints points;
    for (int k = 0; k < kLanes; ++k) {
      const CurvePoint& p = curve.points[static_cast<std::size_t>(std::min(first + k, n - 1))];
      points.x[k] = p.position.x();
      points.y[k] = p.position.y();
      points.nx[k] = p.normal.x();
      points.ny[k] = p.normal.y();
      points.width[k] = p.width_px;
    }
    std::array<Lanes, PointSums::kNumbers> eight;
    sum_profiles(images, points, eight);
    for (std::size_t number = 0; number < eight.size(); ++number) {
      for (int k = 0; k < std::min(kLanes, n - first); ++k)
        *sums.at(number, first + k) = eight[number][k];
    }
  }
  std::vector<ColorAmplitude> result(curve.points.size());
  for (int first = 0; first < n; first += kLanes) {
    std::array<Lanes, kRightSides> rgb;
    solve_amplitudes(sums, first, half_arc, rgb);
    for (int k = 0; k < std::min(kLanes, n - first); ++k)
      result[static_cast<std::size_t>(first + k)].rgb = {rgb[0][k], rgb[1][k], rgb[2][k]};
  }
  return result;
}

Eigen::Vector3f color_vector(const PatternColor& color) {
  const Rgb& rgb = color.light();
  return {static_cast<float>(rgb[0]), static_cast<float>(rgb[1]), static_cast<float>(rgb[2])};
}

/// The colour of a family whose direction a measured one has most.
std::size_t nearest_color(const Eigen::Vector3f& rgb, std::span<const Eigen::Vector3f> colors) {
  const auto likeness = [&](std::size_t j) { return rgb.dot(colors[j]) / colors[j].norm(); };
  std::size_t best = 0;
  for (std::size_t j = 1; j < colors.size(); ++j)
    if (likeness(j) > likeness(best)) best = j;
  return best;
}

/// How bright each channel is on this object in this camera, of what the colours say: medians over
/// the points of those colours that have the channel. Which colour a point has follows from the
/// gains, and the gains from the colours, in turns.
Eigen::Vector3f channel_gains(const std::vector<std::vector<ColorAmplitude>>& amplitudes,
                              const Vec3& presence, std::span<const Eigen::Vector3f> colors) {
  constexpr int kTurns = 3;
  constexpr std::size_t kEnough = 100;
  const Eigen::Vector3f detects = presence.cast<float>();
  Eigen::Vector3f gains(1, 1, 1);
  for (int turn = 0; turn < kTurns; ++turn) {
    std::array<std::vector<float>, 3> ratios;
    for (const auto& of_curve : amplitudes) {
      for (const ColorAmplitude& a : of_curve) {
        const float own = detects.dot(a.rgb);
        if (!(own > 0)) continue;
        const Eigen::Vector3f& color = colors[nearest_color(a.rgb.cwiseQuotient(gains), colors)];
        for (Eigen::Index c = 0; c < 3; ++c) {
          const float ratio = a.rgb[c] * detects.dot(color) / (own * color[c]);
          if (color[c] > 0 && ratio > 0) ratios[static_cast<std::size_t>(c)].push_back(ratio);
        }
      }
    }
    for (std::size_t c = 0; c < 3; ++c) {
      if (ratios[c].size() >= kEnough)
        gains[static_cast<Eigen::Index>(c)] = upper_median(std::move(ratios[c]));
    }
  }
  return gains;
}

}  // namespace

std::vector<float> color_evidence(const Curve& curve, int begin, int end, std::size_t colors) {
  std::vector<float> evidence(colors, 0.F);
  for (int i = begin; i < end; ++i) {
    for (std::size_t c = 0; c < colors; ++c)
      evidence[c] += curve.code[static_cast<std::size_t>(i) * colors + c] / kPointsPerMeasurement;
  }
  return evidence;
}

void measure_code(const cv::Mat& unmixed_image, const std::vector<ColorFamily>& families,
                  std::vector<Curve>& curves, const CodeEvidenceOptions& options) {
  std::vector<cv::Mat> models;
  for (std::size_t f = 0; f < families.size(); ++f) {
    std::vector<Curve> of_family;
    for (const Curve& c : curves) {
      if (c.family == static_cast<int>(f)) of_family.push_back(c);
    }
    models.push_back(render_curves(of_family, unmixed_image.size()));
  }
  for (std::size_t f = 0; f < families.size(); ++f) {
    const ColorFamily& family = families[f];
    cv::Mat others(unmixed_image.size(), CV_32F, cv::Scalar(0));
    for (std::size_t g = 0; g < families.size(); ++g) {
      if (g != f) others += models[g];
    }
    std::vector<std::vector<ColorAmplitude>> amplitudes;
    for (const Curve& c : curves) {
      if (c.family != static_cast<int>(f)) continue;
      amplitudes.push_back(color_amplitudes({unmixed_image, others}, c, options.half_arc));
    }
    std::vector<Eigen::Vector3f> colors;
    for (const PatternColor& color : family.colors) colors.push_back(color_vector(color));
    const Eigen::Vector3f gains = channel_gains(amplitudes, family.presence, colors);
    std::size_t k = 0;
    for (Curve& curve : curves) {
      if (curve.family != static_cast<int>(f)) continue;
      const auto& measured = amplitudes[k++];
      curve.code.assign(curve.points.size() * family.colors.size(), 0.F);
      for (std::size_t i = 0; i < curve.points.size(); ++i) {
        const Eigen::Vector3f rgb = measured[i].rgb.cwiseQuotient(gains);
        const float noise =
            static_cast<float>(options.relative_noise) * std::max(rgb.norm(), 1e-4F);
        float* row = curve.code.data() + i * family.colors.size();
        float best = -1e9F;
        for (std::size_t j = 0; j < family.colors.size(); ++j) {
          const Eigen::Vector3f& c = colors[j];
          const float scale = std::max(0.F, rgb.dot(c) / c.squaredNorm());
          row[j] = -0.5F * (rgb - scale * c).squaredNorm() / (noise * noise);
          best = std::max(best, row[j]);
        }
        for (std::size_t j = 0; j < family.colors.size(); ++j) {
          row[j] = std::max(row[j] - best, -static_cast<float>(options.max_log_ratio));
        }
      }
    }
  }
}

}  // namespace pencilscan
