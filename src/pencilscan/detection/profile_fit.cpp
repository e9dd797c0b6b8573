#include "pencilscan/detection/profile_fit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace pencilscan {
namespace {

constexpr float kWidthPrior = 0.2F;  ///< weight of the width's prior, in profile samples
constexpr float kTiltPrior = 1.0F;   ///< weight of the prior of even light along the profile
constexpr float kEdge = 0.5F;        ///< px: pixel, lens and projector blur together
constexpr float kBluntest = 0.5F;    ///< edge, of the width: beyond, no box is left
constexpr float kPi2 = 9.8696F;

constexpr int kMaxIterations = 8;  ///< most fits need two, those of dense lines all
constexpr float kSmallMove = 0.01F;
constexpr float kSmallWidening = 0.05F;
constexpr float kMinHeight = 1e-5F;
constexpr float kMaxOffset = 1.6F;

PENCILSCAN_INLINE void select(const IntLanes& mask, const Lanes& value, Lanes& result) {
  result = mask ? value : result;
}

/// Line profile of one width, or of eight.
template <class Value>
struct LineShape {
  Value rate;   ///< 1 / edge
  Value half;   ///< px
  Value tail;   ///< exp(-half / edge)
  Value scale;  ///< makes the height 1
};

PENCILSCAN_INLINE void make_shape(const Lanes& width, LineShape<Lanes>& shape, IntLanes& is_blunt) {
  Lanes edge = width * kBluntest;
  is_blunt = edge < kEdge;
  edge = is_blunt ? edge : edge - edge + kEdge;
  const Lanes square = 3 * width * width - kPi2 * edge * edge;
  for (int k = 0; k < kLanes; ++k) shape.half[k] = std::sqrt(square[k]);
  shape.rate = 1 / edge;
  exponential(-shape.rate * shape.half, shape.tail);
  shape.scale = (1 + shape.tail) / (1 - shape.tail);
}

LineShape<float> make_shape(float width) {
  const float edge = std::min(kEdge, kBluntest * width);
  const float half = std::sqrt(3 * width * width - kPi2 * edge * edge);
  const float tail = std::exp(-half / edge);
  return {1 / edge, half, tail, (1 + tail) / (1 - tail)};
}

/// The two steps of the profile at d, given e = exp(-rate d): 1 / (1 + tail e) and
/// tail / (tail + e), written so that nothing overflows within reach.
template <class Value>
PENCILSCAN_INLINE void steps_at(const LineShape<Value>& shape, const Lanes& e, Lanes& rising,
                                Lanes& falling) {
  const Lanes one_plus = 1 + shape.tail * e;
  const Lanes tail_plus = shape.tail + e;
  const Lanes inverse = 1 / (one_plus * tail_plus);
  rising = tail_plus * inverse;
  falling = shape.tail * one_plus * inverse;
}

/// Height of the profile at d.
PENCILSCAN_INLINE void height_at(const LineShape<float>& shape, const Lanes& d, Lanes& height) {
  Lanes e;
  exponential(-shape.rate * d, e);
  Lanes rising;
  Lanes falling;
  steps_at(shape, e, rising, falling);
  height = shape.scale * (rising - falling);
}

/// The profile of one width, and how it changes with the width.
struct ShapeAndSlopes {
  LineShape<Lanes> shape;
  IntLanes is_blunt;
  Lanes half_per_width;
  Lanes scale_change;  ///< d scale / d half, relative
  Lanes inverse_width;
};

PENCILSCAN_INLINE void make_slopes(const Lanes& width, ShapeAndSlopes& s) {
  make_shape(width, s.shape, s.is_blunt);
  const LineShape<Lanes>& shape = s.shape;
  s.half_per_width = 3 * width / shape.half;
  s.scale_change = -2 * shape.rate * shape.tail / ((1 - shape.tail) * (1 + shape.tail));
  s.inverse_width = 1 / width;
}

/// Height of the profile at d, and its derivatives, given e = exp(-rate d).
PENCILSCAN_INLINE void slopes_at(const ShapeAndSlopes& s, const Lanes& d, const Lanes& e, Lanes& f,
                                 Lanes& f_d, Lanes& f_width) {
  Lanes rising;
  Lanes falling;
  steps_at(s.shape, e, rising, falling);
  f = s.shape.scale * (rising - falling);
  const Lanes steep = s.shape.scale * s.shape.rate;
  const Lanes rise = steep * rising * (1 - rising);
  const Lanes fall = steep * falling * (1 - falling);
  f_d = rise - fall;
  // A blunt profile is stretched, the others become wider between the same edges.
  f_width = s.is_blunt ? -d * s.inverse_width * f_d
                       : (rise + fall + s.scale_change * f) * s.half_per_width;
}

struct Parameters {
  Lanes height;
  Lanes center;
  Lanes width;
  Lanes tilt;
};

/// Order of the unknowns: the centre last, so that elimination ends with its variance.
constexpr int kProfileUnknowns = 4;
enum Unknown { kHeight, kWidth, kTilt, kCenter };

/// Normal equations of one step, for unknowns divided by the height: pure numbers whatever the
/// amplitude. Upper triangle.
struct NormalEquations {
  std::array<std::array<Lanes, kProfileUnknowns>, kProfileUnknowns> matrix;
  std::array<Lanes, kProfileUnknowns> right;
};

/// Solves in place by Cholesky's decomposition without roots; `right` becomes the solution.
PENCILSCAN_INLINE void solve(NormalEquations& n, Lanes& center_variance) {
  auto& [m, x] = n;
  for (std::size_t i = 0; i < kProfileUnknowns; ++i) {
    const Lanes inverse = 1 / m[i][i];
    for (std::size_t j = i + 1; j < kProfileUnknowns; ++j) {
      const Lanes factor = m[i][j] * inverse;
      for (std::size_t k = j; k < kProfileUnknowns; ++k) m[j][k] -= factor * m[i][k];
      x[j] -= factor * x[i];
    }
    m[i][i] = inverse;
  }
  center_variance = m[kCenter][kCenter];
  for (std::size_t i = kProfileUnknowns; i-- > 0;) {
    for (std::size_t j = i + 1; j < kProfileUnknowns; ++j) x[i] -= m[i][j] * x[j];
    x[i] *= m[i][i];
  }
}

/// Samples that count, and what takes a background of level and slope away from a profile.
struct Background {
  std::array<Lanes, kProfileSize> inside;  ///< 1 or 0
  Lanes inverse_count;
  Lanes inverse_moment;  ///< 1 / sum of offset^2

