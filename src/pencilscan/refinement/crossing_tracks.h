#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "pencilscan/labeling/labeling.h"

namespace pencilscan {

/// A projected line as a measurement of its projector: points on it have this coordinate.
struct LineOfProjector {
  int projector = 0;
  Axis axis = Axis::kColumn;
  double coordinate_px = 0;
};

/// One camera's view of a surface point. whitening * (projected point - pixel) has unit covariance:
/// its two rows are the distances from the two curves that cross there, over their deviations.
struct CrossingSighting {
  int camera = 0;
  Vec2 pixel = Vec2::Zero();
  Eigen::Matrix2d whitening = Eigen::Matrix2d::Identity();
};

/// A surface point where two projected lines cross, seen by one camera or several.
struct CrossingTrack {
  std::array<LineOfProjector, 2> lines;
  std::vector<CrossingSighting> sightings;  ///< at least one, at most one per camera
  Vec3 point = Vec3::Zero();                ///< in world, with the rig that the labels were made of

  /// Equations that are left when the point is solved for.
  [[nodiscard]] int redundancy() const { return 2 * static_cast<int>(sightings.size()) - 1; }
};

struct TrackOptions {
  double position_factor = 2.2;  ///< real over fitted deviation of a curve: errors are alike along
                                 ///< it (as TriangulationOptions)
  double min_sigma_px = 0.05;    ///< of a curve; > 0
  double same_family_sigma_px = 0.1;  ///< added where two curves of one colour cross: their
                                      ///< profiles disturb each other
  double merge_px = 4;  ///< views of one crossing are one point when it reprojects this closely
  double max_sigma_mm =
      2;  ///< crossings whose point is less certain for 1 px of error are left out
};

/// Residuals as found are at least so large over what deviations predict. Deviations of curves
/// count that errors along one are alike, and whoever adds many crossings counts it once more.
inline constexpr double kLeastResidualScale = 1 / TrackOptions{}.position_factor;

/// The label of the curve at a fractional point index, when both points around it have it; null:
/// they have none, or two. `runs`: of its camera.
[[nodiscard]] const CurveLabel* label_at(std::span<const LabeledRun> runs, int curve, float at);

/// CrossingSighting::whitening of a crossing.
[[nodiscard]] Eigen::Matrix2d crossing_whitening(const GridGraph& graph, const Crossing& x,
                                                 const TrackOptions& options);

/// The crossings of labelled curves of one frame, those of the same two lines seen by several
/// cameras joined, but for those of curves that may hold the light of two lines (like_lines.h).
/// Ordered by lines, then camera: independent of the number of threads.
[[nodiscard]] std::vector<CrossingTrack> crossing_tracks(const Rig& rig,
                                                         std::span<const GridGraph> graphs,
                                                         const Labeling& labeling,
                                                         const TrackOptions& options = {});

/// How far the two planes of labelled crossings miss each other on the camera ray, as the error
/// that one of them would have to have: |w_a - w_b| / hypot(dw_a, dw_b), w the inverse depth
/// and dw its change for one projector pixel (algebraically equation (5) of the paper, in projector
/// px).
struct CrossingDisagreement {
  std::size_t crossings = 0;
  double median_px = 0;
  double expected_px = 0;  ///< median that the noise of the curves alone gives
  /// Of a camera: how far its picture would have to be shifted for its crossings to meet best,
  /// camera px. What a turned camera does, seen through the noise of single crossings.
  std::optional<Vec2> shift_px;
};
[[nodiscard]] CrossingDisagreement crossing_disagreement(const Rig& rig,
                                                         std::span<const CrossingTrack> tracks);
/// The same of the crossings that each device takes part in: the cameras, then the projectors.
[[nodiscard]] std::vector<CrossingDisagreement> device_disagreements(
    const Rig& rig, std::span<const CrossingTrack> tracks);

/// True when there are so many crossings that their median is no chance.
[[nodiscard]] bool are_enough(const CrossingDisagreement& crossings);

/// True when the crossings disagree by more than noise and the labels' own tolerance explain: the
/// devices stand elsewhere than the rig says.
[[nodiscard]] bool disagrees(const CrossingDisagreement& crossings);

}  // namespace pencilscan
