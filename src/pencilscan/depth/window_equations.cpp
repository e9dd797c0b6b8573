#include "pencilscan/depth/window_equations.h"

#include <Eigen/Cholesky>

namespace pencilscan {
namespace {

constexpr int kSurface = 6;
constexpr int kRight = 6;  // column of the right side in a row

}  // namespace

void WindowEquations::reset(std::size_t families) {
  families_.resize(families);
  for (Family& family : families_) family.unknowns = 0;
  for (Row& row : surface) row = Row{};
}

void WindowEquations::resize(int unknowns, Family& family) {
  const auto n = static_cast<std::size_t>(unknowns);
  family.unknowns = unknowns;
  if (family.B.size() >= n) return;
  family.A.resize(n * n);
  family.B.resize(n);
  family.inverse_D.resize(n);
}

bool WindowEquations::eliminate(double ridge) {
  for (int r = 0; r < kSurface; ++r) surface[r][r] *= 1 + ridge;
  for (Family& family : families_) {
    const int n = family.unknowns;
    for (int j = 0; j < n; ++j) family.a(j, j) *= 1 + ridge;
    for (int j = 0; j < n; ++j) {
      const double d = family.a(j, j);
      if (!(d > 0)) return false;
      const double inverse = 1 / d;
      const Row of_j = family.B[static_cast<std::size_t>(j)];
      family.inverse_D[static_cast<std::size_t>(j)] = inverse;
      // From the last row up, so that column j is still without its factor where it is read.
      for (int i = n - 1; i > j; --i) {
        const double l = family.a(i, j) * inverse;
        for (int k = j + 1; k <= i; ++k) family.a(i, k) -= l * family.a(k, j);
        family.a(i, j) = l;
        family.B[static_cast<std::size_t>(i)] -= l * of_j;
      }
      const Row scaled = inverse * of_j;
      for (int r = 0; r < kSurface; ++r) surface[r] -= of_j[r] * scaled;
    }
  }
  const Eigen::LLT<Mat6> cholesky(surface_information());
  factor_ = cholesky.matrixL();
  return cholesky.info() == Eigen::Success;
}

WindowEquations::Surface WindowEquations::solve_surface() const {
  Surface s;
  for (int r = 0; r < kSurface; ++r) s[r] = surface[r][kRight];
  factor_.triangularView<Eigen::Lower>().solveInPlace(s);
  factor_.transpose().triangularView<Eigen::Upper>().solveInPlace(s);
  return s;
}

void WindowEquations::solve_light(std::size_t f, const Surface& s,
                                  std::vector<double>& light) const {
  const Family& family = families_[f];
  const int n = family.unknowns;
  light.resize(static_cast<std::size_t>(n));
  for (int k = n - 1; k >= 0; --k) {
    const auto at = static_cast<std::size_t>(k);
    const Row& row = family.B[at];
    double value = row[kRight];
    for (int c = 0; c < kSurface; ++c) value -= row[c] * s[c];
    value *= family.inverse_D[at];
    for (int i = k + 1; i < n; ++i) value -= family.a(i, k) * light[static_cast<std::size_t>(i)];
    light[at] = value;
  }
}

Mat6 WindowEquations::surface_information() const {
  Mat6 C;
  for (int r = 0; r < kSurface; ++r) {
    for (int c = 0; c < kSurface; ++c) C(r, c) = surface[r][c];
  }
  return C;
}

double WindowEquations::surface_variance() const {
  Surface column = Surface::Unit(0);
  factor_.triangularView<Eigen::Lower>().solveInPlace(column);
  return column.squaredNorm();
}

double WindowEquations::light_variance(std::size_t f, int unknown) const {
  const Family& family = families_[f];
  const int n = family.unknowns;
  // With t = L^-1 e, the element of A^-1 is t' D^-1 t, and its row of A^-1 B is t' D^-1 (L^-1 B);
  // the bracket is what the family's rows hold now.
  std::vector<double> t(static_cast<std::size_t>(n), 0.0);
  double variance = 0;
  Surface coupling = Surface::Zero();
  for (int i = unknown; i < n; ++i) {
    double value = i == unknown ? 1 : 0;
    for (int k = unknown; k < i; ++k) value -= family.a(i, k) * t[static_cast<std::size_t>(k)];
    const auto at = static_cast<std::size_t>(i);
    t[at] = value;
    const double scaled = value * family.inverse_D[at];
    variance += value * scaled;
    for (int c = 0; c < kSurface; ++c) coupling[c] += scaled * family.B[at][c];
  }
  factor_.triangularView<Eigen::Lower>().solveInPlace(coupling);
  return variance + coupling.squaredNorm();
}

}  // namespace pencilscan
