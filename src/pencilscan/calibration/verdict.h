#pragma once

#include <vector>

#include "pencilscan/bundle/uncertainty.h"
#include "pencilscan/calibration/calibrate.h"
#include "pencilscan/calibration/finding.h"
#include "pencilscan/calibration/rig_frame.h"

namespace pencilscan {

struct Verdict {
  Grade grade = Grade::kGood;  ///< the worst of the findings
  std::vector<Finding> findings;

  /// What made it this grade; nothing of a good one.
  [[nodiscard]] std::vector<std::string> reasons() const;
};

struct VerdictOptions {
  /// A scene with more on one plane per pair fixes no rig: what is left of it are as many wrong
  /// codes.
  double planar_share = 0.97;
  double mostly_planar_share = 0.7;  ///< is told as the reason where a rig is known weakly
  double good_rms_px = 0.4;          ///< of all views
  double usable_rms_px = 1.5;
  /// Over the focal length, beside the tolerance of given K, which counts up to as much.
  double good_focal_sigma = 0.005;
  double usable_focal_sigma = 0.05;
  double good_volume_sigma = 0.002;  ///< of a point, over the radius of what was measured
  double usable_volume_sigma = 0.03;
  /// Of lengths in the volume. Beyond it, the rig's shape makes the scale worse than a tape does.
  /// Never unusable: a rig without any scale measures shapes as well.
  double good_scale_sigma = kTapeDeviation;
  double low_inlier_share = 0.7;  ///< of a pair
  double trend_px = 0.15;         ///< mean error in a part of the image
};

/// Mean residual in one cell of a device's image.
struct TrendCell {
  int views = 0;
  Vec2 mean = Vec2::Zero();  ///< px
};
/// 4 x 4 cells per device, row by row.
[[nodiscard]] std::vector<std::vector<TrendCell>> residual_trends(const CalibrationResult& result);

/// Judges a result. `found_before`: what was already noticed in the images (orders, missing files).
[[nodiscard]] Verdict judge(const CalibrationInput& input, const CalibrationResult& result,
                            const Uncertainty& uncertainty, std::vector<Finding> found_before,
                            const VerdictOptions& options = {});

}  // namespace pencilscan
