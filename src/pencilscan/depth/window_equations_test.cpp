// Elimination family by family against a dense solution of all equations at once, and the sums they
// are made of against loops in double.
#include "pencilscan/depth/window_equations.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <vector>

#include "pencilscan/core/random.h"
#include "pencilscan/depth/family_equations.h"
#include "pencilscan/depth/window_sums.h"

namespace pencilscan {
namespace {

TEST(WindowEquations, EliminationGivesWhatADenseSolutionGives) {
  Random random(12);
  constexpr std::array<int, 3> kUnknowns = {5, 0, 4};
  constexpr int kAll = 6 + 5 + 4;
  constexpr double kRidge = 1e-3;
  Eigen::MatrixXd J(40, kAll);
  Eigen::VectorXd r(40);
  for (Eigen::Index i = 0; i < J.rows(); ++i) {
    r[i] = random.normal(0, 1);
    for (int c = 0; c < kAll; ++c) {
      // A row is of one family.
      const bool is_other = c >= 6 && (c < 11) == (i < 20);
      J(i, c) = is_other ? 0 : random.normal(0, 1);
    }
  }
  Eigen::MatrixXd H = J.transpose() * J;
  const Eigen::VectorXd g = J.transpose() * r;
  WindowEquations equations;
  equations.reset(kUnknowns.size());
  int first = 6;
  for (std::size_t f = 0; f < kUnknowns.size(); ++f) {
    WindowEquations::Family& family = equations.family(f);
    WindowEquations::resize(kUnknowns[f], family);
    for (int i = 0; i < kUnknowns[f]; ++i) {
      for (int j = 0; j <= i; ++j) family.a(i, j) = H(first + i, first + j);
      WindowEquations::Row& row = family.B[static_cast<std::size_t>(i)];
      row = WindowEquations::Row{};
      for (int c = 0; c < 6; ++c) row[c] = H(first + i, c);
      row[6] = g[first + i];
    }
    first += kUnknowns[f];
  }
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) equations.surface[i][j] = H(i, j);
    equations.surface[i][6] = g[i];
  }
  H.diagonal() *= 1 + kRidge;
  const Eigen::MatrixXd inverse = H.inverse();
  const Eigen::VectorXd x = inverse * g;
  ASSERT_TRUE(equations.eliminate(kRidge));
  constexpr double kTolerance = 1e-9;
  const WindowEquations::Surface s = equations.solve_surface();
  for (int c = 0; c < 6; ++c) EXPECT_NEAR(s[c], x[c], kTolerance) << c;
  EXPECT_NEAR(equations.surface_variance(), inverse(0, 0), kTolerance);
  first = 6;
  std::vector<double> light;
  for (std::size_t f = 0; f < kUnknowns.size(); ++f) {
    equations.solve_light(f, s, light);
    for (int k = 0; k < kUnknowns[f]; ++k, ++first) {
      EXPECT_NEAR(light[static_cast<std::size_t>(k)], x[first], kTolerance) << f << " " << k;
      EXPECT_NEAR(equations.light_variance(f, k), inverse(first, first), kTolerance);
    }
  }
}

TEST(WindowEquations, WhatIsNotPositiveHasNoSolution) {
  WindowEquations equations;
  equations.reset(1);
  WindowEquations::resize(1, equations.family(0));
  equations.family(0).a(0, 0) = 0;
  equations.family(0).B[0] = WindowEquations::Row{};
  for (int i = 0; i < 6; ++i) equations.surface[i][i] = 1;
  EXPECT_FALSE(equations.eliminate(0));
}

