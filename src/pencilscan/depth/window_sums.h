#pragma once

#include <cstddef>
#include <vector>

namespace pencilscan {

/// The pixels of a circular window, padded to a multiple of kLanes (lanes.h) with pixels that count
/// nothing, and the monomials of their place x = dx / half, y = dy / half.
struct WindowGrid {
  /// half: radius, px, in [2, 10].
  explicit WindowGrid(int half);

  static constexpr int kMonomials = 15;  ///< of degree 0 to 4: 1, x, y, xx, xy, yy, xxx, ... yyyy

  int half;
  int count = 0;       ///< pixels
  std::size_t padded;  ///< rounded up
  /// A row of pixels: the first one's index, and their places from the middle.
  struct Row {
    int first, dv, least_du, pixels;
  };
  std::vector<Row> rows;
  std::vector<float> monomials;  ///< kMonomials x padded
  std::vector<float> taper;      ///< weight: pixels far from the middle say less about it

  [[nodiscard]] const float* monomial(int k) const {
    return monomials.data() + static_cast<std::size_t>(k) * padded;
  }
};

/// A surface over a window: its tangent plane p0 + p1 x + p2 y in inverse depth, and the bow
/// b(x, y) = p3 xx + p4 xy + p5 yy that it rises over it, at its own foot on the plane. A rise
/// moves what is seen of the surface by `lean` per inverse depth, away from where its normal
/// points, so that its rise r at a pixel solves r = b((x, y) - r lean). It ends in an outline,
/// where that has no solution; b alone (lean 0) never does.
struct WindowSurface {
  float p[6];
  float lean[2];
};
/// Inverse depth of a surface at each pixel; beyond its outline, something near that of the
/// outline.
void surface_depths(const WindowGrid& grid, const WindowSurface& surface, float* w);

/// Lines of one pattern over a window: their coordinate (pattern_view.h), with dx and dy in halves
/// of the window, and their profile.
struct WindowLineShape {
  float n[4], d[4];
  float half_width;     ///< lines
  float inverse_reach;  ///< 1 / reach of the blur's bell, 1/lines
};

/// Profile P of the lines and its slope dP / dw at each pixel, w: inverse depth there.
void render_lines(const WindowGrid& grid, const WindowLineShape& lines, const float* w,
                  float* profile, float* slope);

/// The same lines blurred by a Gaussian instead: a box of half-width h, period 1 and deviation s is
///   P(l) = 2 h + sum_j 2 sin(2 pi j h) / (pi j) exp(-2 pi^2 j^2 s^2) cos(2 pi j l),
/// whose slopes in l and in s^2 are series of the same terms. `variance`: s^2, lines^2, more than
/// 0. Profile P, its slope dP / dw and dP / d(s^2) at each pixel. `inverse_reach` is not used.
void render_gaussian_lines(const WindowGrid& grid, const WindowLineShape& lines, float variance,
                           const float* w, float* profile, float* slope, float* widening);

/// The light of one family over a window as window_fit.h defines it.
struct FamilyLight {
  int patterns = 0;
  std::vector<const float*> profile, slope;  ///< per pattern, as rendered
  std::vector<float> amplitude;              ///< per pattern
  float offset = 0, ex = 0, ey = 0;
};

/// Columns of the Jacobian, weighted by the root of the pixels' weights: patterns' amplitudes,
/// offset, e_x, e_y, then the residual, then of what the others are made: depth and summed light.
struct FamilyColumns {
  std::vector<float> values;  ///< (patterns + 6) x padded
  [[nodiscard]] static int residual(int patterns) { return patterns + 3; }
  [[nodiscard]] static int depth(int patterns) { return patterns + 4; }
  [[nodiscard]] static int sum(int patterns) { return patterns + 5; }
};

/// `unit`: of inverse depth, in which the column of depth is.
void make_columns(const WindowGrid& grid, const FamilyLight& light, const float* image,
                  const float* root, float unit, FamilyColumns& columns);

/// The first of them alone, of light that is not known yet: patterns, offset, and the image in
/// place of the residual.
void make_light_columns(const WindowGrid& grid, const FamilyLight& light, const float* image,
                        const float* root, FamilyColumns& columns);

/// Products of columns with each other, J' J: both triangles. rows: a multiple of kLanes; result:
/// columns x columns.
void gram(const float* J, int rows, int columns, float* result);

/// Products of the columns of the surface's six unknowns, which are the column of depth times the
/// monomials up to degree 2, with each other and with all others: sums of few products of columns,
/// times monomials.
struct SurfaceSums {
  float of_depth[16];                ///< depth x depth, the monomials up to degree 4
  float of_slopes[16];               ///< depth x sum, the same: of e_x and e_y
  std::vector<float> of_amplitudes;  ///< patterns x 8: depth x column, the monomials up to degree 2
  float of_offset[8], of_residual[8];
};
void sum_surface(const WindowGrid& grid, int patterns, const FamilyColumns& columns,
                 SurfaceSums& sums);

/// Per pixel, over all families: light that a fit predicts and what the image shows of it, times
/// the weights over the variance of the noise; the same times the prediction once more, which makes
/// them squares over the variance.
struct LightSums {
  std::vector<float> shown, expected;
  std::vector<float> seen, predicted;  ///< times the prediction
};
/// Adds a family's light. `certainty`: 1 / variance of its noise.
void add_light(const WindowGrid& grid, const FamilyLight& light, const float* image,
               const float* weight, float certainty, LightSums& sums);

/// Sums of values over the pixels of each part; parts: `count` masks.
void sum_parts(const WindowGrid& grid, const float* values, const float* parts, int count,
               float* sums);

}  // namespace pencilscan