  PENCILSCAN_INLINE explicit Background(const Lanes& half) {
    Lanes count{};
    Lanes moment{};
    for (int i = 0; i < kProfileSize; ++i) {
      const auto o = static_cast<float>(i - kMaxHalf);
      const Lanes zero{};
      Lanes& w = inside[static_cast<std::size_t>(i)];
      w = half >= std::abs(o) ? zero + 1 : zero;
      count += w;
      moment += w * (o * o);
    }
    inverse_count = 1 / count;
    inverse_moment = 1 / moment;
  }

  PENCILSCAN_INLINE void remove_from(std::array<Lanes, kProfileSize>& profile) const {
    Lanes sum{};
    Lanes slope{};
    for (int i = 0; i < kProfileSize; ++i) {
      const auto at = static_cast<std::size_t>(i);
      profile[at] *= inside[at];
      sum += profile[at];
      slope += profile[at] * static_cast<float>(i - kMaxHalf);
    }
    sum *= inverse_count;
    slope *= inverse_moment;
    for (int i = 0; i < kProfileSize; ++i) {
      const auto at = static_cast<std::size_t>(i);
      profile[at] -= inside[at] * (sum + slope * static_cast<float>(i - kMaxHalf));
    }
  }
};

/// Sets up one step; `model` becomes the line of height 1 under its light, with background.
PENCILSCAN_INLINE void linearize(const std::array<Lanes, kProfileSize>& measured,
                                 const Background& background, const Parameters& at,
                                 std::array<Lanes, kProfileSize>& model, Lanes& model_slope,
                                 NormalEquations& n) {
  ShapeAndSlopes shape;
  make_slopes(at.width, shape);
  // exp(-rate (o - center)) from one offset to the next is a product.
  Lanes e;
  Lanes ratio;
  exponential(shape.shape.rate * (at.center + static_cast<float>(kMaxHalf)), e);
  exponential(-shape.shape.rate, ratio);
  std::array<Lanes, kProfileUnknowns> sum{};
  std::array<Lanes, kProfileUnknowns> slope{};
  n = {};
  for (int i = 0; i < kProfileSize; ++i) {
    const auto s = static_cast<std::size_t>(i);
    const auto o = static_cast<float>(i - kMaxHalf);
    const Lanes d = o - at.center;
    Lanes f;
    Lanes f_d;
    Lanes f_width;
    slopes_at(shape, d, e, f, f_d, f_width);
    e *= ratio;
    const Lanes light = (1 + at.tilt * d) * background.inside[s];
    std::array<Lanes, kProfileUnknowns> J;
    J[kHeight] = light * f;
    J[kWidth] = light * f_width;
    J[kTilt] = background.inside[s] * d * f;
    J[kCenter] = -light * f_d;
    model[s] = J[kHeight];
    for (std::size_t j = 0; j < kProfileUnknowns; ++j) {
      sum[j] += J[j];
      slope[j] += J[j] * o;
      n.right[j] += J[j] * measured[s];
      for (std::size_t k = j; k < kProfileUnknowns; ++k) n.matrix[j][k] += J[j] * J[k];
    }
  }
  model_slope = slope[kHeight] * background.inverse_moment;
  for (std::size_t j = 0; j < kProfileUnknowns; ++j) {
    const Lanes mean = sum[j] * background.inverse_count;
    const Lanes lean = slope[j] * background.inverse_moment;
    for (std::size_t k = j; k < kProfileUnknowns; ++k)
      n.matrix[j][k] -= mean * sum[k] + lean * slope[k];
  }
  for (std::size_t j = 0; j < kProfileUnknowns; ++j) n.right[j] -= at.height * n.matrix[0][j];
}

/// Only the odd part of the residual can move the line; the even part holds the misfit of the
/// profile, which is no noise. Two of the parameters (offset, slope) are odd.
PENCILSCAN_INLINE void odd_variance(const std::array<Lanes, kProfileSize>& measured,
                                    const std::array<Lanes, kProfileSize>& model,
                                    const Lanes& model_slope, const Background& background,
                                    const Lanes& height, const Lanes& half, Lanes& variance) {
  Lanes sum{};
  for (int o = 1; o <= kMaxHalf; ++o) {
    const auto right = static_cast<std::size_t>(kMaxHalf + o);
    const auto left = static_cast<std::size_t>(kMaxHalf - o);
    const Lanes line = model[right] - model[left] - static_cast<float>(2 * o) * model_slope;
    const Lanes odd = measured[right] - measured[left] - height * line;
    sum += background.inside[right] * odd * odd;
  }
  variance = 0.5F * sum / (half - 2);
}

/// A step of Gauss-Newton, where the fit is open, in units of the height except for the height's
/// own; ends fits that hardly move, or that find no line.
PENCILSCAN_INLINE void take_step(const std::array<Lanes, kProfileUnknowns>& step, Parameters& now,
                                 IntLanes& is_open, ProfileFits& fits) {
  Lanes moved = step[kCenter] / now.height;
  Lanes widened = step[kWidth] / now.height;
  clamp(-0.7F, 0.7F, moved);
  clamp(-0.5F, 0.5F, widened);
  Parameters next = now;
  next.tilt += step[kTilt] / now.height;
  clamp(-0.15F, 0.15F, next.tilt);
  next.height += step[kHeight];
  next.center += moved;
  next.width += widened;
  clamp(kMinLineWidth, kMaxLineWidth, next.width);
  select(is_open, next.height, now.height);
  select(is_open, next.center, now.center);
  select(is_open, next.width, now.width);
  select(is_open, next.tilt, now.tilt);
  // NaN fails too.
  fits.good &= now.height > kMinHeight;
  const IntLanes is_small = (moved * moved < kSmallMove * kSmallMove) &
                            (widened * widened < kSmallWidening * kSmallWidening);
  is_open &= ~is_small & fits.good;
}

PENCILSCAN_INLINE void end_fits(const Parameters& now, ProfileFits& fits) {
  fits.amplitude = now.height;
  fits.offset = now.center;
  fits.width = now.width;
  fits.good &= (now.center * now.center < kMaxOffset * kMaxOffset) & (fits.offset_gain > 0) &
               (fits.offset_gain < 1e30F);
}

/// Pixels that stand for one in the profile of a line of `width`: 1, or as many as the width is of
/// kMaxLineWidth, rounded up to a power of two. Wider lines are narrow ones of a smaller image.
float profile_scale(float width) {
  float scale = 1;
  while (width > kMaxLineWidth * scale) scale *= 2;
  return scale;
}

}  // namespace

