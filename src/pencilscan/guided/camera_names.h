#pragma once

#include <span>
#include <vector>

#include "pencilscan/detection/curve.h"
#include "pencilscan/guided/guided_matching.h"
#include "pencilscan/guided/line_chains.h"
#include "pencilscan/guided/named_points.h"
#include "pencilscan/guided/predicted_places.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {

/// What guided matching knows of one camera: the curves that have a name, the surface that they
/// show, and the lines that it lets expect. Names are added by accept(); predict() then looks at
/// the surface anew.
class CameraNames {
 public:
  /// `runs`: the camera's, kept up to date. `dense`: as in match_guided().
  CameraNames(const Rig& rig, const std::vector<ColorFamily>& families, GridGraph& graph,
              std::vector<LabeledRun>& runs, const GuidedMatchingOptions& options,
              std::span<const MeasuredPoint> dense);
  CameraNames(const CameraNames&) = delete;
  CameraNames& operator=(const CameraNames&) = delete;

  /// Adds runs to what is labelled.
  void accept(std::vector<LabeledRun> news);
  /// Predicts all lines on the surface of what is labelled; keeps those that no labelled point
  /// shows.
  void predict();
  /// Predicted points that no curve shows by now, in chains.
  [[nodiscard]] std::vector<LineChain> still_missing();
  /// The surface of all that is labelled now.
  [[nodiscard]] LocalSurface take_surface();

  [[nodiscard]] const Camera& camera() const { return camera_; }
  [[nodiscard]] GridGraph& graph() const { return graph_; }
  [[nodiscard]] const Curve& curve(int index) const {
    return graph_.curves[static_cast<std::size_t>(index)];
  }
  /// By curve, then by place on it.
  [[nodiscard]] const std::vector<LabeledRun>& runs() const { return runs_; }
  [[nodiscard]] const NamedPoints& named() const { return named_; }
  /// The predicted points that no label explained when predict() was called.
  [[nodiscard]] const PredictedPlaces& missing_places() const { return missing_places_; }
  /// The predicted points that a named one showed then.
  [[nodiscard]] std::span<const PredictedPoint> shown() const { return shown_; }
  /// Per projector, since predict() was called first.
  [[nodiscard]] const std::vector<ExpectedLines>& expected() const { return expected_; }

  /// The surface does not rest on labels alone.
  [[nodiscard]] bool has_dense() const { return has_dense_; }
  /// Of a predicted point: not on a floor or wall.
  [[nodiscard]] bool is_of_object(const PredictedPoint& p) const {
    return shows_object_[p.patch] != 0;
  }
  /// True where a label puts a point of its curve where the object can be.
  [[nodiscard]] bool is_of_object(const LabeledRun& run, int at) const;
  /// The surface where a point was predicted is not what it was at the last predict().
  [[nodiscard]] bool is_new(const PredictedPoint& p) const {
    return surface_.refitted()[p.patch] != 0;
  }
  /// Some place on the surface is of a floor or wall.
  [[nodiscard]] bool shows_background() const { return shows_background_; }
  /// True where a point of a curve lies on the predicted line of that name alone, as bright as
  /// those around, which are known.
  [[nodiscard]] bool fits(const CurvePoint& point, const LineName& name, int family) const;
  /// Per curve and point: it has a name.
  [[nodiscard]] std::vector<std::vector<char>> decided_points() const;
  /// Points [begin, end) of a curve under a name that the surface gave.
  [[nodiscard]] LabeledRun run_of(int curve, int begin, int end, const LineName& name) const {
    return {
        curve, begin, end,
        CurveLabel{name.pattern, name.line, static_cast<double>(name.line), options_.confidence}};
  }

 private:
  void grow_surface();

  const Rig& rig_;
  const Camera& camera_;
  GridGraph& graph_;
  std::vector<LabeledRun>& runs_;
  const GuidedMatchingOptions& options_;
  std::vector<PatternRef> patterns_;  ///< that the camera can see
  ObjectSpace space_;
  LocalSurface surface_;
  std::vector<char> shows_object_;  ///< per patch, 0: floors and walls
  bool shows_background_ = false;   ///< some patch did
  bool has_dense_;
  std::vector<MeasuredPoint> dense_;        ///< more points, not on the surface yet
  std::vector<LabeledRun> not_on_surface_;  ///< runs whose points it does not hold yet
  NamedPoints named_;
  std::vector<PredictedPoint> missing_;  ///< predicted points that no label explains
  std::size_t not_shown_by_ = 0;         ///< so many named points do not show any of those
  std::vector<PredictedPoint> shown_;    ///< those that one does
  PredictedPlaces missing_places_;       ///< those as of the last predict()
  std::vector<ExpectedLines> expected_;
};

}  // namespace pencilscan
