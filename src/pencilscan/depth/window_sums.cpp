#include "pencilscan/depth/window_sums.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pencilscan/core/lanes.h"

namespace pencilscan {
namespace {

PENCILSCAN_INLINE void magnitude(const Lanes& x, Lanes& result) {
  result = reinterpret_cast<Lanes>(reinterpret_cast<const IntLanes&>(x) & 0x7FFFFFFF);
}

/// Integral of the triweight kernel from -1, u clamped, and the kernel itself up to 35 / 32.
PENCILSCAN_INLINE void bell(const Lanes& u, Lanes& integral, Lanes& kernel) {
  const Lanes u2 = u * u;
  integral = 0.5F + (35.F / 32) * u * (1.F + u2 * (-1.F + u2 * (0.6F - u2 * (1.F / 7))));
  const Lanes rest = 1.F - u2;
  kernel = rest * rest * rest;
}

/// The sums of the lanes of eight.
PENCILSCAN_INLINE void sum_each(const Lanes* of, Lanes& sums) {
  Lanes two[4], four[2];  // lanes that are sums of two, then of four
  for (int k = 0; k < 4; ++k) {
    const Lanes &a = of[2 * k], &b = of[2 * k + 1];
    two[k] = __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13) +
             __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
  }
  for (int k = 0; k < 2; ++k) {
    const Lanes &a = two[2 * k], &b = two[2 * k + 1];
    four[k] = __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13) +
              __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
  }
  sums = __builtin_shufflevector(four[0], four[1], 0, 1, 2, 3, 8, 9, 10, 11) +
         __builtin_shufflevector(four[0], four[1], 4, 5, 6, 7, 12, 13, 14, 15);
}

/// M columns by N: as many sums as are added up at once.
template <int M, int N>
PENCILSCAN_INLINE void gram_block(const float* J, int rows, int columns, int first, int second,
                                  float* result) {
  Lanes sums[kLanes] = {};
  for (int r = 0; r < rows; r += kLanes) {
    Lanes b[N];
    for (int n = 0; n < N; ++n) load(J + static_cast<std::ptrdiff_t>(second + n) * rows + r, b[n]);
    for (int m = 0; m < M; ++m) {
      Lanes a;
      load(J + static_cast<std::ptrdiff_t>(first + m) * rows + r, a);
      for (int n = 0; n < N; ++n) sums[m * N + n] += a * b[n];
    }
  }
  Lanes total;
  sum_each(sums, total);
  for (int m = 0; m < M; ++m) {
    for (int n = 0; n < N; ++n) {
      result[(first + m) * columns + second + n] = total[m * N + n];
      result[(second + n) * columns + first + m] = total[m * N + n];
    }
  }
}

template <int M>
PENCILSCAN_INLINE void gram_rows(const float* J, int rows, int columns, int first, float* result) {
  int second = first;
  for (; second + 2 <= columns; second += 2) {
    gram_block<M, 2>(J, rows, columns, first, second, result);
  }
  if (second < columns) gram_block<M, 1>(J, rows, columns, first, second, result);
}

/// Sums of a x b times the monomials from First to First + kCount - 1.
template <int kFirst, int kCount>
PENCILSCAN_INLINE void sum_monomials(const float* a, const float* b, const float* monomials,
                                     std::ptrdiff_t rows, float* sums) {
  Lanes lanes[16] = {};
  for (std::ptrdiff_t r = 0; r < rows; r += kLanes) {
    Lanes of_a, of_b;
    load(a + r, of_a);
    load(b + r, of_b);
    const Lanes product = of_a * of_b;
    for (int k = 0; k < kCount; ++k) {
      if (kFirst + k == 0) {
        lanes[k] += product;
        continue;
      }
      Lanes monomial;
      load(monomials + (kFirst + k) * rows + r, monomial);
      lanes[k] += product * monomial;
    }
  }
  for (int k = 0; k < kCount; k += kLanes) {
    Lanes total;
    sum_each(lanes + k, total);
    store(total, sums + k);
  }
}

/// Sums of a x b and of a x c times the monomials up to degree 2.
PENCILSCAN_INLINE void sum_two(const float* a, const float* b, const float* c,
                               const float* monomials, std::ptrdiff_t rows, float* sums_b,
                               float* sums_c) {
  Lanes of_b[kLanes] = {}, of_c[kLanes] = {};
  for (std::ptrdiff_t r = 0; r < rows; r += kLanes) {
    Lanes x, y, z;
    load(a + r, x);
    load(b + r, y);
    load(c + r, z);
    y *= x;
    z *= x;
    of_b[0] += y;
    of_c[0] += z;
    for (int k = 1; k < 6; ++k) {
      Lanes monomial;
      load(monomials + k * rows + r, monomial);
      of_b[k] += y * monomial;
      of_c[k] += z * monomial;
    }
  }
  Lanes total;
  sum_each(of_b, total);
  store(total, sums_b);
  sum_each(of_c, total);
  store(total, sums_c);
}

}  // namespace

