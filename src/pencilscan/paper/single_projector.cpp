#include "pencilscan/paper/single_projector.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "pencilscan/core/disjoint_sets.h"
#include "pencilscan/grid/line_candidates.h"
#include "pencilscan/paper/crossing_equations.h"

namespace pencilscan {
namespace {

/// Crossings of each connected grid of one projector, in the order of their first one.
std::vector<std::vector<int>> connected_grids(const GridGraph& graph) {
  DisjointSets sets(graph.curves.size());
  const auto in_grid = [&](const Crossing& x) {
    const auto& a = graph.identities[static_cast<std::size_t>(x.curve_a)].pattern;
    const auto& b = graph.identities[static_cast<std::size_t>(x.curve_b)].pattern;
    return a && b && a->projector == b->projector && a->pattern != b->pattern;
  };
  for (const Crossing& x : graph.crossings) {
    if (in_grid(x)) sets.join(x.curve_a, x.curve_b);
  }
  std::vector<std::vector<int>> grids;
  std::map<int, std::size_t> grid_of_root;
  for (std::size_t k = 0; k < graph.crossings.size(); ++k) {
    if (!in_grid(graph.crossings[k])) continue;
    const auto [it, fresh] =
        grid_of_root.try_emplace(sets.root(graph.crossings[k].curve_a), grids.size());
    if (fresh) grids.emplace_back();
    grids[it->second].push_back(static_cast<int>(k));
  }
  return grids;
}

/// One unknown of the search.
struct SearchCurve {
  PencilParameter parameter;
  int local_id = -1;
  int period = 1;
  int line_count = 0;
  double first_line = 0;  ///< of those that meet the curve's middle in the volume
  double last_line = -1;  ///< below first_line: none does
};

std::vector<SearchCurve> search_curves(const Rig& rig, const GridGraph& graph,
                                       std::span<const int> curves) {
  const Camera& camera = rig.camera(graph.camera);
  const Sphere volume = working_volume(rig);
  std::vector<SearchCurve> result;
  for (const int c : curves) {
    const CurveIdentity& identity = graph.identities[static_cast<std::size_t>(c)];
    const PatternRef ref = *identity.pattern;
    const Projector& projector = rig.projector(ref.projector);
    const LinePattern& pattern = rig.pattern(ref);
    SearchCurve curve{PencilParameter(rig, camera, ref), identity.local_id, pattern.period(),
                      projector.line_count(pattern)};
    const auto& points = graph.curves[static_cast<std::size_t>(c)].points;
    const Vec2 middle = points[points.size() / 2].position.cast<double>();
    if (const auto range = depth_range(camera, volume, middle)) {
      const auto candidates = line_candidates(rig, camera, *range, ref, middle);
      if (!candidates.empty()) {
        const auto [low, high] = std::minmax_element(
            candidates.begin(), candidates.end(),
            [](const LineCandidate& a, const LineCandidate& b) { return a.line < b.line; });
        curve.first_line = low->line;
        curve.last_line = high->line;
      }
    }
    result.push_back(curve);
  }
  return result;
}

/// x(s) = x0 + s e of one grid, and how well it fits the pattern.
class Search {
 public:
  Search(const std::vector<SearchCurve>& curves, const Eigen::VectorXd& mu,
         const Eigen::VectorXd& direction)
      : curves_(curves), mu_(mu), direction_(direction) {}

  /// The line that curve k is at s; -1: none.
  [[nodiscard]] int line(std::size_t k, double s) const {
    const SearchCurve& curve = curves_[k];
    const double at = coordinate(k, s);
    if (!(at >= curve.first_line - 1 && at <= curve.last_line + 1)) return -1;
    return nearest_line(at, curve.local_id, curve.period, curve.line_count);
  }

  [[nodiscard]] double cost(double s) const {
    double sum = 0;
    for (std::size_t k = 0; k < curves_.size(); ++k) {
      const double worst = 0.5 * std::max(2, curves_[k].period);
      const int nearest = line(k, s);
      const double off =
          nearest < 0 ? worst : std::min(worst, std::abs(coordinate(k, s) - nearest));
      sum += off * off;
    }
    return sum / static_cast<double>(curves_.size());
  }

  /// s for which some curve's plane is in the volume; empty (first > second) where none is.
  [[nodiscard]] std::pair<double, double> range() const {
    constexpr double kLeastMotion = 0.2;  // of the most moving curve's
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (std::size_t k = 0; k < curves_.size(); ++k) {
      const SearchCurve& curve = curves_[k];
      const auto at = static_cast<Eigen::Index>(k);
      if (curve.last_line < curve.first_line || std::abs(direction_[at]) < kLeastMotion) continue;
      for (const double l : {curve.first_line, curve.last_line}) {
        const double s = (curve.parameter.mu_from_line(l) - mu_[at]) / direction_[at];
        if (!std::isfinite(s)) continue;
        low = std::min(low, s);
        high = std::max(high, s);
      }
    }
    return {low, high};
  }

 private:
  [[nodiscard]] double coordinate(std::size_t k, double s) const {
    const auto at = static_cast<Eigen::Index>(k);
    return curves_[k].parameter.line_from_mu(mu_[at] + s * direction_[at]);
  }

