#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pencilscan/grid/grid_graph.h"

namespace pencilscan {

/// Which projected line a curve is, according to a solution.
struct CurveLabel {
  PatternRef pattern;
  int line = 0;
  double plane = 0;      ///< line coordinate that is triangulated
  float confidence = 0;  ///< 0..1
};

/// What a solution says of one connected component of one camera.
struct ComponentReport {
  int camera = 0;
  int curves = 0;
  int crossings = 0;
  bool solved = false;
  std::string reason;          ///< why not, in plain words
  double sigma_min = 0;        ///< smallest singular value of the scaled M, px per line
  double sigma_second = 0;     ///< the next one
  double residual_rms_px = 0;  ///< of equations (6), as image distance
  // Multi-view only:
  std::vector<double> sweep_s;  ///< lines of the most moving curve
  std::vector<double> sweep_cost;
  double best_s = 0;
  double margin = 0;  ///< second minimum of the cost minus the first
};

/// Result of a solution over all cameras: labels[camera][curve]; nothing = undecided.
struct Labeling {
  std::vector<std::vector<std::optional<CurveLabel>>> labels;
  std::vector<ComponentReport> components;
};

enum class Method { kLinear, kMultiview };
[[nodiscard]] std::optional<Method> method_from_name(std::string_view name);

enum class MultiviewCost {
  kPublished,   ///< sum of distances over matched points: favours few matches
  kNormalized,  ///< mean over all reprojected points, unmatched ones counting as the search radius
};

struct SolutionOptions {
  Method method = Method::kMultiview;
  MultiviewCost cost = MultiviewCost::kNormalized;
  double search_radius_px = 8;  ///< reprojected point to detected curve; > 0
  double step_lines = 0.25;     ///< sweep step of the most moving curve; > 0
  int point_stride = 3;         ///< every how many curve points are reprojected; >= 1
};

/// Decides the line of every curve. This is the seam for solution methods: all take the grid graphs
/// of all cameras and give a Labeling.
[[nodiscard]] Labeling solve(const Rig& rig, std::span<const GridGraph> graphs,
                             const SolutionOptions& options = {});

/// The line nearest to a continuous coordinate that has this local ID (any if negative), limited to
/// the pattern.
[[nodiscard]] int nearest_line(double coordinate, int local_id, int period, int line_count);

}  // namespace pencilscan