WindowGrid::WindowGrid(int half_px) : half(half_px) {
  const double radius2 = (half + 0.5) * (half + 0.5);
  for (int dv = -half; dv <= half; ++dv) {
    const int reach = std::min(half, static_cast<int>(std::sqrt(radius2 - dv * dv)));
    rows.push_back({count, dv, -reach, 2 * reach + 1});
    count += 2 * reach + 1;
  }
  padded = static_cast<std::size_t>((count + kLanes - 1) / kLanes * kLanes);
  monomials.assign(kMonomials * padded, 0.F);
  taper.assign(padded, 0.F);
  for (const Row& row : rows) {
    for (int i = 0; i < row.pixels; ++i) {
      const auto at = static_cast<std::size_t>(row.first + i);
      const float x = static_cast<float>(row.least_du + i) / static_cast<float>(half);
      const float y = static_cast<float>(row.dv) / static_cast<float>(half);
      std::size_t k = 0;
      for (int degree = 0; degree <= 4; ++degree) {
        for (int of_y = 0; of_y <= degree; ++of_y, ++k) {
          float value = 1;
          for (int n = 0; n < degree; ++n) value *= n < degree - of_y ? x : y;
          monomials[k * padded + at] = value;
        }
      }
      taper[at] = std::max(0.F, 1.F - 0.5F * (x * x + y * y));
    }
  }
}

// With q = b(lean), c = the slope of b along lean and s = 1 + c, the rise is the root
// 2 b / (s + sqrt(s^2 - 4 q b)) of q r^2 - s r + b = 0 that is b where lean is zero.
PENCILSCAN_CLONES void surface_depths(const WindowGrid& grid, const WindowSurface& surface,
                                      float* w) {
  // The root is 1 in the middle and 0 at an outline, towards which slopes grow without bound.
  constexpr float kLeastRoot = 0.2F;
  const float* x = grid.monomial(1);
  const float* y = grid.monomial(2);
  const float* p = surface.p;
  const float* lean = surface.lean;
  const float turn_x = 2 * p[3] * lean[0] + p[4] * lean[1];
  const float turn_y = p[4] * lean[0] + 2 * p[5] * lean[1];
  const float along_lean = 0.5F * (turn_x * lean[0] + turn_y * lean[1]);
  for (std::size_t i = 0; i < grid.padded; i += kLanes) {
    Lanes px, py, root;
    load(x + i, px);
    load(y + i, py);
    const Lanes bow = p[3] * px * px + p[4] * px * py + p[5] * py * py;
    Lanes turn = 1.F + turn_x * px + turn_y * py;
    clamp(kLeastRoot, 1 / kLeastRoot, turn);
    Lanes square = turn * turn - 4 * along_lean * bow;
    clamp(kLeastRoot * kLeastRoot, 1 / (kLeastRoot * kLeastRoot), square);
    for (int k = 0; k < kLanes; ++k) root[k] = std::sqrt(square[k]);
    store(p[0] + p[1] * px + p[2] * py + 2 * bow / (turn + root), w + i);
  }
}

PENCILSCAN_CLONES void render_lines(const WindowGrid& grid, const WindowLineShape& lines,
                                    const float* w, float* profile, float* slope) {
  const float* x = grid.monomial(1);
  const float* y = grid.monomial(2);
  const float h = lines.half_width;
  const float r = lines.inverse_reach;
  // Where the bell reaches no farther than the middle between lines, they do not meet.
  const bool meet = (0.5F - h) * r < 1;
  for (std::size_t i = 0; i < grid.padded; i += kLanes) {
    Lanes px, py, pw;
    load(x + i, px);
    load(y + i, py);
    load(w + i, pw);
    const Lanes inverse = 1.F / (lines.d[0] + lines.d[1] * px + lines.d[2] * py + lines.d[3] * pw);
    const Lanes line = (lines.n[0] + lines.n[1] * px + lines.n[2] * py + lines.n[3] * pw) * inverse;
    // Distance to the nearest line; adding and subtracting 1.5 * 2^23 rounds a float.
    constexpr float kRound = 12582912.F;
    const Lanes a = line - ((line + kRound) - kRound);
    Lanes distance, u, integral, kernel, sum, density;
    magnitude(a, distance);
    u = (distance + h) * r;
    clamp(-1, 1, u);
    bell(u, sum, density);
    u = (distance - h) * r;
    clamp(-1, 1, u);
    bell(u, integral, kernel);
    sum -= integral;
    density -= kernel;
    if (meet) {  // the next line on the nearer side
      u = (1.F - distance - h) * r;
      clamp(-1, 1, u);
      bell(u, integral, kernel);
      sum += 1.F - integral;
      density += kernel;
    }
    store(sum, profile + i);
    density *= 35.F / 32 * r;
    density = a < 0 ? -density : density;
    store(density * (lines.n[3] - line * lines.d[3]) * inverse, slope + i);
  }
}

