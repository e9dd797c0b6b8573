#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Which projected line a curve is, according to a solution.
struct CurveLabel {
  PatternRef pattern;
  int line = 0;
  double plane = 0;      ///< line coordinate that is triangulated
  float confidence = 0;  ///< 0..1
};

/// Where the ray of a camera's pixel meets the sheet of light of a line; nothing where it does not.
[[nodiscard]] std::optional<Vec3> place_on_line(const Rig& rig, const Camera& camera,
                                                const Vec2& pixel, const CurveLabel& label);

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

/// A stretch of a curve that a solution left undecided. Guided matching may have labelled some of
/// it.
struct UndecidedRun {
  int curve = 0;
  int begin = 0;  ///< first point
  int end = 0;    ///< one past the last
  UndecidedReason reason = UndecidedReason::kAmbiguous;
};

/// A stretch of a curve that lies where a surface predicts a line, and has another line's colour.
struct DeniedRun {
  LabeledRun predicted;  ///< the stretch, as the surface would have it
  float spacing_px = 0;  ///< of the lines there, in the picture
};

/// Of the lines of a projector, 5 px apart at least, that a surface lets a camera expect where
/// nothing shades it: points, and those with that name.
struct ExpectedLines {
  std::size_t points = 0;
  std::size_t named = 0;

  void add(const ExpectedLines& other) {
    points += other.points;
    named += other.named;
  }
};

/// Result of a solution over all cameras; curve points in no run are undecided.
struct Labeling {
  std::vector<std::vector<LabeledRun>> runs;  ///< per camera, ordered by (curve, begin), disjoint
  /// Per camera, the likeliest labels of undecided stretches; joint only.
  std::vector<std::vector<LabeledRun>> tentative;
  std::vector<ComponentReport> components;           ///< all but joint
  std::vector<std::vector<UndecidedRun>> undecided;  ///< per camera; joint only
  std::vector<std::vector<DeniedRun>> denied;  ///< per camera; guided matching on a dense surface
  /// Per camera and projector, as guided matching begins.
  std::vector<std::vector<ExpectedLines>> expected;
};

[[nodiscard]] std::size_t labelled_points(std::span<const LabeledRun> runs);
/// Of all cameras.
[[nodiscard]] std::size_t labelled_points(const Labeling& labeling);

/// Adds a run, whose points are those of no other undecided run from here on.
void add_undecided(const UndecidedRun& run, std::vector<UndecidedRun>& undecided);

/// Points of undecided runs that no labelled run holds, per reason (the order of the enum).
[[nodiscard]] std::array<std::size_t, 4> undecided_points(std::span<const UndecidedRun> undecided,
                                                          std::span<const LabeledRun> labelled);

}  // namespace pencilscan
