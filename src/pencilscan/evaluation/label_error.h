#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pencilscan/evaluation/line_recall.h"

namespace pencilscan {

/// What the truth says about one vertex of points.ply.
struct PointVerdict {
  bool counted =
      true;  ///< false: repeats (camera, projector, pattern, line, pixel) of an earlier one
  bool right = false;  ///< the label is true
  double line_error_px =
      0;  ///< distance in the image to the true line of the label; right ones only
  double ray_error_mm =
      0;  ///< along the camera ray of (u, v) to the true surface; infinite: missed
  /// Image spacing of the projector's lines at (u, v); nothing where it does not light.
  std::optional<double> spacing_px;
};

/// True for the points of a Gray-code scan (`pencilscan scan`), whose `line` is no line but the
/// column of the projector's panel: they lie on whole camera pixels, where curves never all lie,
/// all with pattern 0 and full confidence, and `line` is the fractional `plane`, rounded.
[[nodiscard]] bool are_of_gray_scan(std::span<const MeasuredPoint> points);

struct LabelOptions {
  double disc_px = 1;             ///< radius of the disc of camera rays that may find the line
  double tolerance_px = 1;        ///< of the true line coordinate, by its local gradient,
  double tolerance_lines = 0.15;  ///< or this, whichever is more
};

/// Judges every vertex by ray tracing: the centre of the disc first, then rings at half and at its
/// whole radius. Needs camera, projector and pattern within the rig.
[[nodiscard]] std::vector<PointVerdict> judge_points(const TruthScene& truth,
                                                     std::span<const MeasuredPoint> points,
                                                     const LabelOptions& options = {});

/// Verdicts of points without lines: errors along the camera rays alone. Needs camera within the
/// rig.
[[nodiscard]] std::vector<PointVerdict> judge_rays(const TruthScene& truth,
                                                   std::span<const MeasuredPoint> points);

/// Vertices whose confidence lies in [low, next band's low): is their share of right labels what
/// they say?
struct ConfidenceBand {
  double low = 0;
  double confidence_sum = 0;
  Share right;

  /// Of a band with vertices.
  [[nodiscard]] double mean_confidence() const {
    return confidence_sum / static_cast<double>(right.count);
  }
};

/// Label error as docs/figures.md defines it: the share is of *wrong* vertices.
struct LabelFigures {
  Share wrong;
  std::vector<Share> wrong_by_projector;
  std::vector<Share> wrong_by_spacing;  ///< kSpacingBandCount bands
  Share wrong_unlit;                    ///< vertices where the projector does not light at (u, v)
  std::vector<ConfidenceBand> right_by_confidence;
  double line_error_median_px = 0;  ///< of the right ones
  double line_error_p90_px = 0;
  double largest_wrong_patch_mm2 = 0;
};
[[nodiscard]] LabelFigures label_figures(const TruthScene& truth,
                                         std::span<const MeasuredPoint> points,
                                         std::span<const PointVerdict> verdicts);

/// Area on the true surface of the largest connected patch of wrong vertices. In each camera and
/// for each channel a pixel belongs to its nearest vertex within half a line spacing (plus a
/// pixel); pixels of wrong vertices are connected to their four neighbours unless the depth steps
/// between.
[[nodiscard]] double largest_wrong_patch_mm2(const TruthScene& truth,
                                             std::span<const MeasuredPoint> points,
                                             std::span<const PointVerdict> verdicts);

/// Of errors along the camera ray. Counts every counted vertex with sigma > 0; a ray that misses
/// the true surface is an error beyond any sigma.
[[nodiscard]] SigmaFigures sigma_figures(std::span<const MeasuredPoint> points,
                                         std::span<const PointVerdict> verdicts);

}  // namespace pencilscan
