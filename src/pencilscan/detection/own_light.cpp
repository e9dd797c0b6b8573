#include "pencilscan/detection/own_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "pencilscan/core/lanes.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/stretches.h"
#include "pencilscan/view/nearest.h"

namespace pencilscan {
namespace {

constexpr std::size_t kOwnProfiles = 1;  ///< to either side of a point's own

/// To either side, px: in the middle of the longest gap that is bridged, of 6 px, and with the
/// light's blur on either side, half of these points are lit.
constexpr std::size_t kAround = 9;

/// Of the points beside a gap, the third highest: lower ones may lie in it, higher ones may hold
/// noise and the light of a crossing line.
constexpr std::size_t kHighest = 3;

/// Half-length of the profiles that tell a line from its surroundings, as fits have it.
int half_for(float width) { return std::clamp(nearest(2.4F * width) + 1, 4, kMaxHalf); }

float at(const Profile& profile, int offset) {
  return profile[static_cast<std::size_t>(kMaxHalf + offset)];
}

/// Mean of the profiles within kOwnProfiles of one; at the ends fewer, but as many to either side.
Profile own_profile(std::span<const Profile> profiles, std::size_t i) {
  Profile mean{};
  const std::size_t r = std::min({kOwnProfiles, i, profiles.size() - 1 - i});
  const float weight = 1 / static_cast<float>(2 * r + 1);
  for (std::size_t j = i - r; j <= i + r; ++j)
    for (std::size_t k = 0; k < mean.size(); ++k) mean[k] += weight * profiles[j][k];
  return mean;
}

struct OwnLight {
  float height = 0;     ///< of the line
  float residual2 = 0;  ///< noise variance from the odd part of the residual: misfit is even
  float gain = 0;       ///< variance of the height for unit noise variance
};

/// By least squares over level and slope.
OwnLight own_light(const Profile& profile, float width) {
  const int half = half_for(width);
  Profile line;
  line_profile(width, line);
  float mean = 0;
  for (int o = -half; o <= half; ++o) mean += at(line, o);
  mean /= static_cast<float>(2 * half + 1);
  // The line is even: a slope takes nothing of it.
  float square = 0;
  float product = 0;
  float moment = 0;
  float slope = 0;
  for (int o = -half; o <= half; ++o) {
    const float t = at(line, o) - mean;
    square += t * t;
    product += t * at(profile, o);
    moment += static_cast<float>(o * o);
    slope += static_cast<float>(o) * at(profile, o);
  }
  slope /= moment;
  float odd2 = 0;
  for (int o = 1; o <= half; ++o) {
    const float odd = at(profile, o) - at(profile, -o) - static_cast<float>(2 * o) * slope;
    odd2 += odd * odd;
  }
  // Bilinear samples 1 px apart are correlated by 1/4, in the mean over where they lie.
  constexpr float kCorrelated = 1.5F;
  return {product / square, 0.5F * odd2 / static_cast<float>(half - 1), kCorrelated / square};
}

/// Height of all light in the middle of a profile over the lowest beside: that of a line there, and
/// of what hides it.
float height_of_all(const Profile& profile, float width) {
  const int half = half_for(width);
  Profile line;
  line_profile(width, line);
  float lowest = at(profile, -kMaxHalf);
  for (int o = 1 - kMaxHalf; o < kMaxHalf; ++o)
    lowest = std::min(lowest, (at(profile, o - 1) + at(profile, o) + at(profile, o + 1)) / 3);
  float light = 0;
  float of_line = 0;
  for (int o = -half; o <= half; ++o) {
    light += at(line, o) * (at(profile, o) - lowest);
    of_line += at(line, o) * at(line, o);
  }
  return light / of_line;
}

class Darkness {
 public:
  Darkness(std::span<const CurvePoint> points, std::span<const Profile> profiles,
           const cv::Mat& all_light, float kept)
      : points_(points), all_light_(all_light), kept_(kept) {
    for (std::size_t i = 0; i < points.size(); ++i)
      own_.push_back(own_light(own_profile(profiles, i), points[i].width_px));
  }

  /// Whether a point is dark beside a line of this height. Log-likelihood of no line less that of
  /// the faintest one, of height h, both with the same noise: h (h / 2 - own height) / variance.
  [[nodiscard]] bool is_dark(std::size_t i, float height) const {
    const float faintest = kept_ * height;
    if (own_[i].height >= 0.5F * faintest) return false;
    const float log_odds = std::log(1000.F);
    const float least = log_odds * own_[i].gain * noise_around(i);
    const auto fits_none = [&](float own) { return faintest * (0.5F * faintest - own) > least; };
    return fits_none(own_[i].height) && (all_light_.empty() || fits_none(all_light_at(i)));
  }

