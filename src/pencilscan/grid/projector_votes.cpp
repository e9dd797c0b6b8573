#include "pencilscan/grid/projector_votes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace pencilscan {
namespace {

/// Candidates of one curve at one crossing, for one pattern.
struct PatternCandidates {
  PatternRef ref;
  std::vector<LineCandidate> lines;  ///< those whose colour the evidence allows
  std::vector<double> support;       ///< best agreement of each with the other curve
};

/// Mean code evidence of a curve around a point, per colour of its family.
std::vector<float> evidence_around(const Curve& curve, float at, std::size_t colors) {
  // Chosen: the evidence of 25 points tells colours apart where one's does not.
  constexpr int kReach = 12;
  std::vector<float> sum(colors, 0.F);
  const int n = static_cast<int>(curve.points.size());
  const int center = static_cast<int>(at);
  const int low = std::max(0, center - kReach);
  const int high = std::min(n - 1, center + kReach);
  for (int i = low; i <= high; ++i) {
    for (std::size_t c = 0; c < colors; ++c)
      sum[c] += curve.code[static_cast<std::size_t>(i) * colors + c];
  }
  for (float& s : sum) s /= static_cast<float>(high - low + 1);
  return sum;
}

std::vector<PatternCandidates> candidates_at(const Rig& rig, const Camera& camera,
                                             const std::vector<ColorFamily>& families,
                                             const DepthRange& range, const Curve& curve, float at,
                                             const Vec2& pixel) {
  constexpr float kImprobable = -2.5F;  // log likelihood below the best colour's: 1 to 12; chosen
  const ColorFamily& family = families[static_cast<std::size_t>(curve.family)];
  const std::vector<float> evidence = evidence_around(curve, at, family.colors.size());
  std::vector<PatternCandidates> result;
  for (const PatternRef& ref : family.patterns) {
    if (!can_see_pattern(rig, camera, ref.projector)) continue;
    const LinePattern& pattern = rig.projectors[static_cast<std::size_t>(ref.projector)]
                                     .patterns[static_cast<std::size_t>(ref.pattern)];
    const std::vector<int> color_of = family.color_of_symbol(pattern);
    PatternCandidates found{ref, line_candidates(rig, camera, range, ref, pixel), {}};
    std::erase_if(found.lines, [&](const LineCandidate& l) {
      return evidence[static_cast<std::size_t>(
                 color_of[static_cast<std::size_t>(pattern.symbol(l.line))])] < kImprobable;
    });
    found.support.assign(found.lines.size(), 0.0);
    if (!found.lines.empty()) result.push_back(std::move(found));
  }
  return result;
}

/// Raises the support on both sides for every pair of lines whose depths agree.
void compare(PatternCandidates& a, PatternCandidates& b, double range_mm, double sigma_px) {
  const double density_a = static_cast<double>(a.lines.size()) / range_mm;
  const double density_b = static_cast<double>(b.lines.size()) / range_mm;
  std::size_t start = 0;
  for (std::size_t i = 0; i < a.lines.size(); ++i) {
    const LineCandidate& p = a.lines[i];
    const double reach = 3 * sigma_px * p.sigma_depth;
    while (start < b.lines.size() &&
           b.lines[start].depth < p.depth - reach - 3 * sigma_px * b.lines[start].sigma_depth) {
      ++start;
    }
    for (std::size_t j = start; j < b.lines.size(); ++j) {
      const LineCandidate& q = b.lines[j];
      const double dz = q.depth - p.depth;
      const double sigma = sigma_px * std::hypot(p.sigma_depth, q.sigma_depth);
      if (dz > 3 * sigma) break;
      const double log_density =
          -0.5 * dz * dz / (sigma * sigma) - std::log(std::sqrt(2 * std::numbers::pi) * sigma);
      a.support[i] = std::max(a.support[i], log_density - std::log(density_b));
      b.support[j] = std::max(b.support[j], log_density - std::log(density_a));
    }
  }
}

/// Sum of support per (pattern of the family, line) of one curve.
using VoteTable = std::vector<std::vector<double>>;

void add_votes(const std::vector<PatternCandidates>& candidates,
               const std::vector<PatternRef>& patterns, VoteTable& table) {
  for (const PatternCandidates& c : candidates) {
    const auto k = static_cast<std::size_t>(std::find(patterns.begin(), patterns.end(), c.ref) -
                                            patterns.begin());
    for (std::size_t i = 0; i < c.lines.size(); ++i) {
      table[k][static_cast<std::size_t>(c.lines[i].line)] += c.support[i];
    }
  }
}

VoteTable empty_table(const Rig& rig, const ColorFamily& family) {
  VoteTable table;
  for (const PatternRef& ref : family.patterns) {
    const Projector& projector = rig.projectors[static_cast<std::size_t>(ref.projector)];
    const int lines =
        projector.line_count(projector.patterns[static_cast<std::size_t>(ref.pattern)]);
    table.emplace_back(static_cast<std::size_t>(lines), 0.0);
  }
  return table;
}

/// `costs`: of a pattern before anything votes.
CurveIdentity decide(const VoteTable& table, const std::vector<PatternRef>& patterns,
                     const std::vector<float>& costs) {
  CurveIdentity identity;
  double best = 0;
  for (std::size_t k = 0; k < table.size(); ++k) {
    if (table[k].empty()) continue;
    const double score = *std::max_element(table[k].begin(), table[k].end()) - costs[k];
    if (score > best) {
      best = score;
      identity.pattern = patterns[k];
    }
  }
  if (patterns.size() == 1) identity.pattern = patterns.front();
  return identity;
}

}  // namespace

void vote_for_projectors(const Rig& rig, const std::vector<ColorFamily>& families,
                         const GridOptions& options, GridGraph& graph) {
  const Camera& camera = rig.cameras[static_cast<std::size_t>(graph.camera)];
  const Sphere volume = working_volume(rig);
  std::vector<VoteTable> tables;
  for (const Curve& curve : graph.curves) {
    tables.push_back(empty_table(rig, families[static_cast<std::size_t>(curve.family)]));
  }
  for (const Crossing& crossing : graph.crossings) {
    const Curve& a = graph.curves[static_cast<std::size_t>(crossing.curve_a)];
    const Curve& b = graph.curves[static_cast<std::size_t>(crossing.curve_b)];
    const Vec2 pixel = crossing.position.cast<double>();
    const auto range = depth_range(camera, volume, pixel);
    if (!range) continue;
    auto of_a = candidates_at(rig, camera, families, *range, a, crossing.at_a, pixel);
    auto of_b = candidates_at(rig, camera, families, *range, b, crossing.at_b, pixel);
    for (PatternCandidates& ca : of_a) {
      for (PatternCandidates& cb : of_b) {
        if (ca.ref == cb.ref) continue;  // lines of one pattern do not cross
        compare(ca, cb, range->far - range->near, options.projection_sigma_px);
      }
    }
    add_votes(of_a, families[static_cast<std::size_t>(a.family)].patterns,
              tables[static_cast<std::size_t>(crossing.curve_a)]);
    add_votes(of_b, families[static_cast<std::size_t>(b.family)].patterns,
              tables[static_cast<std::size_t>(crossing.curve_b)]);
  }
  std::vector<std::vector<float>> costs;
  for (const ColorFamily& family : families) costs.push_back(phase_costs(rig, camera, family));
  graph.identities.clear();
  for (std::size_t c = 0; c < graph.curves.size(); ++c) {
    const auto family = static_cast<std::size_t>(graph.curves[c].family);
    graph.identities.push_back(decide(tables[c], families[family].patterns, costs[family]));
  }
}

}  // namespace pencilscan