namespace {

/// Terms of the series of a blurred box: their heights, times 1, j and j^2.
struct BoxSeries {
  static constexpr int kMostTerms = 256;
  int terms = 0;
  float height[kMostTerms], of_slope[kMostTerms], of_widening[kMostTerms];

  BoxSeries(double half_width, double variance) {
    constexpr double kLeastHarmonic = 1e-3;  // of attenuation
    constexpr double kTurn = 2 * std::numbers::pi;
    const double rate = 0.5 * kTurn * kTurn;
    for (int j = 1; j <= kMostTerms; ++j) {
      const double attenuation = std::exp(-rate * j * j * variance);
      if (attenuation < kLeastHarmonic) break;
      const double h = 2 * std::sin(kTurn * j * half_width) / (std::numbers::pi * j) * attenuation;
      height[terms] = static_cast<float>(h);
      of_slope[terms] = static_cast<float>(-h * kTurn * j);
      of_widening[terms] = static_cast<float>(-h * rate * j * j);
      ++terms;
    }
  }
};

/// Sums of the series at each pixel.
PENCILSCAN_CLONES void sum_series(const WindowGrid& grid, const WindowLineShape& lines,
                                  const BoxSeries& series, const float* w, float* profile,
                                  float* slope, float* widening) {
  const float* x = grid.monomial(1);
  const float* y = grid.monomial(2);
  for (std::size_t i = 0; i < grid.padded; i += kLanes) {
    Lanes px, py, pw;
    load(x + i, px);
    load(y + i, py);
    load(w + i, pw);
    const Lanes inverse = 1.F / (lines.d[0] + lines.d[1] * px + lines.d[2] * py + lines.d[3] * pw);
    const Lanes line = (lines.n[0] + lines.n[1] * px + lines.n[2] * py + lines.n[3] * pw) * inverse;
    Lanes c1, s1, sum, per_line = {}, per_variance = {};
    cosine_and_sine(line, c1, s1);
    fill(2 * lines.half_width, sum);
    Lanes c = c1, s = s1;
    for (int j = 0; j < series.terms; ++j) {
      sum += series.height[j] * c;
      per_line += series.of_slope[j] * s;
      per_variance += series.of_widening[j] * c;
      const Lanes next = c * c1 - s * s1;
      s = s * c1 + c * s1;
      c = next;
    }
    store(sum, profile + i);
    store(per_line * (lines.n[3] - line * lines.d[3]) * inverse, slope + i);
    store(per_variance, widening + i);
  }
}

}  // namespace

void render_gaussian_lines(const WindowGrid& grid, const WindowLineShape& lines, float variance,
                           const float* w, float* profile, float* slope, float* widening) {
  const BoxSeries series(static_cast<double>(lines.half_width), static_cast<double>(variance));
  sum_series(grid, lines, series, w, profile, slope, widening);
}

PENCILSCAN_CLONES void make_columns(const WindowGrid& grid, const FamilyLight& light,
                                    const float* image, const float* root, float unit,
                                    FamilyColumns& columns) {
  const float* x = grid.monomial(1);
  const float* y = grid.monomial(2);
  const std::size_t rows = grid.padded;
  const auto patterns = static_cast<std::size_t>(light.patterns);
  float* of_pattern = columns.values.data();
  float* rest = of_pattern + patterns * rows;
  for (std::size_t i = 0; i < rows; i += kLanes) {
    Lanes px, py, pr, value;
    load(x + i, px);
    load(y + i, py);
    load(root + i, pr);
    const Lanes envelope = 1.F + light.ex * px + light.ey * py;
    const Lanes enveloped = pr * envelope;
    Lanes sum = {}, depth = {};
    for (std::size_t k = 0; k < patterns; ++k) {
      load(light.profile[k] + i, value);
      sum += light.amplitude[k] * value;
      store(enveloped * value, of_pattern + k * rows + i);
      load(light.slope[k] + i, value);
      depth += light.amplitude[k] * value;
    }
    load(image + i, value);
    const Lanes rooted = pr * sum;
    store(pr, rest + i);
    store(rooted * px, rest + rows + i);
    store(rooted * py, rest + 2 * rows + i);
    store(pr * (value - light.offset - envelope * sum), rest + 3 * rows + i);
    store(enveloped * unit * depth, rest + 4 * rows + i);
    store(rooted, rest + 5 * rows + i);
  }
}

