#include "pencilscan/solution/linear.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>

#include "pencilscan/solution/pencil_parameter.h"

namespace pencilscan {
namespace {

/// One crossing as an equation between unknowns i and j.
struct Equation {
  int i = 0;
  int j = 0;
  double A = 0;
  double B = 0;
  double C = 0;
  const PencilParameter* v = nullptr;
  const PencilParameter* h = nullptr;
  double weight = 1;
};

class System {
 public:
  System(const Rig& rig, const GridGraph& graph, int component)
      : camera_(rig.cameras[static_cast<std::size_t>(graph.camera)]) {
    std::map<int, int> unknown_of_curve;
    for (const Crossing& x : graph.crossings) {
      if (graph.component_of_curve[static_cast<std::size_t>(x.curve_a)] != component) continue;
      const auto& ra = graph.identities[static_cast<std::size_t>(x.curve_a)].pattern;
      const auto& rb = graph.identities[static_cast<std::size_t>(x.curve_b)].pattern;
      if (!ra || !rb || *ra == *rb) continue;
      const PencilParameter& v = parameter(rig, *ra);
      const PencilParameter& h = parameter(rig, *rb);
      if (!v.usable() || !h.usable()) continue;
      const auto index = [&](int curve) {
        const auto [it, fresh] =
            unknown_of_curve.try_emplace(curve, static_cast<int>(curves.size()));
        if (fresh) curves.push_back(curve);
        return it->second;
      };
      const Vec2 n = camera_.normalized_from_pixel(x.position.cast<double>());
      const Vec3 u(n.x(), n.y(), 1);  // the paper's (s, t, -1) up to the sign of its z axis
      Equation e;
      e.i = index(x.curve_a);
      e.j = index(x.curve_b);
      e.A = u.dot(v.v_inf());
      e.B = u.dot(h.v_inf());
      e.C = u.dot(v.v0() - h.v0());
      e.v = &v;
      e.h = &h;
      equations.push_back(e);
    }
  }

  /// Removes, again and again, curves with a single crossing; returns those equations, last first.
  std::vector<Equation> peel_leaves() {
    std::vector<int> degree(curves.size(), 0);
    for (const Equation& e : equations) {
      ++degree[static_cast<std::size_t>(e.i)];
      ++degree[static_cast<std::size_t>(e.j)];
    }
    std::vector<Equation> leaves;
    for (bool changed = true; changed;) {
      changed = false;
      std::erase_if(equations, [&](const Equation& e) {
        auto& di = degree[static_cast<std::size_t>(e.i)];
        auto& dj = degree[static_cast<std::size_t>(e.j)];
        if (di > 1 && dj > 1) return false;
        --di;
        --dj;
        leaves.push_back(e);
        changed = true;
        return true;
      });
    }
    std::reverse(leaves.begin(), leaves.end());
    return leaves;
  }

  void weigh(const Eigen::VectorXd* x) {
    const double focal = 0.5 * (camera_.K(0, 0) + camera_.K(1, 1));
    for (Equation& e : equations) {
      const double mu = x != nullptr ? (*x)[e.i] : 0;
      const double rho = x != nullptr ? (*x)[e.j] : 0;
      const Vec3 difference = e.v->v0() + mu * e.v->v_inf() - e.h->v0() - rho * e.h->v_inf();
      e.weight = focal / std::max(1e-12, difference.head<2>().norm());
    }
  }

  std::vector<int> curves;
  std::vector<Equation> equations;

 private:
  const PencilParameter& parameter(const Rig& rig, PatternRef ref) {
    const std::pair<int, int> key{ref.projector, ref.pattern};
    const auto it = parameters_.find(key);
    if (it != parameters_.end()) return it->second;
    return parameters_.emplace(key, PencilParameter(rig, camera_, ref)).first->second;
  }