// Columns and their sums for one, two and three patterns: pairs of columns and single ones.
TEST(WindowSums, AreThoseOfLoopsInDouble) {
  Random random(13);
  for (const int half : {2, 5, 6}) {
    const WindowGrid grid(half);
    for (std::size_t patterns = 1; patterns <= 3; ++patterns) {
      const auto values = [&](double low, double high) {
        std::vector<float> result(grid.padded);
        for (float& v : result) v = static_cast<float>(random.uniform(low, high));
        return result;
      };
      std::vector<std::vector<float>> profile, slope;
      FamilyLight light;
      light.patterns = static_cast<int>(patterns);
      light.offset = 0.1F;
      light.ex = 0.2F;
      light.ey = -0.3F;
      for (std::size_t k = 0; k < patterns; ++k) {
        profile.push_back(values(0, 1));
        slope.push_back(values(-1, 1));
        light.amplitude.push_back(static_cast<float>(random.uniform(0.2, 1)));
      }
      for (std::size_t k = 0; k < patterns; ++k) {
        light.profile.push_back(profile[k].data());
        light.slope.push_back(slope[k].data());
      }
      const std::vector<float> image = values(0, 1);
      std::vector<float> root = values(0.1, 1);
      for (auto i = static_cast<std::size_t>(grid.count); i < grid.padded; ++i) root[i] = 0;
      FamilyColumns columns;
      columns.values.resize((patterns + 6) * grid.padded);
      constexpr float kUnit = 0.7F;
      make_columns(grid, light, image.data(), root.data(), kUnit, columns);
      const auto all = patterns + 4;
      std::vector<float> products(all * all);
      gram(columns.values.data(), static_cast<int>(grid.padded), static_cast<int>(all),
           products.data());
      SurfaceSums sums;
      sums.of_amplitudes.resize(8 * patterns);
      sum_surface(grid, static_cast<int>(patterns), columns, sums);

      // The rows of the Jacobian: amplitudes, offset, e_x, e_y, residual; then the surface's six.
      Eigen::MatrixXd J(grid.count, static_cast<Eigen::Index>(all + 6));
      for (int i = 0; i < grid.count; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const double x = grid.monomial(1)[at], y = grid.monomial(2)[at], w = root[at];
        const double envelope = 1 + light.ex * x + light.ey * y;
        double sum = 0, depth = 0;
        for (std::size_t k = 0; k < patterns; ++k) {
          sum += static_cast<double>(light.amplitude[k] * profile[k][at]);
          depth += static_cast<double>(light.amplitude[k] * slope[k][at]);
          J(i, static_cast<Eigen::Index>(k)) = w * envelope * static_cast<double>(profile[k][at]);
        }
        const auto n = static_cast<Eigen::Index>(patterns);
        J(i, n) = w;
        J(i, n + 1) = w * x * sum;
        J(i, n + 2) = w * y * sum;
        J(i, n + 3) = w * (static_cast<double>(image[at]) - light.offset - envelope * sum);
        const double monomial[6] = {1, x, y, x * x, x * y, y * y};
        for (int c = 0; c < 6; ++c) J(i, n + 4 + c) = w * envelope * kUnit * depth * monomial[c];
      }
      const Eigen::MatrixXd H = J.transpose() * J;
      const double tolerance = 1e-5 * H.diagonal().maxCoeff();  // sums of single precision
      const auto n = static_cast<Eigen::Index>(patterns);
      for (std::size_t i = 0; i < all; ++i) {
        for (std::size_t j = 0; j < all; ++j)
          EXPECT_NEAR(products[i * all + j],
                      H(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)), tolerance);
      }
      for (int c = 0; c < 6; ++c) {
        const Eigen::Index surface = n + 4 + c;
        EXPECT_NEAR(sums.of_depth[c], H(n + 4, surface), tolerance);
        EXPECT_NEAR(sums.of_offset[c], H(n, surface), tolerance);
        EXPECT_NEAR(sums.of_residual[c], H(n + 3, surface), tolerance);
        for (Eigen::Index k = 0; k < n; ++k)
          EXPECT_NEAR(sums.of_amplitudes[static_cast<std::size_t>(8 * k + c)], H(k, surface),
                      tolerance);
      }
      // x, y of degree 1; the highest degrees: xx * xx, yy * yy, and of the slopes xxx, yyy.
      EXPECT_NEAR(sums.of_depth[10], H(n + 7, n + 7), tolerance);
      EXPECT_NEAR(sums.of_depth[13], H(n + 8, n + 9), tolerance);
      EXPECT_NEAR(sums.of_depth[14], H(n + 9, n + 9), tolerance);
      EXPECT_NEAR(sums.of_slopes[0], H(n + 1, n + 4), tolerance);
      EXPECT_NEAR(sums.of_slopes[1], H(n + 2, n + 4), tolerance);
      EXPECT_NEAR(sums.of_slopes[5], H(n + 1, n + 7), tolerance);
      EXPECT_NEAR(sums.of_slopes[8], H(n + 2, n + 9), tolerance);
    }
  }
}

