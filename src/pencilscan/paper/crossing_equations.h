#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/paper/pencil_parameter.h"

namespace pencilscan {

/// One crossing as an equation A x_i - B x_j = -C between unknowns i and j (equation (6) of the
/// paper): u = (s, t, -1) on planes v, h of two pencils gives A = u'v_inf, B = u'h_inf, C = u'(v0 -
/// h0).
struct CrossingEquation {
  int i = 0;
  int j = 0;
  double A = 0;
  double B = 0;
  double C = 0;
  const PencilParameter* v = nullptr;
  const PencilParameter* h = nullptr;
  double weight = 1;  ///< makes the residual an image distance in px
};

/// M'M and M'c of weighted equations.
struct NormalEquations {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd right;
};

/// Equations (6) of some crossings of one camera; unknowns are the plane parameters of its curves,
/// in lines (PencilParameter). Crossings of curves without pattern, of one pattern, or of a pencil
/// whose planes hold the camera centre give none.
class CrossingEquations {
 public:
  CrossingEquations(const Rig& rig, const GridGraph& graph, std::span<const int> crossings);
  CrossingEquations(const CrossingEquations&) = delete;  // equations point into parameters_
  CrossingEquations& operator=(const CrossingEquations&) = delete;

  /// Removes, again and again, curves with a single crossing; returns those equations, last first.
  std::vector<CrossingEquation> peel_leaves();
  /// Rows weighted by f / |(v - h)_xy| at the reference planes, or at the parameters x.
  void weigh(const Eigen::VectorXd* x);
  /// Normal equations of `size` unknowns; compact[i] is the row of unknown i, -1: in no equation.
  [[nodiscard]] NormalEquations normal(std::span<const int> compact, int size) const;
  [[nodiscard]] double rms_residual_px(const Eigen::VectorXd& x) const;

  std::vector<int> curves;  ///< curve index of each unknown
  std::vector<CrossingEquation> equations;

 private:
  const PencilParameter& parameter(const Rig& rig, PatternRef ref);

  const Camera& camera_;
  std::map<std::pair<int, int>, PencilParameter> parameters_;
};

/// Unit eigenvector of the smallest eigenvalue of a factored symmetric matrix among vectors
/// orthogonal to `avoid` (may be empty), by inverse iteration; empty when the factor is singular.
[[nodiscard]] Eigen::VectorXd smallest_eigenvector(const Eigen::LDLT<Eigen::MatrixXd>& factor,
                                                   const Eigen::VectorXd& avoid);

}  // namespace pencilscan