  /// Height of the line before and after a point, within [begin, end).
  [[nodiscard]] float before(std::size_t i, std::size_t begin) const {
    return height_in(std::max(begin, i - std::min(i, kAround)), i);
  }
  [[nodiscard]] float after(std::size_t i, std::size_t end) const {
    return height_in(i + 1, std::min(end, i + 1 + kAround));
  }

 private:
  [[nodiscard]] float height_in(std::size_t begin, std::size_t end) const {
    std::array<float, kHighest> highest{};
    for (std::size_t j = begin; j < end; ++j) {
      float height = own_[j].height;
      for (float& h : highest) {
        if (height > h) std::swap(height, h);
      }
    }
    return highest.back();
  }

  /// The median: ends of a line in a gap are no noise.
  [[nodiscard]] float noise_around(std::size_t i) const {
    std::vector<float> variances;
    for (std::size_t j = i - std::min(i, kAround); j < std::min(own_.size(), i + kAround + 1); ++j)
      variances.push_back(own_[j].residual2);
    return upper_median(std::move(variances));
  }

  [[nodiscard]] float all_light_at(std::size_t i) const {
    std::vector<Profile> profiles;
    const std::size_t end = std::min(points_.size(), i + kOwnProfiles + 1);
    const std::size_t begin = i - std::min(i, kOwnProfiles);
    for (std::size_t j = begin; j < end; ++j)
      sample_across(all_light_, points_[j], profiles.emplace_back());
    return height_of_all(own_profile(profiles, i - begin), points_[i].width_px);
  }

  std::span<const CurvePoint> points_;
  const cv::Mat& all_light_;
  float kept_;
  std::vector<OwnLight> own_;
};

}  // namespace

PENCILSCAN_CLONES
void sample_across(const cv::Mat& image, const CurvePoint& point, Profile& profile) {
  const auto* data = image.ptr<float>();
  const auto row = static_cast<int>(image.step1());
  for (int block = 0; block < 2; ++block) {
    Lanes offset;
    for (int k = 0; k < kLanes; ++k) offset[k] = static_cast<float>(block * kLanes + k - kMaxHalf);
    Lanes x = point.position.x() + offset * point.normal.x();
    Lanes y = point.position.y() + offset * point.normal.y();
    clamp(0, static_cast<float>(image.cols - 1), x);
    clamp(0, static_cast<float>(image.rows - 1), y);
    IntLanes ix = __builtin_convertvector(x, IntLanes);
    IntLanes iy = __builtin_convertvector(y, IntLanes);
    ix = ix > image.cols - 2 ? ix - 1 : ix;
    iy = iy > image.rows - 2 ? iy - 1 : iy;
    x -= __builtin_convertvector(ix, Lanes);
    y -= __builtin_convertvector(iy, Lanes);
    const IntLanes at = iy * row + ix;
    std::array<Lanes, 4> corner{};
    gather(data, at, corner[0]);
    gather(data + 1, at, corner[1]);
    gather(data + row, at, corner[2]);
    gather(data + row + 1, at, corner[3]);
    const Lanes value =
        (1 - y) * ((1 - x) * corner[0] + x * corner[1]) + y * ((1 - x) * corner[2] + x * corner[3]);
    store(value, profile.data() + block * kLanes);
  }
}

std::vector<char> dark_points(std::span<const CurvePoint> points, std::span<const Profile> profiles,
                              const cv::Mat& all_light, std::span<const float> expected,
                              float kept) {
  const Darkness darkness(points, profiles, all_light, kept);
  const std::size_t n = points.size();
  std::vector<char> is_gap(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    float height = std::min(darkness.before(i, 0), darkness.after(i, n));
    if (!expected.empty()) height = std::max(height, expected[i]);
    is_gap[i] = darkness.is_dark(i, height) ? 1 : 0;
  }
  // Beside a gap and at its ends, a curve runs on into the dark.
  std::vector<char> is_dark = is_gap;
  for_each_stretch(is_gap, [&](int first, int last) {
    const auto begin = static_cast<std::size_t>(first);
    const auto end = static_cast<std::size_t>(last);
    if (is_gap[begin] != 0) return;
    for (std::size_t i = begin; i < end && darkness.is_dark(i, darkness.after(i, end)); ++i)
      is_dark[i] = 1;
    for (std::size_t i = end; i-- > begin && darkness.is_dark(i, darkness.before(i, begin));)
      is_dark[i] = 1;
  });
  return is_dark;
}

}  // namespace pencilscan