// The series against the integral of a Gaussian over the boxes, and its slopes against differences.
TEST(WindowSums, GaussianLinesAreBoxesUnderAGaussian) {
  const WindowGrid grid(5);
  const WindowLineShape lines{{0.3F, 0.9F, 0.4F, 0.7F}, {1, 0.02F, -0.01F, 0.03F}, 0.18F, 0};
  std::vector<float> w(grid.padded);
  for (std::size_t i = 0; i < w.size(); ++i) w[i] = 1 + 0.1F * grid.monomial(1)[i];
  const auto coordinate = [&](std::size_t i, double at_w) {
    const double x = grid.monomial(1)[i], y = grid.monomial(2)[i];
    return (lines.n[0] + lines.n[1] * x + lines.n[2] * y + lines.n[3] * at_w) /
           (lines.d[0] + lines.d[1] * x + lines.d[2] * y + lines.d[3] * at_w);
  };
  const auto profile_of = [&](double line, double variance) {
    const double s = std::sqrt(2 * variance);
    double sum = 0;
    for (int n = -4; n <= 4; ++n) {
      const double o = line - std::round(line) - n;
      sum += 0.5 * (std::erf((o + lines.half_width) / s) - std::erf((o - lines.half_width) / s));
    }
    return sum;
  };
  for (const double variance : {0.001, 0.01, 0.1}) {
    std::vector<float> profile(grid.padded), slope(grid.padded), widening(grid.padded);
    render_gaussian_lines(grid, lines, static_cast<float>(variance), w.data(), profile.data(),
                          slope.data(), widening.data());
    for (std::size_t i = 0; i < static_cast<std::size_t>(grid.count); ++i) {
      const double at = w[i], l = coordinate(i, at), step = 1e-3 * variance, dw = 1e-4;
      EXPECT_NEAR(profile[i], profile_of(l, variance), 2e-4);
      const double per_w = (profile_of(coordinate(i, at + dw), variance) -
                            profile_of(coordinate(i, at - dw), variance)) /
                           (2 * dw);
      EXPECT_NEAR(slope[i], per_w, 5e-3 / std::sqrt(variance));
      const double per_variance =
          (profile_of(l, variance + step) - profile_of(l, variance - step)) / (2 * step);
      EXPECT_NEAR(widening[i], per_variance, 5e-3 / variance);
    }
  }
}

// Of light that is not known yet, some of all columns are enough, and their sums the same bytes.
TEST(FamilyEquations, LightAloneHasTheSameProducts) {
  constexpr int kPatterns = 2;
  Random random(14);
  const WindowGrid grid(5);
  const auto values = [&](double low) {
    std::vector<float> result(grid.padded);
    for (float& v : result) v = static_cast<float>(random.uniform(low, 1));
    return result;
  };
  const std::vector<float> first = values(0), second = values(0), slope = values(-1);
  const std::vector<float> image = values(0), root = values(0.1);
  FamilyLight light;
  light.patterns = kPatterns;
  light.profile = {first.data(), second.data()};
  light.slope = {slope.data(), slope.data()};
  light.amplitude = {0, 0};
  FamilyEquations of_all(grid, kPatterns), of_light(grid, kPatterns);
  of_all.sum(light, image.data(), root.data(), 1);
  of_light.sum_light(light, image.data(), root.data());
  for (int i = 0; i <= kPatterns; ++i) {
    for (int j = 0; j <= kPatterns; ++j)
      EXPECT_EQ(of_light.product(i, j), of_all.product(i, j)) << i << ' ' << j;
    EXPECT_EQ(of_light.product(i, kPatterns + 1),
              of_all.product(i, FamilyColumns::residual(kPatterns)))
        << i;
  }
}

}  // namespace
}  // namespace pencilscan
