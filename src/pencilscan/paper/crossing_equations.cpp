#include "pencilscan/paper/crossing_equations.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {

CrossingEquations::CrossingEquations(const Rig& rig, const GridGraph& graph,
                                     std::span<const int> crossings)
    : camera_(rig.camera(graph.camera)) {
  std::map<int, int> unknown_of_curve;
  for (const int crossing : crossings) {
    const Crossing& x = graph.crossings[static_cast<std::size_t>(crossing)];
    const auto& ra = graph.identities[static_cast<std::size_t>(x.curve_a)].pattern;
    const auto& rb = graph.identities[static_cast<std::size_t>(x.curve_b)].pattern;
    if (!ra || !rb || *ra == *rb) continue;
    const PencilParameter& v = parameter(rig, *ra);
    const PencilParameter& h = parameter(rig, *rb);
    if (!v.usable() || !h.usable()) continue;
    const auto index = [&](int curve) {
      const auto [it, fresh] = unknown_of_curve.try_emplace(curve, static_cast<int>(curves.size()));
      if (fresh) curves.push_back(curve);
      return it->second;
    };
    const Vec2 n = camera_.normalized_from_pixel(x.position.cast<double>());
    const Vec3 u(n.x(), n.y(), 1);  // the paper's (s, t, -1) up to the sign of its z axis
    CrossingEquation e;
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

std::vector<CrossingEquation> CrossingEquations::peel_leaves() {
  std::vector<int> degree(curves.size(), 0);
  for (const CrossingEquation& e : equations) {
    ++degree[static_cast<std::size_t>(e.i)];
    ++degree[static_cast<std::size_t>(e.j)];
  }
  std::vector<CrossingEquation> leaves;
  for (bool changed = true; changed;) {
    changed = false;
    std::erase_if(equations, [&](const CrossingEquation& e) {
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

void CrossingEquations::weigh(const Eigen::VectorXd* x) {
  const double focal = camera_.focal_px();
  for (CrossingEquation& e : equations) {
    const double mu = x != nullptr ? (*x)[e.i] : 0;
    const double rho = x != nullptr ? (*x)[e.j] : 0;
    const Vec3 difference = e.v->v0() + mu * e.v->v_inf() - e.h->v0() - rho * e.h->v_inf();
    e.weight = focal / std::max(1e-12, difference.head<2>().norm());
  }
}

NormalEquations CrossingEquations::normal(std::span<const int> compact, int size) const {
  NormalEquations n{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  for (const CrossingEquation& e : equations) {
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

double CrossingEquations::rms_residual_px(const Eigen::VectorXd& x) const {
  double sum = 0;
  for (const CrossingEquation& e : equations) {
    const double r = e.weight * (e.A * x[e.i] - e.B * x[e.j] + e.C);
    sum += r * r;
  }
  return std::sqrt(sum / static_cast<double>(equations.size()));
}

const PencilParameter& CrossingEquations::parameter(const Rig& rig, PatternRef ref) {
  const std::pair<int, int> key{ref.projector, ref.pattern};
  const auto it = parameters_.find(key);
  if (it != parameters_.end()) return it->second;
  return parameters_.emplace(key, PencilParameter(rig, camera_, ref)).first->second;
}

Eigen::VectorXd smallest_eigenvector(const Eigen::LDLT<Eigen::MatrixXd>& factor,
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

}  // namespace pencilscan
