#pragma once

#include <array>

#include "pencilscan/core/lanes.h"

namespace pencilscan {

// What a camera sees across a projected line: a box with blurred edges, the difference of two
// logistic steps at +-half of scale `edge`, with second moment width^2 = (half^2 + (pi edge)^2) / 3
// and height 1. Its edges place the line where light that varies along the profile would pull a
// Gaussian aside, and subtracting it leaves less behind, where weaker lines lie.

constexpr int kMaxHalf = 7;  ///< largest half-length of a profile, px
constexpr int kProfileSize = 2 * kMaxHalf + 1;
constexpr float kMinLineWidth = 0.6F;  ///< px
constexpr float kMaxLineWidth = 4.5F;
constexpr float kModelReach = 3.0F;  ///< line profiles are rendered to this many widths

/// Values at -kMaxHalf..kMaxHalf px across a curve; one more, never used, fills the last register.
using Profile = std::array<float, 2 * kLanes>;

/// Width (root of the second moment, px) of the profile of a line that is `line_px` wide in the
/// image before blur.
[[nodiscard]] float line_profile_width(float line_px);

/// Height of the line profile of `width` at -7..8 px from its middle, 0 beyond its reach.
void line_profile(float width, Profile& values);

/// Adds amplitude times the line profile of `width` at first + step i to image[stride i], i <
/// count; all within kModelReach widths. A width beyond kMaxLineWidth is that of a smaller image.
void add_line_profile(float amplitude, float width, float first, float step, int count,
                      float* image, std::ptrdiff_t stride);

/// Profiles at -kMaxHalf..kMaxHalf px across eight points of curves, and where their fits start.
struct ProfileBatch {
  std::array<Lanes, kProfileSize> value;
  Lanes half;       ///< samples within +-half px count; whole, 3..kMaxHalf
  Lanes amplitude;  ///< px
  Lanes width;      ///< px
};

struct ProfileFits {
  Lanes amplitude;
  Lanes offset;  ///< of the line's middle, px
  Lanes width;
  Lanes residual2;    ///< noise variance from the odd part of the residual
  Lanes offset_gain;  ///< variance of offset for unit residual variance
  IntLanes good;      ///< 0: the fit failed
};

/// Gauss-Newton for A f(o - x0, s) (1 + g (o - x0)) + c0 + c1 o within +-half px, f being the line
/// profile. s is held by a weak prior at `width`, the slope g of the light along the profile by one
/// at 0. c0 and c1 are eliminated: everything is taken without its part in 1 and o.
void fit_profiles(const ProfileBatch& batch, ProfileFits& fits);

/// Samples of eight profiles wherever they lie: a mosaic has a colour at one pixel of four.
struct SampledProfiles {
  std::array<Lanes, kProfileSize> value;   ///< means of what lies within half a px of -7..7 px
  std::array<Lanes, kProfileSize> offset;  ///< where these lie in the mean, px
  std::array<Lanes, kProfileSize> weight;  ///< samples in each, of those that a full image has
  Lanes scatter;  ///< sum of squares of the samples about these means, in that unit too
  Lanes samples;  ///< how many there are
  Lanes amplitude;
  Lanes width;
};

/// fit_profiles() of these. The residual is that of all samples, not of its odd part alone: there
/// may be none on the other side.
void fit_sampled_profiles(const SampledProfiles& profiles, ProfileFits& fits);

}  // namespace pencilscan
