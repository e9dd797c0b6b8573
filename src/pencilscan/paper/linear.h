#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/labeling/labeling.h"

namespace pencilscan {

/// Linear solution of one component (section IV-A of the paper): every crossing u = (s, t, -1) of
/// curves of two pencils gives A mu - B rho = -C (equation (6)), A = u'v_inf, B = u'h_inf, C =
/// u'(v0 - h0).
///
/// Scaling: rows by f / |(v - h)_xy|, so that a residual is an image distance in pixels (the weight
/// is taken at the reference planes first, then at the solution), parameters in lines
/// (PencilParameter). Only curves that hang together by at least two crossings each enter the
/// system; a curve with a single crossing follows from it afterwards. M'M is factored by LDLT, its
/// smallest eigenvectors come from inverse iteration with the same factor.
struct LinearSolution {
  bool solved = false;
  std::string reason;
  std::vector<int> curves;    ///< curve index of each unknown
  Eigen::VectorXd mu;         ///< x0, paper's parameters
  Eigen::VectorXd direction;  ///< e: eigenvector of the smallest eigenvalue, largest entry 1
  double sigma_min = 0;       ///< px per line
  double sigma_second = 0;
  double residual_rms_px = 0;
  int crossings = 0;
};

[[nodiscard]] LinearSolution solve_component(const Rig& rig, const GridGraph& graph, int component);

}  // namespace pencilscan
