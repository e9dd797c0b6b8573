#include "pencilscan/calibration/scale_findings.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "pencilscan/calibration/scale_deviation.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/length_units.h"
#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

class ScaleJudge {
 public:
  ScaleJudge(const CalibrationInput& input, const CalibrationResult& result,
             const Uncertainty& uncertainty, const FlatScene& scene, const VerdictOptions& options)
      : input_(input),
        result_(result),
        uncertainty_(uncertainty),
        scene_(scene),
        options_(options) {}

  std::vector<Finding> findings() {
    if (!input_.board_views.empty() && result_.problem.board_views.empty())
      add(Grade::kDoubtful, "the board was seen, but not placed: too few correspondences lie on it",
          "let a projector light the board while a camera sees all of it");
    if (!result_.rig.unit_known)
      add(Grade::kGood, "the scale is not known: the rig's unit is \"unknown\"",
          "give --known-distance" + best_pair_text() + ", or a --board");
    judge_scale_deviation();
    if (result_.board_times) judge_board_lengths(*result_.board_times);
    if (result_.given_times) judge_given_lengths(*result_.given_times);
    judge_volume();
    judge_given_places();
    return std::move(findings_);
  }

 private:
  void add(Grade grade, const std::string& what, const std::string& advice) {
    findings_.push_back({grade, what, advice});
  }
  [[nodiscard]] const std::string& name(std::size_t d) const {
    return device_at(input_.rig, d).name;
  }

  /// Which distance would fix the scale best, and to what.
  [[nodiscard]] std::string best_pair_text() const {
    const auto best = best_distance(result_, uncertainty_);
    if (!best) return {};
    return " of " + name(best->devices[0]) + " and " + name(best->devices[1]) +
           ", with which lengths are known to " + share_text(best->share);
  }

  [[nodiscard]] std::string given_length(const ScaleDeviation& scale) const {
    switch (scale.from) {
      case ScaleDeviation::From::kDistance:
        return "the distance of " + name(scale.devices[0]) + " and " + name(scale.devices[1]);
      case ScaleDeviation::From::kBoard:
        return "the board";
      case ScaleDeviation::From::kPoses:
        return "the given poses";
    }
    return {};
  }

  void judge_scale_deviation() {
    const auto scale = scale_deviation(input_, result_, uncertainty_);
    if (!scale || scale->share <= options_.good_scale_sigma) return;
    const auto best = best_distance(result_, uncertainty_);
    // Deviations are stated to a fifth (docs/calibration.md, "Deviations").
    constexpr double kClearly = 0.8;
    const bool another_helps = best && best->share < kClearly * scale->share;
    const std::string captures = "add captures that fill the volume, or give K of the cameras";
    std::string what_to_do =
        another_helps ? "give --known-distance" + best_pair_text() : scene_.advice(captures);
    if (another_helps && best->share > options_.good_scale_sigma) what_to_do += "; " + captures;
    add(Grade::kDoubtful,
        "the scale is known weakly: lengths in the volume to " + share_text(scale->share) +
            " (one standard deviation) by " + given_length(*scale) + scene_.reason(),
        what_to_do);
  }

  /// Of what is `factor` times as long by `measured` as by `other`: what is too short is in the
  /// larger unit.
  [[nodiscard]] static std::string unit_behind(double factor, const std::string& other,
                                               const std::string& measured) {
    constexpr double kUnitTolerance = 0.1;
    const UnitFactor* unit = unit_behind_factor(std::max(factor, 1 / factor), kUnitTolerance);
    if (unit == nullptr) return {};
    return "; " + (factor > 1 ? other : measured) + " is probably in " + unit->words;
  }

  void judge_board_lengths(double factor) {
    add(Grade::kDoubtful,
        "the known distance and the board contradict each other: by the known distance, which "
        "counts, lengths are " +
            formatted(factor, "%.3g") + " times those by the board" +
            unit_behind(factor, "the board", "the known distance"),
        "measure a square of the board, and the distance of the lenses of these two devices");
  }

  /// A distance or a board against given poses, all in millimetres.
  void judge_given_lengths(double factor) {
    const std::string measured = input_.distance ? "known distance" : "board";
    std::string what = "the " + measured + " and the given poses contradict each other: by the " +
                       measured + ", lengths are " + formatted(factor, "%.3g") +
                       " times those of t. Poses, volume and floor were multiplied by it";
    what += unit_behind(factor, "t", "the " + measured);
    add(Grade::kDoubtful, what, "give the " + measured + " and t in mm");
  }

  /// Nothing else may tell the unit of a distance: objects mostly fill the volume that is stated. A
  /// small one is no fault, so this is a note.
  void judge_volume() {
    constexpr double kFar = 5;
    constexpr double kMost = 0.9;  // of the points; the others may lie on what stands around
    if (!input_.rig.volume || !result_.rig.unit_known || result_.given_times) return;
    const Vec3 middle = middle_of_points(result_.problem);
    std::vector<double> distances;
    for (std::size_t t = 0; t < result_.problem.points.size(); ++t)
      if (result_.problem.used[t] != 0)
        distances.push_back((result_.problem.points[t] - middle).norm());
    const double reach = lower_quantile(std::move(distances), kMost);
    const double stated = input_.rig.volume->radius;
    if (!(reach > 0) || (stated < kFar * reach && reach < kFar * stated)) return;
    add(Grade::kGood,
        "what was measured reaches " + formatted(reach) +
            " mm from its middle, the volume of the devices file " + formatted(stated) +
            " mm: if it fills the volume, the unit of the lengths is another",
        "give distances, squares of boards and t in mm");
  }

  void judge_given_places() {
    std::string lost = result_.has_lost_volume ? "volume" : "";
    if (result_.has_lost_floor) lost += lost.empty() ? "floor" : " and floor";
    if (lost.empty()) return;
    add(Grade::kGood,
        lost +
            " of the devices file were left out: fewer than three of its poses are known, so "
            "the rig has a frame of its own",
        "state them in the rig's frame, or give three poses");
  }

  const CalibrationInput& input_;
  const CalibrationResult& result_;
  const Uncertainty& uncertainty_;
  const FlatScene& scene_;
  const VerdictOptions& options_;
  std::vector<Finding> findings_;
};

}  // namespace

std::vector<Finding> scale_findings(const CalibrationInput& input, const CalibrationResult& result,
                                    const Uncertainty& uncertainty, const FlatScene& scene,
                                    const VerdictOptions& options) {
  return ScaleJudge(input, result, uncertainty, scene, options).findings();
}

}  // namespace pencilscan