float line_profile_width(float line_px) {
  const float half = 0.5F * line_px;
  return std::max(std::sqrt((half * half + kPi2 * kEdge * kEdge) / 3), kMinLineWidth);
}

PENCILSCAN_CLONES
void line_profile(float width, std::array<float, 2 * kLanes>& values) {
  const LineShape<float> shape = make_shape(width);
  const float reach2 = (kModelReach * width) * (kModelReach * width);
  Lanes d;
  for (int k = 0; k < kLanes; ++k) d[k] = static_cast<float>(k - kMaxHalf);
  for (std::size_t block = 0; block < 2; ++block, d += static_cast<float>(kLanes)) {
    Lanes height;
    height_at(shape, d, height);
    store(d * d <= reach2 ? height : height - height, values.data() + block * kLanes);
  }
}

PENCILSCAN_CLONES
void add_line_profile(float amplitude, float width, float first, float step, int count,
                      float* image, std::ptrdiff_t stride) {
  const float shrink = 1 / profile_scale(width);
  const LineShape<float> shape = make_shape(shrink * width);
  first *= shrink;
  step *= shrink;
  Lanes d;
  for (int k = 0; k < kLanes; ++k) d[k] = first + step * static_cast<float>(k);
  for (int i = 0; i < count; i += kLanes, d += step * static_cast<float>(kLanes)) {
    Lanes height;
    height_at(shape, d, height);
    height *= amplitude;
    if (stride == 1 && i + kLanes <= count) {
      Lanes sum;
      load(image + i, sum);
      store(sum + height, image + i);
    } else {
      for (int k = 0; k < std::min(kLanes, count - i); ++k) image[(i + k) * stride] += height[k];
    }
  }
}

