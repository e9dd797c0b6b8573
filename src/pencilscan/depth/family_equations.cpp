#include "pencilscan/depth/family_equations.h"

namespace pencilscan {

FamilyEquations::FamilyEquations(const WindowGrid& grid, std::size_t patterns) : grid_(&grid) {
  columns_.values.resize((patterns + 6) * grid.padded);
  surface_.of_amplitudes.resize(8 * patterns);
  gram_.resize((patterns + 4) * (patterns + 4));
}

void FamilyEquations::sum(const FamilyLight& light, const float* image, const float* root,
                          float unit) {
  make_columns(*grid_, light, image, root, unit, columns_);
  all_ = FamilyColumns::residual(light.patterns) + 1;
  gram(columns_.values.data(), static_cast<int>(grid_->padded), all_, gram_.data());
}

void FamilyEquations::sum_light(const FamilyLight& light, const float* image, const float* root) {
  make_light_columns(*grid_, light, image, root, columns_);
  all_ = light.patterns + 2;
  gram(columns_.values.data(), static_cast<int>(grid_->padded), all_, gram_.data());
}

void FamilyEquations::add(const FamilyLight& light, double certainty, std::size_t family,
                          WindowEquations& equations) {
  const int patterns = light.patterns;
  const int residual = FamilyColumns::residual(patterns);
  sum_surface(*grid_, patterns, columns_, surface_);
  // Of the products of two of the monomials 1, x, y, xx, xy, yy: their place among all.
  constexpr int kProduct[6][6] = {{0, 1, 2, 3, 4, 5},    {1, 3, 4, 6, 7, 8},
                                  {2, 4, 5, 7, 8, 9},    {3, 6, 7, 10, 11, 12},
                                  {4, 7, 8, 11, 12, 13}, {5, 8, 9, 12, 13, 14}};
  WindowEquations::Family& of_light = equations.family(family);
  WindowEquations::resize(patterns + 3, of_light);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j)
      equations.surface[i][j] += certainty * static_cast<double>(surface_.of_depth[kProduct[i][j]]);
    equations.surface[i][6] += certainty * static_cast<double>(surface_.of_residual[i]);
  }
  for (int i = 0; i < patterns + 3; ++i) {
    for (int j = 0; j <= i; ++j) of_light.a(i, j) = certainty * product(i, j);
    WindowEquations::Row& row = of_light.B[static_cast<std::size_t>(i)];
    row = WindowEquations::Row{};
    for (int c = 0; c < 6; ++c) {
      // e_x and e_y: the products with x and y times the summed light.
      const float value = i < patterns ? surface_.of_amplitudes[static_cast<std::size_t>(i * 8 + c)]
                          : i == patterns ? surface_.of_offset[c]
                                          : surface_.of_slopes[kProduct[i - patterns][c] - 1];
      row[c] = certainty * static_cast<double>(value);
    }
    row[6] = certainty * product(i, residual);
  }
  for (int i = patterns + 1; i < patterns + 3; ++i) {
    const float e = i == patterns + 1 ? light.ex : light.ey;
    of_light.a(i, i) += kTiltPrecision;
    of_light.B[static_cast<std::size_t>(i)][6] -= kTiltPrecision * static_cast<double>(e);
  }
}

}  // namespace pencilscan