  const Camera& camera_;
  std::map<std::pair<int, int>, PencilParameter> parameters_;
};

struct Normal {
  Eigen::MatrixXd matrix;  ///< M'M
  Eigen::VectorXd right;   ///< M'c
};

Normal normal_equations(const std::vector<Equation>& equations, const std::vector<int>& compact,
                        int size) {
  Normal n{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  for (const Equation& e : equations) {
    const int i = compact[static_cast<std::size_t>(e.i)];
    const int j = compact[static_cast<std::size_t>(e.j)];
    const double w2 = e.weight * e.weight;
    n.matrix(i, i) += w2 * e.A * e.A;
    n.matrix(j, j) += w2 * e.B * e.B;
    n.matrix(i, j) -= w2 * e.A * e.B;
    n.matrix(j, i) -= w2 * e.A * e.B;
    n.right(i) -= w2 * e.A * e.C;
    n.right(j) += w2 * e.B * e.C;
  }
  return n;
}

/// Smallest eigenvector of a factored symmetric matrix, orthogonal to `avoid` (may be empty).
Eigen::VectorXd inverse_iteration(const Eigen::LDLT<Eigen::MatrixXd>& factor,
                                  const Eigen::VectorXd& avoid) {
  constexpr int kIterations = 12;
  Eigen::VectorXd x(factor.rows());
  for (Eigen::Index i = 0; i < x.size(); ++i)
    x[i] = 1 + 0.3 * std::sin(static_cast<double>(7 * i + 1));
  for (int k = 0; k < kIterations; ++k) {
    if (avoid.size() > 0) x -= avoid * avoid.dot(x);
    x = factor.solve(x);
    if (!x.allFinite() || x.norm() == 0) return {};
    x.normalize();
  }
  if (avoid.size() > 0) x = (x - avoid * avoid.dot(x)).normalized();
  return x;
}

double rms_residual_px(const std::vector<Equation>& equations, const Eigen::VectorXd& x) {
  double sum = 0;
  for (const Equation& e : equations) {
    const double r = e.weight * (e.A * x[e.i] - e.B * x[e.j] + e.C);
    sum += r * r;
  }
  return std::sqrt(sum / static_cast<double>(equations.size()));
}

/// Follows single crossings outwards from solved curves.
void attach_leaves(const std::vector<Equation>& leaves, std::vector<char>& known,
                   Eigen::VectorXd& x, Eigen::VectorXd& direction) {
  constexpr double kMinCoefficient = 1e-12;
  for (const Equation& e : leaves) {
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

}  // namespace

LinearSolution solve_component(const Rig& rig, const GridGraph& graph, int component) {
  System system(rig, graph, component);
  LinearSolution solution;
  solution.crossings = static_cast<int>(system.equations.size());
  const std::vector<Equation> leaves = system.peel_leaves();
  std::vector<char> known(system.curves.size(), 0);
  for (const Equation& e : system.equations)
    known[static_cast<std::size_t>(e.i)] = known[static_cast<std::size_t>(e.j)] = 1;
  std::vector<int> compact(system.curves.size(), -1);
  int size = 0;
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (known[i] != 0) compact[i] = size++;
  }
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
    const Normal normal = normal_equations(system.equations, compact, size);
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
    const Eigen::LDLT<Eigen::MatrixXd> factor(normal.matrix);
    e_min = inverse_iteration(factor, {});
    if (e_min.size() == 0) {
      solution.reason = "the equations are singular";
      return solution;
    }
    const auto singular_value = [&](const Eigen::VectorXd& e) {
      return std::sqrt(std::max(0.0, e.dot(normal.matrix * e)));
    };
    solution.sigma_min = singular_value(e_min);
    if (size > 1) {
      const Eigen::VectorXd e_second = inverse_iteration(factor, e_min);
      if (e_second.size() > 0) solution.sigma_second = singular_value(e_second);
    }
  }
  solution.residual_rms_px = rms_residual_px(system.equations, x);
  Eigen::VectorXd direction = Eigen::VectorXd::Zero(total);
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (known[i] != 0) direction[static_cast<Eigen::Index>(i)] = e_min[compact[i]];
  }
  attach_leaves(leaves, known, x, direction);
  // Keep the known curves only.
  std::vector<Eigen::Index> kept;
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (known[i] == 0) continue;
    kept.push_back(static_cast<Eigen::Index>(i));
    solution.curves.push_back(system.curves[i]);
  }
  solution.mu = x(kept);
  solution.direction = direction(kept);
  const double largest = solution.direction.cwiseAbs().maxCoeff();
  if (largest > 0) solution.direction /= largest;
  solution.solved = true;
  return solution;
}

}  // namespace pencilscan