PENCILSCAN_CLONES
void fit_profiles(const ProfileBatch& batch, ProfileFits& fits) {
  const Lanes zero{};
  const Background background(batch.half);
  std::array<Lanes, kProfileSize> measured = batch.value;
  background.remove_from(measured);
  Parameters now{batch.amplitude, zero, batch.width, zero};
  now.height = now.height > 1e-4F ? now.height : zero + 1e-4F;
  IntLanes is_open = zero == zero;
  fits = ProfileFits();
  fits.good = is_open;
  std::array<Lanes, kProfileSize> model;
  for (int iteration = 0; iteration < kMaxIterations && any(is_open); ++iteration) {
    NormalEquations n;
    Lanes model_slope;
    linearize(measured, background, now, model, model_slope, n);
    n.matrix[kWidth][kWidth] += kWidthPrior;
    n.right[kWidth] += kWidthPrior * now.height * (batch.width - now.width);
    n.matrix[kTilt][kTilt] += kTiltPrior;
    n.right[kTilt] -= kTiltPrior * now.height * now.tilt;
    Lanes center_variance;
    solve(n, center_variance);
    Lanes variance;
    odd_variance(measured, model, model_slope, background, now.height, batch.half, variance);
    select(is_open, variance, fits.residual2);
    select(is_open, center_variance / (now.height * now.height), fits.offset_gain);
    take_step(n.right, now, is_open, fits);
  }
  end_fits(now, fits);
}

