#pragma once

#include <cstring>

/// Eight numbers that are computed with at once, for the few loops that take most of the time.
/// They compile on any machine; PENCILSCAN_CLONES before a function adds a version of it for
/// processors with AVX2, chosen when the program starts. Both round alike (no fused
/// multiply-add), so that results are the same bytes on either.
///
/// A cloned function takes and gives plain arrays or Lanes by reference, and what it calls is
/// inlined: the machines' calling conventions for vectors differ.

// Sanitizers start too late for the choice; clang and other processors do without.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define PENCILSCAN_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define PENCILSCAN_CLONES
#endif
#define PENCILSCAN_INLINE __attribute__((always_inline)) inline

namespace pencilscan {

constexpr int kLanes = 8;

using Lanes __attribute__((vector_size(4 * kLanes))) = float;
using IntLanes __attribute__((vector_size(4 * kLanes))) = int;  ///< of comparisons: 0 or -1

PENCILSCAN_INLINE void load(const float* from, Lanes& lanes) {
  std::memcpy(&lanes, from, sizeof(lanes));
}

PENCILSCAN_INLINE void store(const Lanes& lanes, float* to) {
  std::memcpy(to, &lanes, sizeof(lanes));
}

/// The same number in all lanes.
PENCILSCAN_INLINE void fill(float value, Lanes& lanes) { lanes = value - Lanes{}; }

PENCILSCAN_INLINE void gather(const float* values, const IntLanes& at, Lanes& lanes) {
  const Lanes gathered = {values[at[0]], values[at[1]], values[at[2]], values[at[3]],
                          values[at[4]], values[at[5]], values[at[6]], values[at[7]]};
  lanes = gathered;
}

PENCILSCAN_INLINE void clamp(float low, float high, Lanes& x) {
  x = x < low ? x - x + low : x;
  x = x > high ? x - x + high : x;
}

PENCILSCAN_INLINE bool any(const IntLanes& mask) {
  int bits = 0;
  for (int k = 0; k < kLanes; ++k) bits |= mask[k];
  return bits != 0;
}

/// exp(x) to about 3e-6 of its value for |x| < 80; beyond, that of +-80.
PENCILSCAN_INLINE void exponential(const Lanes& x, Lanes& result) {
  // 2^y with y = n + f, |f| <= 1/2: n goes into the exponent, 2^f is its Taylor series.
  constexpr float kLog2E = 1.44269504F;
  constexpr float kLimit = 80 * kLog2E;
  constexpr float kRounder = 12582912;  // 1.5 * 2^23: adding it leaves no fraction
  Lanes y = x * kLog2E;
  y = y > kLimit ? y - y + kLimit : y;
  y = y < -kLimit ? y - y - kLimit : y;
  const Lanes shifted = y + kRounder;
  const Lanes f = y - (shifted - kRounder);
  Lanes p = f * 1.5403530e-4F + 1.3333558e-3F;
  p = p * f + 9.6181291e-3F;
  p = p * f + 5.5504109e-2F;
  p = p * f + 2.4022651e-1F;
  p = p * f + 6.9314718e-1F;
  p = p * f + 1.F;
  // The low bits of `shifted` count n; 127 is the exponent of 1, of 23 bits of mantissa.
  const IntLanes power = (reinterpret_cast<IntLanes>(shifted) << 23) + (127 << 23);
  result = p * reinterpret_cast<Lanes>(power);
}

/// Cosine and sine of x full turns, to about 3e-7, for |x| < 1e5 (less its rounding).
PENCILSCAN_INLINE void cosine_and_sine(const Lanes& x, Lanes& cosine, Lanes& sine) {
  constexpr float kRounder = 12582912;  // 1.5 * 2^23: adding it leaves no fraction
  // Taylor series of half the angle, which is within a quarter of a turn.
  const Lanes a = 3.14159265F * (x - ((x + kRounder) - kRounder));
  const Lanes a2 = a * a;
  Lanes s = a2 * -2.5052108e-8F + 2.7557319e-6F;
  s = s * a2 - 1.9841270e-4F;
  s = s * a2 + 8.3333333e-3F;
  s = s * a2 - 1.6666667e-1F;
  s = a + a * a2 * s;
  Lanes c = a2 * 2.0876757e-9F - 2.7557319e-7F;
  c = c * a2 + 2.4801587e-5F;
  c = c * a2 - 1.3888889e-3F;
  c = c * a2 + 4.1666667e-2F;
  c = c * a2 - 0.5F;
  c = 1.F + a2 * c;
  cosine = 1.F - 2.F * s * s;
  sine = 2.F * s * c;
}

}  // namespace pencilscan
