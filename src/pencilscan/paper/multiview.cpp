#include "pencilscan/paper/multiview.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pencilscan/paper/pencil_parameter.h"

namespace pencilscan {
namespace {

/// Comparison of one curve, taken for one line, with the adjacent cameras.
struct LineCost {
  int line = 0;
  double distance_sum = 0;  ///< px, matched points
  int matched = 0;
  int reprojected = 0;  ///< points inside an adjacent image
};

/// One unknown of the sweep.
struct SweepCurve {
  PencilParameter parameter;
  double mu = 0;
  double direction = 0;
  int local_id = -1;
  int period = 1;
  int line_count = 0;
  std::vector<LineCost> costs;  ///< all lines in the volume with its ID, ascending
};

std::vector<LineCost> line_costs(const Rig& rig, const GridGraph& graph, int curve_index,
                                 std::span<const CurveIndex> indices,
                                 const std::vector<int>& others, const MultiviewOptions& options) {
  const Camera& camera = rig.camera(graph.camera);
  const Curve& curve = graph.curves[static_cast<std::size_t>(curve_index)];
  const CurveIdentity& identity = graph.identities[static_cast<std::size_t>(curve_index)];
  const PatternRef ref = *identity.pattern;
  const Projector& projector = rig.projector(ref.projector);
  const LinePattern& pattern = rig.pattern(ref);
  const Vec2 middle = curve.points[curve.points.size() / 2].position.cast<double>();
  std::vector<LineCost> costs;
  const auto range = depth_range(camera, working_volume(rig), middle);
  if (!range) return costs;
  for (const LineCandidate& candidate : line_candidates(rig, camera, *range, ref, middle)) {
    if (identity.local_id >= 0 && pattern.local_id(candidate.line) != identity.local_id) continue;
    LineCost cost;
    cost.line = candidate.line;
    for (std::size_t i = 0; i < curve.points.size();
         i += static_cast<std::size_t>(options.point_stride)) {
      const Vec2 pixel = curve.points[i].position.cast<double>();
      const auto depth = RayInProjector(camera, projector, pixel)
                             .depth(pattern.position_px(candidate.line), pattern.axis);
      if (!depth) continue;
      const Vec3 point = camera.point_at_depth(pixel, *depth);
      for (const int other : others) {
        const auto reprojected = rig.camera(other).project(point);
        if (!reprojected || !rig.camera(other).contains(*reprojected)) continue;
        ++cost.reprojected;
        const auto d = indices[static_cast<std::size_t>(other)].distance(
            *reprojected, ref, identity.local_id, options.search_radius_px);
        if (!d) continue;
        ++cost.matched;
        cost.distance_sum += *d;
      }
    }
    costs.push_back(cost);
  }
  std::sort(costs.begin(), costs.end(),
            [](const LineCost& a, const LineCost& b) { return a.line < b.line; });
  return costs;
}

const LineCost* cost_at(const SweepCurve& curve, double s) {
  const double coordinate = curve.parameter.line_from_mu(curve.mu + s * curve.direction);
  if (!std::isfinite(coordinate)) return nullptr;
  const int line = nearest_line(coordinate, curve.local_id, curve.period, curve.line_count);
  const auto it = std::lower_bound(curve.costs.begin(), curve.costs.end(), line,
                                   [](const LineCost& c, int l) { return c.line < l; });
  return it != curve.costs.end() && it->line == line ? &*it : nullptr;
}

double total_cost(const std::vector<SweepCurve>& curves, double s,
                  const MultiviewOptions& options) {
  const bool is_mean = options.cost == MultiviewCost::kNormalized;
  double sum = 0;
  double weight = 0;
  for (const SweepCurve& curve : curves) {
    int most = 1;
    for (const LineCost& c : curve.costs) most = std::max(most, c.reprojected);
    weight += most;
    const LineCost* cost = cost_at(curve, s);
    // A plane outside the volume sees nothing it could match: its points count as unmatched.
    const int matched = cost == nullptr ? 0 : std::min(most, cost->matched);
    const int points = is_mean || cost == nullptr ? most : cost->reprojected;
    sum += options.search_radius_px * (points - matched);
    if (cost != nullptr) sum += cost->distance_sum;
  }
  return is_mean && weight > 0 ? sum / weight : sum;
}

/// s for which some curve's plane is in the volume.
std::pair<double, double> sweep_range(const std::vector<SweepCurve>& curves) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const SweepCurve& curve : curves) {
    if (curve.costs.empty() || std::abs(curve.direction) < 0.2) continue;
    for (const int line : {curve.costs.front().line, curve.costs.back().line}) {
      const double s = (curve.parameter.mu_from_line(line) - curve.mu) / curve.direction;
      if (!std::isfinite(s)) continue;
      low = std::min(low, s);
      high = std::max(high, s);
    }
  }
  return {low, high};
}