PENCILSCAN_CLONES
void fit_sampled_profiles(const SampledProfiles& profiles, ProfileFits& fits) {
  constexpr std::size_t kAll = kProfileUnknowns + 2;  // background first, the centre last
  constexpr float kLeast = 1e-6F;                     // of the background, where no sample tells it
  const Lanes zero{};
  Parameters now{profiles.amplitude, zero, profiles.width, zero};
  now.height = now.height > 1e-4F ? now.height : zero + 1e-4F;
  IntLanes is_open = zero == zero;
  fits = ProfileFits();
  fits.good = is_open;
  for (int iteration = 0; iteration < kMaxIterations && any(is_open); ++iteration) {
    ShapeAndSlopes shape;
    make_slopes(now.width, shape);
    std::array<std::array<Lanes, kAll>, kAll> m{};
    std::array<Lanes, kAll> x{};
    Lanes square = profiles.scatter;
    for (std::size_t s = 0; s < kProfileSize; ++s) {
      const Lanes& o = profiles.offset[s];
      const Lanes& w = profiles.weight[s];
      const Lanes d = o - now.center;
      Lanes e;
      exponential(-shape.shape.rate * d, e);
      Lanes f;
      Lanes f_d;
      Lanes f_width;
      slopes_at(shape, d, e, f, f_d, f_width);
      const Lanes light = 1 + now.tilt * d;
      const std::array<Lanes, kAll> J = {zero + 1,        o,     light * f,
                                         light * f_width, d * f, -light * f_d};
      const Lanes left = profiles.value[s] - now.height * J[2];
      square += w * left * left;
      for (std::size_t j = 0; j < kAll; ++j) {
        x[j] += w * J[j] * left;
        for (std::size_t k = j; k < kAll; ++k) m[j][k] += w * J[j] * J[k];
      }
    }
    m[2 + kWidth][2 + kWidth] += kWidthPrior;
    x[2 + kWidth] += kWidthPrior * now.height * (profiles.width - now.width);
    m[2 + kTilt][2 + kTilt] += kTiltPrior;
    x[2 + kTilt] -= kTiltPrior * now.height * now.tilt;
    m[0][0] += kLeast;
    m[1][1] += kLeast;
    for (std::size_t i = 0; i < kAll; ++i) {
      const Lanes inverse = 1 / m[i][i];
      // What this unknown explains of what is left.
      square -= x[i] * x[i] * inverse;
      for (std::size_t j = i + 1; j < kAll; ++j) {
        const Lanes factor = m[i][j] * inverse;
        for (std::size_t k = j; k < kAll; ++k) m[j][k] -= factor * m[i][k];
        x[j] -= factor * x[i];
      }
      m[i][i] = inverse;
    }
    const Lanes center_variance = m[kAll - 1][kAll - 1];
    for (std::size_t i = kAll; i-- > 0;) {
      for (std::size_t j = i + 1; j < kAll; ++j) x[i] -= m[i][j] * x[j];
      x[i] *= m[i][i];
    }
    const Lanes freedom = profiles.samples - static_cast<float>(kAll);
    select(is_open, (square > 0 ? square : zero) / (freedom > 1 ? freedom : zero + 1),
           fits.residual2);
    select(is_open, center_variance / (now.height * now.height), fits.offset_gain);
    const std::array<Lanes, kProfileUnknowns> step = {x[2], x[3], x[4], x[5]};
    take_step(step, now, is_open, fits);
  }
  end_fits(now, fits);
  fits.good &= profiles.samples > static_cast<float>(kAll);
}

}  // namespace pencilscan
