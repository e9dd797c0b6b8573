#include "pencilscan/grid/local_ids.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "pencilscan/core/median.h"
#include "pencilscan/detection/code_evidence.h"

namespace pencilscan {
namespace {

const LinePattern& pattern_of(const Rig& rig, PatternRef ref) {
  return rig.projectors[static_cast<std::size_t>(ref.projector)]
      .patterns[static_cast<std::size_t>(ref.pattern)];
}

int modulo(int a, int n) { return ((a % n) + n) % n; }

/// One crossing as met when walking along a curve.
struct Stop {
  float at = 0;        ///< along the walked curve
  int curve = 0;       ///< the curve met
  float at_curve = 0;  ///< along that
  Eigen::Vector2f position;
};

/// Stops per walked curve and pattern met, in walking order.
std::vector<std::map<std::pair<int, int>, std::vector<Stop>>> stops_of(const GridGraph& graph) {
  std::vector<std::map<std::pair<int, int>, std::vector<Stop>>> stops(graph.curves.size());
  const auto add = [&](int walked, float at, int met, float at_met, const Crossing& c) {
    const auto& pattern = graph.identities[static_cast<std::size_t>(met)].pattern;
    if (!pattern) return;
    stops[static_cast<std::size_t>(walked)][{pattern->projector, pattern->pattern}].push_back(
        {at, met, at_met, c.position});
  };
  for (const Crossing& c : graph.crossings) {
    const auto& a = graph.identities[static_cast<std::size_t>(c.curve_a)].pattern;
    const auto& b = graph.identities[static_cast<std::size_t>(c.curve_b)].pattern;
    if (a && b && *a == *b) continue;
    add(c.curve_a, c.at_a, c.curve_b, c.at_b, c);
    add(c.curve_b, c.at_b, c.curve_a, c.at_a, c);
  }
  for (auto& by_pattern : stops) {
    for (auto& [pattern, list] : by_pattern) {
      std::sort(list.begin(), list.end(), [](const Stop& x, const Stop& y) {
        return std::tie(x.at, x.curve) < std::tie(y.at, y.curve);
      });
    }
  }
  return stops;
}

/// Median of the gaps around gap i (two to either side).
float usual_gap(const std::vector<Stop>& stops, std::size_t i) {
  std::vector<float> gaps;
  const std::size_t low = i >= 2 ? i - 2 : 0;
  for (std::size_t k = low; k <= i + 2 && k + 1 < stops.size(); ++k)
    gaps.push_back(stops[k + 1].at - stops[k].at);
  return lower_quantile(std::move(gaps), 0.5);
}

Vec2 tangent_at(const Curve& curve, float at) {
  const auto n = static_cast<int>(curve.points.size());
  const int i = std::clamp(static_cast<int>(at), 0, n - 1);
  return curve.points[static_cast<std::size_t>(i)].tangent().cast<double>();
}

/// Relation aggregated over all places where it was seen.
struct Edge {
  int from = 0;
  int to = 0;
  int shift = 0;
  double wrong = 0;  ///< probability that the relation says nothing
};

std::vector<Edge> aggregated(const std::vector<NeighborRelation>& relations) {
  std::map<std::tuple<int, int, int>, int> counts;
  for (const NeighborRelation& r : relations) {
    if (r.from < r.to) {
      ++counts[{r.from, r.to, r.shift}];
    } else {
      ++counts[{r.to, r.from, -r.shift}];
    }
  }
  std::vector<Edge> edges;
  for (const auto& [key, count] : counts) {
    const auto [from, to, shift] = key;
    const double single = std::abs(shift) == 1 ? 0.2 : 0.4;
    edges.push_back({from, to, shift, std::max(0.01, std::pow(single, count))});
  }
  return edges;
}

using Belief = std::vector<double>;

void normalize(Belief& belief) {
  double sum = 0;
  for (const double b : belief) sum += b;
  for (double& b : belief) b /= sum;
}

Belief color_belief(const Curve& curve, const ColorFamily& family, const LinePattern& pattern) {
  constexpr double kMaxLogEvidence = 6;  // 1 to 400: the share of curves of two lines; chosen
  const std::size_t colors = family.colors.size();
  std::vector<double> evidence(colors, 0.0);
  for (std::size_t i = 0; i < curve.points.size(); ++i) {
    for (std::size_t c = 0; c < colors; ++c)
      evidence[c] += static_cast<double>(curve.code[i * colors + c]) / kPointsPerMeasurement;
  }
  const double best = *std::max_element(evidence.begin(), evidence.end());
  const std::vector<int> color_of = family.color_of_symbol(pattern);
  Belief belief;
  for (const int symbol : pattern.sequence) {
    const double e =
        evidence[static_cast<std::size_t>(color_of[static_cast<std::size_t>(symbol)])] - best;
    belief.push_back(std::exp(std::max(e, -kMaxLogEvidence)));
  }
  normalize(belief);
  return belief;
}

Belief shifted_message(const Belief& cavity, int shift, double wrong) {
  const int n = static_cast<int>(cavity.size());
  Belief message(cavity.size());
  for (int i = 0; i < n; ++i) {
    message[static_cast<std::size_t>(modulo(i + shift, n))] =
        (1 - wrong) * cavity[static_cast<std::size_t>(i)] + wrong / n;
  }
  return message;
}

}  // namespace

int line_order_sign(const Rig& rig, const Camera& camera, PatternRef ref, const Vec2& pixel,
                    const Vec2& tangent, double depth) {
  const Projector& projector = rig.projectors[static_cast<std::size_t>(ref.projector)];
  const Axis axis = pattern_of(rig, ref).axis;
  const auto across = static_cast<Eigen::Index>(axis);
  const Eigen::Index along = 1 - across;
  const auto here = RayInProjector(camera, projector, pixel).pixel(depth);
  if (!here) return 0;
  const RayInProjector next_ray(camera, projector, pixel + tangent);
  const auto next_depth = next_ray.depth((*here)[across], axis);
  if (!next_depth) return 0;
  const auto next = next_ray.pixel(*next_depth);
  if (!next) return 0;
  const double runs = (*next)[along] - (*here)[along];
  if (runs == 0) return 0;
  // det d(projector)/d(normal, tangent) > 0: for columns (d across/dn)(d along/dt) > 0, for rows
  // its negative.
  const int sense = runs > 0 ? 1 : -1;
  return axis == Axis::kColumn ? sense : -sense;
}

std::vector<NeighborRelation> neighbor_relations(const Rig& rig, const GridGraph& graph) {
  const Camera& camera = rig.cameras[static_cast<std::size_t>(graph.camera)];
  const double depth = (camera.device_from_world * working_volume(rig).center).z();
  std::vector<NeighborRelation> relations;
  const auto stops = stops_of(graph);
  for (const auto& by_pattern : stops) {
    for (const auto& [key, list] : by_pattern) {
      const PatternRef ref{key.first, key.second};
      for (std::size_t i = 0; i + 1 < list.size(); ++i) {
        const Stop& a = list[i];
        const Stop& b = list[i + 1];
        if (a.curve == b.curve) continue;
        const float ratio = (b.at - a.at) / usual_gap(list, i);
        const int lines = static_cast<int>(std::lround(ratio));
        if (lines < 1 || lines > 2 || std::abs(ratio - static_cast<float>(lines)) > 0.4F) continue;
        const Vec2 tangent =
            tangent_at(graph.curves[static_cast<std::size_t>(a.curve)], a.at_curve);
        const Vec2 normal(tangent.y(), -tangent.x());
        const int order =
            line_order_sign(rig, camera, ref, a.position.cast<double>(), tangent, depth);
        const double side = normal.dot((b.position - a.position).cast<double>());
        if (order == 0 || side == 0) continue;
        relations.push_back(
            {a.curve, b.curve, lines * order * (side > 0 ? 1 : -1), a.at_curve, b.at_curve});
      }
    }
  }
  return relations;
}

void infer_local_ids(const Rig& rig, const std::vector<ColorFamily>& families,
                     const std::vector<NeighborRelation>& relations, GridGraph& graph) {
  const std::size_t n = graph.curves.size();
  std::vector<Belief> unary(n);
  for (std::size_t c = 0; c < n; ++c) {
    const auto& ref = graph.identities[c].pattern;
    if (!ref) continue;
    unary[c] =
        color_belief(graph.curves[c], families[static_cast<std::size_t>(graph.curves[c].family)],
                     pattern_of(rig, *ref));
  }
  const std::vector<Edge> edges = aggregated(relations);
  // messages[2 e]: from -> to, messages[2 e + 1]: to -> from.
  std::vector<Belief> messages;
  for (const Edge& e : edges) {
    for (int k = 0; k < 2; ++k)
      messages.emplace_back(unary[static_cast<std::size_t>(e.from)].size(), 1.0);
  }
  std::vector<Belief> beliefs;
  // A message reaches so many crossings far: two periods of 8 lines.
  constexpr int kIterations = 15;
  for (int iteration = 0; iteration <= kIterations; ++iteration) {
    beliefs = unary;
    for (std::size_t e = 0; e < edges.size(); ++e) {
      for (std::size_t i = 0; i < messages[2 * e].size(); ++i) {
        beliefs[static_cast<std::size_t>(edges[e].to)][i] *= messages[2 * e][i];
        beliefs[static_cast<std::size_t>(edges[e].from)][i] *= messages[2 * e + 1][i];
      }
    }
    for (Belief& b : beliefs) {
      if (!b.empty()) normalize(b);
    }
    if (iteration == kIterations) break;
    for (std::size_t e = 0; e < edges.size(); ++e) {
      for (int k = 0; k < 2; ++k) {
        const int source = k == 0 ? edges[e].from : edges[e].to;
        Belief cavity = beliefs[static_cast<std::size_t>(source)];
        const Belief& back = messages[2 * e + static_cast<std::size_t>(1 - k)];
        for (std::size_t i = 0; i < cavity.size(); ++i) cavity[i] /= back[i];
        normalize(cavity);
        Belief next =
            shifted_message(cavity, k == 0 ? edges[e].shift : -edges[e].shift, edges[e].wrong);
        Belief& message = messages[2 * e + static_cast<std::size_t>(k)];
        for (std::size_t i = 0; i < next.size(); ++i) message[i] = 0.4 * message[i] + 0.6 * next[i];
        normalize(message);
      }
    }
  }
  for (std::size_t c = 0; c < n; ++c) {
    if (beliefs[c].empty()) continue;
    const auto best = std::max_element(beliefs[c].begin(), beliefs[c].end());
    graph.identities[c].local_id = static_cast<int>(best - beliefs[c].begin());
    graph.identities[c].id_probability = static_cast<float>(*best);
  }
}

std::vector<Cut> contradicted_connections(const Rig& rig,
                                          const std::vector<NeighborRelation>& relations,
                                          const GridGraph& graph, double min_votes_to_cut) {
  struct Vote {
    float at;
    int id;
    double weight;
  };
  std::vector<std::vector<Vote>> votes(graph.curves.size());
  for (const NeighborRelation& r : relations) {
    const CurveIdentity& from = graph.identities[static_cast<std::size_t>(r.from)];
    const CurveIdentity& to = graph.identities[static_cast<std::size_t>(r.to)];
    if (!from.pattern || !to.pattern) continue;
    const int period = pattern_of(rig, *from.pattern).period();
    if (period < 2) continue;
    votes[static_cast<std::size_t>(r.to)].push_back(
        {r.at_to, modulo(from.local_id + r.shift, period), from.id_probability});
    votes[static_cast<std::size_t>(r.from)].push_back(
        {r.at_from, modulo(to.local_id - r.shift, period), to.id_probability});
  }
  std::vector<Cut> cuts;
  for (std::size_t c = 0; c < votes.size(); ++c) {
    auto& list = votes[c];
    if (list.size() < 4) continue;
    std::sort(list.begin(), list.end(), [](const Vote& x, const Vote& y) {
      return std::tie(x.at, x.id) < std::tie(y.at, y.id);
    });
    const auto period =
        static_cast<std::size_t>(pattern_of(rig, *graph.identities[c].pattern).period());
    std::vector<double> total(period, 0.0);
    for (const Vote& v : list) total[static_cast<std::size_t>(v.id)] += v.weight;
    const double one = *std::max_element(total.begin(), total.end());
    std::vector<double> before(period, 0.0);
    double best_gain = 0;
    float best_at = 0;
    for (std::size_t i = 0; i + 1 < list.size(); ++i) {
      before[static_cast<std::size_t>(list[i].id)] += list[i].weight;
      double after_best = 0;
      for (std::size_t k = 0; k < period; ++k)
        after_best = std::max(after_best, total[k] - before[k]);
      const double gain = *std::max_element(before.begin(), before.end()) + after_best - one;
      if (gain > best_gain) {
        best_gain = gain;
        best_at = 0.5F * (list[i].at + list[i + 1].at);
      }
    }
    if (best_gain >= min_votes_to_cut) cuts.push_back({static_cast<int>(c), best_at});
  }
  return cuts;
}

std::vector<Cut> color_flips(const std::vector<ColorFamily>& families,
                             const std::vector<Curve>& curves, double flip_cost) {
  std::vector<Cut> cuts;
  for (std::size_t c = 0; c < curves.size(); ++c) {
    const std::size_t colors = families[static_cast<std::size_t>(curves[c].family)].colors.size();
    const std::size_t n = curves[c].points.size();
    if (colors < 2 || n < 2) continue;
    // Viterbi over the colours: from[i][k] is the best predecessor of colour k at point i.
    std::vector<double> score(colors, 0.0);
    std::vector<std::size_t> from(n * colors);
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t best =
          static_cast<std::size_t>(std::max_element(score.begin(), score.end()) - score.begin());
      const double switched = score[best] - flip_cost;
      for (std::size_t k = 0; k < colors; ++k) {
        const bool stays = score[k] >= switched;
        from[i * colors + k] = stays ? k : best;
        score[k] = std::max(score[k], switched) +
                   static_cast<double>(curves[c].code[i * colors + k]) / kPointsPerMeasurement;
      }
    }
    auto state =
        static_cast<std::size_t>(std::max_element(score.begin(), score.end()) - score.begin());
    for (std::size_t i = n; i-- > 1;) {
      const std::size_t previous = from[i * colors + state];
      if (previous != state) cuts.push_back({static_cast<int>(c), static_cast<float>(i) - 0.5F});
      state = previous;
    }
  }
  return cuts;
}

}  // namespace pencilscan
