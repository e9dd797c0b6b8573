#pragma once

#include <span>
#include <vector>

#include "pencilscan/evaluation/statistics.h"
#include "pencilscan/evaluation/true_lines.h"
#include "pencilscan/labeling/measured_point.h"

namespace pencilscan {

/// A detected curve point without a label.
struct DetectedPoint {
  int camera = 0;
  double u = 0;  ///< camera pixel
  double v = 0;
};

/// Bands of image line spacing that the figures are broken down by, px.
inline constexpr double kSpacingBandEdges[] = {3, 5, 8, 12};
inline constexpr std::size_t kSpacingBandCount = 5;
/// Index of the band: 0 is below 3 px, 4 is 12 px and more.
[[nodiscard]] std::size_t spacing_band(double spacing_px);

struct RecallOptions {
  double radius_px = 1.5;         ///< a point within it finds the line pixel
  double min_spacing_px = 5;      ///< lower bound of what counts
  double dense_spacing_px = 3;    ///< lower bound of what is quoted beside it
  double max_incidence_deg = 75;  ///< to the camera and to the projector
};

/// Line recall as docs/figures.md defines it.
struct RecallFigures {
  Share recall;        ///< spacing >= 5 px
  Share recall_dense;  ///< 3 to 5 px
  Share any_line;      ///< spacing >= 5 px, any line of any projector with the same colours counts
  std::vector<Share> by_projector;  ///< spacing >= 5 px
  std::vector<Share> by_spacing;    ///< kSpacingBandCount bands
};
[[nodiscard]] RecallFigures line_recall(const Rig& rig, std::span<const TrueLinePixel> truth,
                                        std::span<const MeasuredPoint> points,
                                        const RecallOptions& options = {});

/// Figures of unlabelled curves of one colour family.
struct DetectionFigures {
  Share recall;        ///< of the true line pixels of the family, spacing >= 5 px
  Share recall_dense;  ///< 3 to 5 px
  Share spurious;      ///< of the detected points: no true line of the family within radius_px
  double error_median_px = 0;  ///< distance across the line to the nearest true line pixel's line,
  double error_p90_px = 0;     ///< over the detected points that are not spurious
};
/// `family` lists the channels that share the colours of the curves.
[[nodiscard]] DetectionFigures detection_figures(std::span<const TrueLinePixel> truth,
                                                 std::span<const DetectedPoint> detected,
                                                 std::span<const PatternChannel> family,
                                                 const RecallOptions& options = {});

}  // namespace pencilscan
