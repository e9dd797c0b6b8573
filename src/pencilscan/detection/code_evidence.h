#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/detection/curve.h"
#include "pencilscan/pattern/color_likeness.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

/// Points of a curve that share one measurement of Curve::code: their evidence counts once.
inline constexpr int kPointsPerMeasurement = 9;

struct CodeEvidenceOptions {
  int half_arc = kPointsPerMeasurement / 2;  ///< points on either side that share a measurement
  double relative_noise = kColorError;
  double max_log_ratio = 4;  ///< evidence of one point is limited to this
};

/// Log-likelihood of each colour that the code of the points [begin, end) gives together, of a
/// family of `colors`.
[[nodiscard]] std::vector<float> color_evidence(const Curve& curve, int begin, int end,
                                                std::size_t colors);

/// Sets Curve::code of all curves of one camera. At each point the three unmixed channels are
/// regressed on the curve's own profile, the profiles of the other families' curves there (which
/// share channels: green codes both blue/cyan and red/yellow) and a sloped background. The colour
/// amplitudes, relative to those usual in the image, are compared with each colour of the family.
void measure_code(const cv::Mat& unmixed_image, const std::vector<ColorFamily>& families,
                  std::vector<Curve>& curves, const CodeEvidenceOptions& options = {});

}  // namespace pencilscan
