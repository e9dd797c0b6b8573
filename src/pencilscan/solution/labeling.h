#pragma once

#include <Eigen/Core>
#include <array>
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
  // Where one degree of freedom is searched (multi-view, single projector):
  std::vector<double> sweep_s;  ///< lines of the most moving curve
  std::vector<double> sweep_cost;
  double best_s = 0;
  double margin = 0;  ///< second minimum of the cost minus the first
};

/// A stretch of a curve with one label.
struct LabeledRun {
  int curve = 0;
  int begin = 0;  ///< first point
  int end = 0;    ///< one past the last
  CurveLabel label;
};

enum class UndecidedReason {
  kNoCrossing,     ///< nothing crosses it, and its surroundings do not decide
  kAmbiguous,      ///< several lines fit
  kContradicted,   ///< no line fits its crossings
  kOutsideVolume,  ///< no line meets its rays in the volume
};

/// A stretch of a curve that a solution left undecided; a second look may have labelled some of it.
struct UndecidedRun {
  int curve = 0;
  int begin = 0;  ///< first point
  int end = 0;    ///< one past the last
  UndecidedReason reason = UndecidedReason::kAmbiguous;
};

/// Result of a solution over all cameras; curve points in no run are undecided.
struct Labeling {
  std::vector<std::vector<LabeledRun>> runs;  ///< per camera, ordered by (curve, begin), disjoint
  /// Per camera, the likeliest labels of undecided stretches; joint only.
  std::vector<std::vector<LabeledRun>> tentative;
  std::vector<ComponentReport> components;           ///< all but joint
  std::vector<std::vector<UndecidedRun>> undecided;  ///< per camera; joint only
};

[[nodiscard]] std::size_t labelled_points(std::span<const LabeledRun> runs);
/// Of all cameras.
[[nodiscard]] std::size_t labelled_points(const Labeling& labeling);

/// Points of undecided runs that no labelled run holds, per reason (the order of the enum).
[[nodiscard]] std::array<std::size_t, 4> undecided_points(std::span<const UndecidedRun> undecided,
                                                          std::span<const LabeledRun> labelled);

enum class Method { kLinear, kMultiview, kJoint, kSingleProjector };
[[nodiscard]] std::optional<Method> method_from_name(std::string_view name);

enum class MultiviewCost {
  kPublished,   ///< sum of distances over matched points: favours few matches
  kNormalized,  ///< mean over all reprojected points, unmatched ones counting as the search radius
};

/// How joint labelling minimises its energy: min-sum messages (min_sum.h), or the labels of whole
/// clusters tried one by one (cluster_enumeration.h), for comparison.
enum class Inference { kMessages, kClusters };

struct JointOptions {
  Inference inference = Inference::kMessages;
  int piece_length = 24;  ///< points labelled as one; >= 4
  int max_labels = 24;    ///< kept per piece before messages are passed; >= 2; more where
                          ///< many patterns share a colour or nothing crosses
  double projection_sigma_px = 0.3;  ///< error of a plane, projector px; > 0
  double crossing_outliers = 0.05;   ///< share of crossings that are none
  double max_color_cost = 4;         ///< log-likelihood ratio that a piece's colour can give
  double change_cost = 4;            ///< of a curve that jumps from one line to another
  int passes = 2;                    ///< message passing, then what the cameras say of each other
  int rounds = 4;                    ///< of messages in a pass
  double damping = 0.3;              ///< share of the old message kept, [0, 1)
  double min_confidence = 0.955;     ///< pieces below stay undecided

  /// Cost of a crossing whose planes do not meet.
  [[nodiscard]] float disagreement_cost() const;
};

struct SolutionOptions {
  Method method = Method::kJoint;
  JointOptions joint;
  MultiviewCost cost = MultiviewCost::kNormalized;
  double search_radius_px = 8;  ///< reprojected point to detected curve; > 0
  double step_lines = 0.25;     ///< sweep step of the most moving curve; > 0
  int point_stride = 3;         ///< every how many curve points are reprojected; >= 1
};

/// Decides the line of every curve. This is the seam for solution methods: all take the grid graphs
/// of all cameras and give a Labeling.
[[nodiscard]] Labeling solve(const Rig& rig, const std::vector<ColorFamily>& families,
                             std::span<const GridGraph> graphs,
                             const SolutionOptions& options = {});

/// The line nearest to a continuous coordinate that has this local ID (any if negative), limited to
/// the pattern.
[[nodiscard]] int nearest_line(double coordinate, int local_id, int period, int line_count);

}  // namespace pencilscan
