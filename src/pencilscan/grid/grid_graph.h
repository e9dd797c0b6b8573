#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pencilscan/detection/detect.h"
#include "pencilscan/grid/crossings.h"
#include "pencilscan/grid/line_candidates.h"
#include "pencilscan/grid/lit_cells.h"

namespace pencilscan {

/// What the grid says of a curve before its line is known.
struct CurveIdentity {
  std::optional<PatternRef> pattern;  ///< the pencil it belongs to
  int local_id = -1;                  ///< line index modulo the pattern's period; -1: not decided
  float id_probability = 0;
};

/// The grid graph of one camera: nodes are crossings, edges run along curves between them.
struct GridGraph {
  int camera = 0;
  std::vector<Curve> curves;
  std::vector<Crossing> crossings;
  std::vector<CurveIdentity> identities;  ///< one per curve; empty where options.identify is off
  std::vector<int> component_of_curve;    ///< -1: no crossing with another projector's curve
  int component_count = 0;
  std::size_t cut_connections = 0;  ///< wrong connections cut by code or neighbours
  LitCells lit;                     ///< where the camera sees light at all; may be unknown
};

[[nodiscard]] std::size_t curve_points(const GridGraph& graph);
/// The median of a figure of all curve points that have it (above 0); 0 without any.
[[nodiscard]] double median_of_points(std::span<const GridGraph> graphs, float CurvePoint::*figure);

struct GridOptions {
  bool identify = true;         ///< decide pattern and local ID of each curve on its own
  double min_angle_rad = 0.26;  ///< flatter crossings are not used
  double projection_sigma_px =
      0.5;                        ///< calibration and detection, projector px, for projector votes
  double flip_cost = 8;           ///< log-evidence needed to cut a curve at a colour change
  double min_votes_to_cut = 2.5;  ///< contradicting neighbours needed to cut a curve
};

/// Crossings, projector of each curve, local de Bruijn IDs from neighbouring curves; wrong
/// connections are cut; connected components.
[[nodiscard]] GridGraph build_grid_graph(const Rig& rig, const std::vector<ColorFamily>& families,
                                         int camera, std::vector<Curve> curves,
                                         const GridOptions& options = {});

}  // namespace pencilscan