PENCILSCAN_CLONES void make_light_columns(const WindowGrid& grid, const FamilyLight& light,
                                          const float* image, const float* root,
                                          FamilyColumns& columns) {
  const std::size_t rows = grid.padded;
  const auto patterns = static_cast<std::size_t>(light.patterns);
  float* of_pattern = columns.values.data();
  float* rest = of_pattern + patterns * rows;
  for (std::size_t i = 0; i < rows; i += kLanes) {
    Lanes pr, value;
    load(root + i, pr);
    for (std::size_t k = 0; k < patterns; ++k) {
      load(light.profile[k] + i, value);
      store(pr * value, of_pattern + k * rows + i);
    }
    load(image + i, value);
    store(pr, rest + i);
    store(pr * value, rest + rows + i);
  }
}

PENCILSCAN_CLONES void gram(const float* J, int rows, int columns, float* result) {
  int first = 0;
  for (; first + 4 <= columns; first += 4) gram_rows<4>(J, rows, columns, first, result);
  if (columns - first == 3) gram_rows<3>(J, rows, columns, first, result);
  if (columns - first == 2) gram_rows<2>(J, rows, columns, first, result);
  if (columns - first == 1) gram_rows<1>(J, rows, columns, first, result);
}

PENCILSCAN_CLONES void sum_surface(const WindowGrid& grid, int patterns,
                                   const FamilyColumns& columns, SurfaceSums& sums) {
  const auto rows = static_cast<std::ptrdiff_t>(grid.padded);
  const float* monomials = grid.monomials.data();
  const float* first = columns.values.data();
  const float* depth = first + FamilyColumns::depth(patterns) * rows;
  sum_monomials<0, 15>(depth, depth, monomials, rows, sums.of_depth);
  sum_monomials<1, 9>(depth, first + FamilyColumns::sum(patterns) * rows, monomials, rows,
                      sums.of_slopes);
  sum_two(depth, first + patterns * rows, first + FamilyColumns::residual(patterns) * rows,
          monomials, rows, sums.of_offset, sums.of_residual);
  float* of_amplitudes = sums.of_amplitudes.data();
  int k = 0;
  for (; k + 2 <= patterns; k += 2) {
    sum_two(depth, first + k * rows, first + (k + 1) * rows, monomials, rows, of_amplitudes + k * 8,
            of_amplitudes + (k + 1) * 8);
  }
  if (k < patterns)
    sum_monomials<0, 6>(depth, first + k * rows, monomials, rows, of_amplitudes + k * 8);
}

PENCILSCAN_CLONES void add_light(const WindowGrid& grid, const FamilyLight& light,
                                 const float* image, const float* weight, float certainty,
                                 LightSums& sums) {
  const float* x = grid.monomial(1);
  const float* y = grid.monomial(2);
  for (std::size_t i = 0; i < grid.padded; i += kLanes) {
    Lanes px, py, value, sum = {};
    load(x + i, px);
    load(y + i, py);
    for (std::size_t k = 0; k < static_cast<std::size_t>(light.patterns); ++k) {
      load(light.profile[k] + i, value);
      sum += light.amplitude[k] * value;
    }
    sum *= 1.F + light.ex * px + light.ey * py;
    load(weight + i, value);
    const Lanes certain = certainty * value;
    const Lanes weighted = certain * sum;
    load(image + i, value);
    value -= light.offset;
    Lanes total;
    load(sums.shown.data() + i, total);
    store(total + certain * value, sums.shown.data() + i);
    load(sums.expected.data() + i, total);
    store(total + certain * sum, sums.expected.data() + i);
    load(sums.seen.data() + i, total);
    store(total + weighted * value, sums.seen.data() + i);
    load(sums.predicted.data() + i, total);
    store(total + weighted * sum, sums.predicted.data() + i);
  }
}

PENCILSCAN_CLONES void sum_parts(const WindowGrid& grid, const float* values, const float* parts,
                                 int count, float* sums) {
  for (int first = 0; first < count; first += kLanes) {
    const int here = std::min(kLanes, count - first);
    Lanes lanes[kLanes] = {};
    for (std::size_t i = 0; i < grid.padded; i += kLanes) {
      Lanes value, mask;
      load(values + i, value);
      for (int k = 0; k < here; ++k) {
        load(parts + static_cast<std::size_t>(first + k) * grid.padded + i, mask);
        lanes[k] += value * mask;
      }
    }
    Lanes total;
    sum_each(lanes, total);
    for (int k = 0; k < here; ++k) sums[first + k] = total[k];
  }
}

}  // namespace pencilscan
