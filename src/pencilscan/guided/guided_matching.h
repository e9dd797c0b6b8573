#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/guided/predicted_lines.h"
#include "pencilscan/labeling/labeling.h"
#include "pencilscan/points/local_surface.h"

namespace pencilscan {

struct GuidedMatchingOptions {
  LocalSurfaceOptions surface;
  PredictionOptions prediction;
  double max_offset_lines = 0.3;  ///< of a curve from the predicted line, in line spacings
  double max_offset_px = 1.5;     ///< the same, px
  double max_sigma_px = 0.6;      ///< of points that are found anew
  double min_amplitude = 0.3;     ///< share of the amplitude of the lines around
  double min_tentative = 0.7;     ///< confidence of a tentative label that can be confirmed
  int min_points = 4;             ///< of a new curve or a confirmed label, in a row
  int min_adopted = 10;           ///< of a part of a stretch that labels' surface, or colour, names
  int min_whole = 6;              ///< of most of an undecided stretch, in a row
  double support_px = 16;         ///< within which lines around must be known ...
  double support_lines = 1.5;     ///< ... or so many line spacings, if those are more
  int min_support = 3;            ///< points of them
  int passes = 2;                 ///< where no dense surface follows; 0: no guided matching
  int passes_before_surface = 1;  ///< where one does: it shows more, and less that is wrong
  int passes_on_surface = 3;      ///< on that
  float confidence = 0.99F;
};

/// Guided matching, per camera: the labelled surface tells where the lines that the solution missed
/// have to be. Each pass
///   1. predicts the lines of all projectors on the surface around the labelled points,
///   2. confirms tentative labels where the predicted line is the same, and gives an undecided
///      stretch of a curve the label of the predicted line that it lies on, if no other curve shows
///      that line, the stretch does not have another line's colour, its curve does not come from a
///      floor or wall with another name, and lines around or, on a dense surface, its own colour
///      support it,
///   3. fits a new curve where a line is predicted and no curve was found. The fit is to the image
///      that remains once the known curves are subtracted, and goes on from those that show the
///      line beside the gap (named_ends.h). What remains on a curve without a name
///      is no line where that has another line's colour, or where a floor or wall is in the
///      picture,
///   4. on a dense surface, tells lines apart that made one curve (merged_lines.h), and names
///      predicted lines that lie on curves of other projectors too (shared_curves.h).
/// New curves are appended to `graphs`, new runs to `labeling`. The function returns, per graph,
/// the surface that all labelled points show. `presence`: the presence image of each graph and
/// colour family, CV_32FC1, of the whole camera image; what nobody else holds is used up. `dense`:
/// more points of the surface, of all cameras; their projector, pattern and line are not read.
std::vector<LocalSurface> match_guided(const Rig& rig, const std::vector<ColorFamily>& families,
                                       std::vector<std::vector<cv::Mat>> presence,
                                       std::span<GridGraph> graphs, Labeling& labeling,
                                       const GuidedMatchingOptions& options = {},
                                       std::span<const MeasuredPoint> dense = {});

}  // namespace pencilscan
