#include "pencilscan/grid/grid_graph.h"

#include <algorithm>

#include "pencilscan/core/disjoint_sets.h"
#include "pencilscan/core/median.h"
#include "pencilscan/grid/local_ids.h"
#include "pencilscan/grid/projector_votes.h"

namespace pencilscan {
namespace {

constexpr std::size_t kMinPoints = 5;

/// Curves cut at the given places; remainders below kMinPoints are dropped.
std::vector<Curve> cut_curves(const std::vector<Curve>& curves, std::vector<Cut> cuts,
                              const std::vector<ColorFamily>& families) {
  std::sort(cuts.begin(), cuts.end(), [](const Cut& a, const Cut& b) {
    return std::tie(a.curve, a.at) < std::tie(b.curve, b.at);
  });
  std::vector<Curve> result;
  std::size_t next = 0;
  for (std::size_t c = 0; c < curves.size(); ++c) {
    const Curve& curve = curves[c];
    const std::size_t colors = families[static_cast<std::size_t>(curve.family)].colors.size();
    std::size_t begin = 0;
    const auto finish = [&](std::size_t end) {
      if (end >= begin + kMinPoints) {
        Curve piece;
        piece.family = curve.family;
        const auto at = [](std::size_t i) { return static_cast<std::ptrdiff_t>(i); };
        piece.points.assign(curve.points.begin() + at(begin), curve.points.begin() + at(end));
        piece.code.assign(curve.code.begin() + at(begin * colors),
                          curve.code.begin() + at(end * colors));
        result.push_back(std::move(piece));
      }
      begin = end;
    };
    for (; next < cuts.size() && cuts[next].curve == static_cast<int>(c); ++next) {
      finish(std::min(curve.points.size(), static_cast<std::size_t>(cuts[next].at) + 1));
    }
    finish(curve.points.size());
  }
  return result;
}

void identify(const Rig& rig, const std::vector<ColorFamily>& families, const GridOptions& options,
              GridGraph& graph, std::vector<NeighborRelation>& relations) {
  const Camera& camera = rig.cameras[static_cast<std::size_t>(graph.camera)];
  graph.crossings =
      find_crossings(graph.curves, {camera.width, camera.height}, options.min_angle_rad);
  // Lines of one pattern do not cross.
  std::erase_if(graph.crossings, [&](const Crossing& x) {
    const int family = graph.curves[static_cast<std::size_t>(x.curve_a)].family;
    return family == graph.curves[static_cast<std::size_t>(x.curve_b)].family &&
           families[static_cast<std::size_t>(family)].patterns.size() < 2;
  });
  if (!options.identify) return;
  vote_for_projectors(rig, families, options, graph);
  relations = neighbor_relations(rig, graph);
  infer_local_ids(rig, families, relations, graph);
}

void find_components(GridGraph& graph) {
  DisjointSets sets(graph.curves.size());
  std::vector<char> connected(graph.curves.size(), 0);
  for (const Crossing& x : graph.crossings) {
    if (!graph.identities.empty()) {
      const auto& a = graph.identities[static_cast<std::size_t>(x.curve_a)].pattern;
      const auto& b = graph.identities[static_cast<std::size_t>(x.curve_b)].pattern;
      if (!a || !b || *a == *b) continue;
    }
    connected[static_cast<std::size_t>(x.curve_a)] =
        connected[static_cast<std::size_t>(x.curve_b)] = 1;
    sets.join(x.curve_a, x.curve_b);
  }
  std::vector<int> number(graph.curves.size(), -1);
  graph.component_of_curve.assign(graph.curves.size(), -1);
  graph.component_count = 0;
  for (std::size_t c = 0; c < graph.curves.size(); ++c) {
    if (connected[c] == 0) continue;
    int& n = number[static_cast<std::size_t>(sets.root(static_cast<int>(c)))];
    if (n < 0) n = graph.component_count++;
    graph.component_of_curve[c] = n;
  }
}

}  // namespace

std::size_t curve_points(const GridGraph& graph) {
  std::size_t count = 0;
  for (const Curve& curve : graph.curves) count += curve.points.size();
  return count;
}

double median_of_points(std::span<const GridGraph> graphs, float CurvePoint::*figure) {
  std::vector<double> values;
  for (const GridGraph& graph : graphs)
    for (const Curve& curve : graph.curves)
      for (const CurvePoint& point : curve.points)
        if (point.*figure > 0) values.push_back(point.*figure);
  return upper_median(std::move(values));
}

GridGraph build_grid_graph(const Rig& rig, const std::vector<ColorFamily>& families, int camera,
                           std::vector<Curve> curves, const GridOptions& options) {
  GridGraph graph;
  graph.camera = camera;
  // A curve that changes colour has jumped to another line.
  const std::vector<Cut> flips = color_flips(families, curves, options.flip_cost);
  graph.cut_connections = flips.size();
  graph.curves = cut_curves(curves, flips, families);
  std::vector<NeighborRelation> relations;
  identify(rig, families, options, graph, relations);
  // So has one whose neighbours disagree about its ID on two stretches.
  const std::vector<Cut> cuts =
      contradicted_connections(rig, relations, graph, options.min_votes_to_cut);
  if (!cuts.empty()) {
    graph.cut_connections += cuts.size();
    graph.curves = cut_curves(graph.curves, cuts, families);
    identify(rig, families, options, graph, relations);
  }
  find_components(graph);
  return graph;
}

}  // namespace pencilscan
