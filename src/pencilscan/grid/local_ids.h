#pragma once

#include <vector>

#include "pencilscan/grid/grid_graph.h"

namespace pencilscan {

/// "Curve `to` lies `shift` lines after curve `from`" (same pattern), seen along crossing curves.
struct NeighborRelation {
  int from = 0;
  int to = 0;
  int shift = 1;      ///< signed, in lines
  float at_from = 0;  ///< where along `from` it was seen
  float at_to = 0;
};

/// +1 when the line coordinate of `ref` grows along the image normal (t.y, -t.x) of a curve with
/// unit tangent t at `pixel`, -1 when it falls. A surface seen by both devices maps camera to
/// projector image without mirroring, so that the sense in which the curve runs along its light
/// sheet decides.
[[nodiscard]] int line_order_sign(const Rig& rig, const Camera& camera, PatternRef ref,
                                  const Vec2& pixel, const Vec2& tangent, double depth);

/// Neighbouring curves of one pattern: consecutive crossings along a curve of another pattern, a
/// double gap counting two lines.
[[nodiscard]] std::vector<NeighborRelation> neighbor_relations(const Rig& rig,
                                                               const GridGraph& graph);

/// Local IDs (line index modulo the period) by sum-product belief propagation: each curve's colour
/// evidence, and neighbours one line further. Fills CurveIdentity::local_id and id_probability.
void infer_local_ids(const Rig& rig, const std::vector<ColorFamily>& families,
                     const std::vector<NeighborRelation>& relations, GridGraph& graph);

/// A place where a curve changes from one line to another.
struct Cut {
  int curve = 0;
  float at = 0;
};

/// Curves whose neighbours on one stretch say one local ID and on the next another.
[[nodiscard]] std::vector<Cut> contradicted_connections(
    const Rig& rig, const std::vector<NeighborRelation>& relations, const GridGraph& graph,
    double min_votes_to_cut);

/// Places where the colour of a curve flips: two-state dynamic programming with a cost per flip.
[[nodiscard]] std::vector<Cut> color_flips(const std::vector<ColorFamily>& families,
                                           const std::vector<Curve>& curves, double flip_cost);

}  // namespace pencilscan
