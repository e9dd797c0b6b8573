#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/detection/curve.h"

namespace pencilscan {

struct RefineOptions {
  int rounds = 2;    ///< fits of all curves, from the second on with the others subtracted
  int half_arc = 4;  ///< profiles averaged on either side along the curve
  double end_amplitude_ratio = 0.6;  ///< a curve ends where its amplitude falls below this share
                                     ///< of that 5 px further in, > 0; a line that is there has
                                     ///< this share of its neighbours' (own_light.h)
  double max_sigma_px = 0.8;         ///< less certain points are dropped
  int min_points = 6;
  int sizes = 1;  ///< of the image that show lines best, each half of the one before; >= 1
};

/// Sub-pixel positions: on each point the cross profile, averaged along the curve, is fitted by a
/// blurred box under sloping light on a sloped background (Gauss-Newton), all other curves
/// subtracted. Sets position,
/// normal, amplitude, width and sigma of every point; cuts curves where they jump or have no light
/// of their own (own_light.h), and trims ends that overshoot a silhouette or depth step.
///
/// A profile has 15 samples. Lines that are too wide for them are fitted to an image of half,
/// quarter ... size, whose pixels are the samples (refine_scales.h); points stay about 1 px apart.
[[nodiscard]] std::vector<Curve> refine_curves(const cv::Mat& presence, std::vector<Curve> curves,
                                               const RefineOptions& options = {});

/// Refined curves of an image whose values are interpolated but where `samples` (CV_8UC1) is not 0,
/// fitted again to these alone, each counted once and where it lies: behind a mosaic, interpolated
/// values repeat the noise of a quarter as many samples and widen lines, so that curves stated two
/// thirds of the deviation that they had. A curve that coarser sizes show is fitted to these.
[[nodiscard]] std::vector<Curve> refit_to_samples(const cv::Mat& presence, const cv::Mat& samples,
                                                  std::vector<Curve> curves,
                                                  RefineOptions options = {});

/// Fits a curve whose place, direction and width are roughly known to an image from which all known
/// curves were subtracted. Amplitudes: as lines around have them, or 0. Gives several pieces or
/// none.
[[nodiscard]] std::vector<Curve> fit_guess(const cv::Mat& unexplained, Curve guess,
                                           const RefineOptions& options = {});

/// Bilinear sample; outside, the nearest pixel's value.
[[nodiscard]] float sample_bilinear(const cv::Mat& image, float x, float y);

}  // namespace pencilscan
