#pragma once

#include <Eigen/Core>
#include <vector>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// Normal equations of a window's fit. The six unknowns s of the surface are shared; those of each
/// family's light l_f meet only them and one another:
///   C s + sum_f B_f' l_f = c,   B_f s + A_f l_f = b_f.
/// So light is eliminated first (A = L D L'), which leaves six equations for s:
///   (C - sum_f B_f' A_f^-1 B_f) s = c - sum_f B_f' A_f^-1 b_f.
class WindowEquations {
 public:
  using Surface = Eigen::Matrix<double, 6, 1>;
  /// Six of the surface, the right side, nothing.
  using Row __attribute__((vector_size(64))) = double;

  struct Family {
    int unknowns = 0;
    std::vector<double> A;          ///< unknowns x unknowns; the lower triangle counts
    std::vector<Row> B;             ///< per unknown: coupling with the surface, right side
    std::vector<double> inverse_D;  ///< of eliminate()
    [[nodiscard]] double& a(int row, int column) {
      return A[static_cast<std::size_t>(row * unknowns + column)];
    }
    [[nodiscard]] double a(int row, int column) const {
      return A[static_cast<std::size_t>(row * unknowns + column)];
    }
  };

  /// All zero, with this many families, whose light is to be set: resize().
  void reset(std::size_t families);
  static void resize(int unknowns, Family& family);

  [[nodiscard]] Family& family(std::size_t f) { return families_[f]; }
  /// C and c.
  Row surface[6] = {};

  /// Multiplies the diagonal with 1 + ridge, then eliminates; false where it is not positive.
  [[nodiscard]] bool eliminate(double ridge);

  // After eliminate():
  [[nodiscard]] Surface solve_surface() const;
  /// The light of a family beside this surface.
  void solve_light(std::size_t f, const Surface& s, std::vector<double>& light) const;
  /// The matrix of the six: the inverse of their covariance.
  [[nodiscard]] Mat6 surface_information() const;
  /// The first diagonal element of its inverse.
  [[nodiscard]] double surface_variance() const;
  /// That of one unknown of a family.
  [[nodiscard]] double light_variance(std::size_t f, int unknown) const;

 private:
  std::vector<Family> families_;
  Mat6 factor_;  ///< L of the Cholesky decomposition of the six
};

}  // namespace pencilscan
