#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/guided/predicted_lines.h"
#include "pencilscan/labeling/labeling.h"
#include "pencilscan/points/local_surface.h"

namespace pencilscan {

struct SecondLookOptions {
  LocalSurfaceOptions surface;
  PredictionOptions prediction;
  double max_offset_lines = 0.3;  ///< of a curve from the predicted line, in line spacings
  double max_offset_px = 1.5;     ///< the same, px
  double max_sigma_px = 0.6;      ///< of points that are found anew
  double min_amplitude = 0.3;     ///< share of the amplitude of the lines around
  double min_tentative = 0.7;     ///< confidence of a tentative label that can be confirmed
  int min_points = 4;             ///< of a new curve or a confirmed label, in a row
  int min_adopted = 10;           ///< of a part of an undecided stretch, in a row
  int min_whole = 6;              ///< of most of an undecided stretch, in a row
  double support_px = 16;         ///< within which lines around must be known ...
  double support_lines = 1.5;     ///< ... or so many line spacings, if those are more
  int min_support = 3;            ///< points of them
  int passes = 2;
  float confidence = 0.99F;
};

/// What the labelled surface says of what the first look missed, per camera. Lines of all
/// projectors are predicted on the surface around the labelled points; undecided stretches of
/// curves that lie on a predicted line which nothing shows yet get its label, and where there is no
/// curve, the line is fitted to what the known curves leave of the image. New curves are appended
/// to the graphs, new runs to the labelling. Returns the surface that all labelled points show, per
/// graph.
/// `presence`: per graph and colour family the presence image, CV_32FC1, of the whole camera image.
/// `dense`: more points of the surface, of all cameras; what they are on is not read.
std::vector<LocalSurface> second_look(const Rig& rig, const std::vector<ColorFamily>& families,
                                      std::span<const std::vector<cv::Mat>> presence,
                                      std::span<GridGraph> graphs, Labeling& labeling,
                                      const SecondLookOptions& options = {},
                                      std::span<const MeasuredPoint> dense = {});

}  // namespace pencilscan
