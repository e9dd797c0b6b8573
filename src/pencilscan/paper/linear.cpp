#include "pencilscan/paper/linear.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "pencilscan/paper/crossing_equations.h"

namespace pencilscan {
namespace {

/// Follows single crossings outwards from solved curves.
void attach_leaves(const std::vector<CrossingEquation>& leaves, std::vector<char>& known,
                   Eigen::VectorXd& x, Eigen::VectorXd& direction) {
  constexpr double kMinCoefficient = 1e-12;
  for (const CrossingEquation& e : leaves) {
    const auto i = static_cast<std::size_t>(e.i);
    const auto j = static_cast<std::size_t>(e.j);
    if (known[j] != 0 && known[i] == 0 && std::abs(e.A) > kMinCoefficient) {
      x[e.i] = (e.B * x[e.j] - e.C) / e.A;
      direction[e.i] = e.B / e.A * direction[e.j];
      known[i] = 1;
    } else if (known[i] != 0 && known[j] == 0 && std::abs(e.B) > kMinCoefficient) {
      x[e.j] = (e.A * x[e.i] + e.C) / e.B;
      direction[e.j] = e.A / e.B * direction[e.i];
      known[j] = 1;
    }
  }
}

/// Place of each known curve among the known ones; -1 for the others.
std::vector<int> compact_indices(const std::vector<char>& known, int& size) {
  std::vector<int> compact(known.size(), -1);
  size = 0;
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (known[i] != 0) compact[i] = size++;
  }
  return compact;
}

/// e, the direction that the equations determine least, and the two smallest singular values of M.
/// Empty where the equations are singular.
Eigen::VectorXd least_determined(const Eigen::MatrixXd& matrix, LinearSolution& solution) {
  const Eigen::LDLT<Eigen::MatrixXd> factor(matrix);
  Eigen::VectorXd e_min = smallest_eigenvector(factor, {});
  if (e_min.size() == 0) return e_min;
  const auto singular_value = [&](const Eigen::VectorXd& e) {
    return std::sqrt(std::max(0.0, e.dot(matrix * e)));
  };
  solution.sigma_min = singular_value(e_min);
  if (matrix.rows() > 1) {
    const Eigen::VectorXd e_second = smallest_eigenvector(factor, e_min);
    if (e_second.size() > 0) solution.sigma_second = singular_value(e_second);
  }
  return e_min;
}

/// The known curves alone, with `direction` scaled to a largest value of 1.
void keep_known(const std::vector<int>& curves, const std::vector<char>& known,
                const Eigen::VectorXd& x, const Eigen::VectorXd& direction,
                LinearSolution& solution) {
  std::vector<Eigen::Index> kept;
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (known[i] == 0) continue;
    kept.push_back(static_cast<Eigen::Index>(i));
    solution.curves.push_back(curves[i]);
  }
  solution.mu = x(kept);
  solution.direction = direction(kept);
  const double largest = solution.direction.cwiseAbs().maxCoeff();
  if (largest > 0) solution.direction /= largest;
  solution.solved = true;
}

}  // namespace

LinearSolution solve_component(const Rig& rig, const GridGraph& graph, int component) {
  std::vector<int> crossings;
  for (std::size_t k = 0; k < graph.crossings.size(); ++k) {
    const auto curve = static_cast<std::size_t>(graph.crossings[k].curve_a);
    if (graph.component_of_curve[curve] == component) crossings.push_back(static_cast<int>(k));
  }
  CrossingEquations system(rig, graph, crossings);
  LinearSolution solution;
  solution.crossings = static_cast<int>(system.equations.size());
  const std::vector<CrossingEquation> leaves = system.peel_leaves();
  std::vector<char> known(system.curves.size(), 0);
  for (const CrossingEquation& e : system.equations)
    known[static_cast<std::size_t>(e.i)] = known[static_cast<std::size_t>(e.j)] = 1;
  int size = 0;
  const std::vector<int> compact = compact_indices(known, size);
  if (size == 0 || static_cast<int>(system.equations.size()) < size) {
    solution.reason = "fewer crossings than curves: the planes are not determined";
    return solution;
  }
  const auto total = static_cast<Eigen::Index>(system.curves.size());
  Eigen::VectorXd x = Eigen::VectorXd::Zero(total);
  Eigen::VectorXd e_min;
  constexpr int kPasses = 3;
  for (int pass = 0; pass < kPasses; ++pass) {
    system.weigh(pass == 0 ? nullptr : &x);
    const NormalEquations normal = system.normal(compact, size);
    const Eigen::VectorXd scale =
        normal.matrix.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
    const Eigen::LDLT<Eigen::MatrixXd> scaled(scale.asDiagonal() * normal.matrix *
                                              scale.asDiagonal());
    const Eigen::VectorXd mu = scale.asDiagonal() * scaled.solve(scale.asDiagonal() * normal.right);
    if (!mu.allFinite()) {
      solution.reason = "the equations are singular";
      return solution;
    }
    for (std::size_t i = 0; i < known.size(); ++i) {
      if (known[i] != 0) x[static_cast<Eigen::Index>(i)] = mu[compact[i]];
    }
    if (pass + 1 < kPasses) continue;
    e_min = least_determined(normal.matrix, solution);
    if (e_min.size() == 0) {
      solution.reason = "the equations are singular";
      return solution;
    }
  }
  solution.residual_rms_px = system.rms_residual_px(x);
  Eigen::VectorXd direction = Eigen::VectorXd::Zero(total);
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (known[i] != 0) direction[static_cast<Eigen::Index>(i)] = e_min[compact[i]];
  }
  attach_leaves(leaves, known, x, direction);
  keep_known(system.curves, known, x, direction, solution);
  return solution;
}

}  // namespace pencilscan