  const std::vector<SearchCurve>& curves_;
  const Eigen::VectorXd& mu_;
  const Eigen::VectorXd& direction_;
};

/// Solves M x = c up to its one degree of freedom: the x0 across e, and e.
bool solve_equations(const CrossingEquations& system, GridSolution& solution) {
  const auto size = static_cast<int>(system.curves.size());
  std::vector<int> all(system.curves.size());
  std::iota(all.begin(), all.end(), 0);
  NormalEquations normal = system.normal(all, size);
  // M'M is singular by construction; this makes it solvable and changes nothing that matters.
  constexpr double kDamping = 1e-10;
  Eigen::MatrixXd damped = normal.matrix;
  damped.diagonal().array() += kDamping * normal.matrix.diagonal().maxCoeff();
  const Eigen::LDLT<Eigen::MatrixXd> factor(damped);
  const Eigen::VectorXd e = smallest_eigenvector(factor, {});
  if (e.size() == 0) return false;
  const Eigen::VectorXd x = factor.solve(normal.right);
  if (!x.allFinite()) return false;
  const auto singular_value = [&](const Eigen::VectorXd& v) {
    return std::sqrt(std::max(0.0, v.dot(normal.matrix * v)));
  };
  solution.report.sigma_min = singular_value(e);
  if (size > 1) {
    const Eigen::VectorXd second = smallest_eigenvector(factor, e);
    if (second.size() > 0) solution.report.sigma_second = singular_value(second);
  }
  solution.mu = x - e * e.dot(x);
  Eigen::Index largest = 0;
  e.cwiseAbs().maxCoeff(&largest);
  solution.direction = e / e[largest];
  return true;
}

/// Sweeps s and fills the report's minimum and the margin to the lowest one outside its valley.
void sweep(const Search& search, double low, double high, double step, ComponentReport& report) {
  std::vector<double>& cost = report.sweep_cost;
  report.sweep_s.clear();
  cost.clear();
  const int steps = static_cast<int>(std::ceil((high - low) / step));
  for (int i = 0; i <= steps; ++i) {
    report.sweep_s.push_back(low + i * step);
    cost.push_back(search.cost(report.sweep_s.back()));
  }
  const auto best = std::min_element(cost.begin(), cost.end());
  report.best_s = report.sweep_s[static_cast<std::size_t>(best - cost.begin())];
  auto left = best;
  while (left != cost.begin() && *(left - 1) >= *left) --left;
  auto right = best;
  while (right + 1 != cost.end() && *(right + 1) >= *right) ++right;
  const double next =
      std::min(*std::min_element(cost.begin(), left + 1), *std::min_element(right, cost.end()));
  report.margin = next - *best;
}

GridSolution solve_grid(const Rig& rig, const GridGraph& graph, std::span<const int> crossings,
                        const SingleProjectorOptions& options) {
  GridSolution solution;
  solution.projector =
      graph
          .identities[static_cast<std::size_t>(
              graph.crossings[static_cast<std::size_t>(crossings.front())].curve_a)]
          .pattern->projector;
  ComponentReport& report = solution.report;
  report.camera = graph.camera;
  CrossingEquations system(rig, graph, crossings);
  solution.curves = system.curves;
  report.curves = static_cast<int>(system.curves.size());
  report.crossings = static_cast<int>(system.equations.size());
  if (system.equations.empty()) {
    report.reason = "the planes of one orientation hold the camera centre";
    return solution;
  }
  solution.lines.assign(system.curves.size(), -1);
  const std::vector<SearchCurve> curves = search_curves(rig, graph, system.curves);
  constexpr int kPasses = 2;  // weights at the middle of the volume, then at the solution
  constexpr int kMaxSteps = 50000;
  const double step = options.step_lines;
  Eigen::VectorXd x;
  for (int pass = 0; pass < kPasses; ++pass) {
    system.weigh(pass == 0 ? nullptr : &x);
    if (!solve_equations(system, solution)) {
      report.reason = "the equations are singular";
      return solution;
    }
    const Search search(curves, solution.mu, solution.direction);
    const auto [low, high] = search.range();
    if (!(high >= low) || (high - low) / step > kMaxSteps) {
      report.reason = "no position of the planes lies in the volume";
      return solution;
    }
    sweep(search, low, high, step, report);
    x = solution.mu + report.best_s * solution.direction;
    report.residual_rms_px = system.rms_residual_px(x);
    for (std::size_t k = 0; k < curves.size(); ++k)
      solution.lines[k] = search.line(k, report.best_s);
  }
  report.solved = true;
  return solution;
}

}  // namespace

std::vector<GridSolution> solve_grids(const Rig& rig, const GridGraph& graph,
                                      const SingleProjectorOptions& options) {
  std::vector<GridSolution> solutions;
  for (const std::vector<int>& crossings : connected_grids(graph))
    solutions.push_back(solve_grid(rig, graph, crossings, options));
  return solutions;
}

bool shows_grid(const Rig& rig) {
  return std::any_of(rig.projectors.begin(), rig.projectors.end(), [](const Projector& projector) {
    return std::any_of(
        projector.patterns.begin(), projector.patterns.end(),
        [&](const LinePattern& p) { return p.axis != projector.patterns.front().axis; });
  });
}

}  // namespace pencilscan