void find_minimum(ComponentReport& report, double separation) {
  const auto& cost = report.sweep_cost;
  const auto best =
      static_cast<std::size_t>(std::min_element(cost.begin(), cost.end()) - cost.begin());
  // Several neighbouring s may snap to the same lines: the middle of the plateau is the choice.
  std::size_t last = best;
  while (last + 1 < cost.size() && cost[last + 1] == cost[best]) ++last;
  const std::size_t middle = (best + last) / 2;
  report.best_s = report.sweep_s[middle];
  double second = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < cost.size(); ++i) {
    if (std::abs(report.sweep_s[i] - report.best_s) > separation && cost[i] != cost[best])
      second = std::min(second, cost[i]);
  }
  report.margin = std::isfinite(second) ? second - cost[best] : 0;
}

}  // namespace

MultiviewSolution sweep_component(const Rig& rig, const GridGraph& graph,
                                  const LinearSolution& linear, std::span<const CurveIndex> indices,
                                  const MultiviewOptions& options) {
  const Camera& camera = rig.camera(graph.camera);
  const std::vector<int> others = adjacent_cameras(rig, graph.camera);
  MultiviewSolution solution;
  std::vector<SweepCurve> curves;
  for (std::size_t k = 0; k < linear.curves.size(); ++k) {
    const int c = linear.curves[k];
    const PatternRef ref = *graph.identities[static_cast<std::size_t>(c)].pattern;
    const Projector& projector = rig.projector(ref.projector);
    const LinePattern& pattern = rig.pattern(ref);
    const auto at = static_cast<Eigen::Index>(k);
    curves.push_back({PencilParameter(rig, camera, ref), linear.mu[at], linear.direction[at],
                      graph.identities[static_cast<std::size_t>(c)].local_id, pattern.period(),
                      projector.line_count(pattern),
                      line_costs(rig, graph, c, indices, others, options)});
  }
  const auto [low, high] = sweep_range(curves);
  solution.lines.assign(curves.size(), -1);
  constexpr int kMaxSteps = 20000;
  if (!(high >= low) || (high - low) / options.step_lines > kMaxSteps) {
    solution.report.reason = "no position of the planes lies in the volume";
    return solution;
  }
  const int steps = static_cast<int>(std::ceil((high - low) / options.step_lines));
  for (int i = 0; i <= steps; ++i) {
    const double s = low + i * options.step_lines;
    solution.report.sweep_s.push_back(s);
    solution.report.sweep_cost.push_back(total_cost(curves, s, options));
  }
  const bool meets_any = std::any_of(curves.begin(), curves.end(), [](const SweepCurve& curve) {
    return std::any_of(curve.costs.begin(), curve.costs.end(),
                       [](const LineCost& cost) { return cost.matched > 0; });
  });
  if (!meets_any) {
    solution.report.reason = "no reprojected curve meets one with its ID in another camera";
    return solution;
  }
  find_minimum(solution.report, 2 * options.step_lines);
  for (std::size_t k = 0; k < curves.size(); ++k) {
    const LineCost* cost = cost_at(curves[k], solution.report.best_s);
    if (cost != nullptr) solution.lines[k] = cost->line;
  }
  solution.report.solved = true;
  return solution;
}

}  // namespace pencilscan
