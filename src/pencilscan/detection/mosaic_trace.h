#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Whether the colours of a picture (CV_32FC3) were filled in behind a mosaic: samples differ from
/// the mean of their neighbours by more than what was interpolated from these (after Gallagher and
/// Chen 2008). One of the four places of a 2 x 2 mosaic stands out so, and with it its row, its
/// column and its diagonal. In a picture of three full channels the places are alike, but where
/// lines lie about an even number of pixels apart on a flat face. These make one such contrast
/// alone: of lines at f cycles a pixel in x and y, the multiples of f modulo 1 are a cyclic group,
/// and that has at most one of (1/2, 0), (0, 1/2) and (1/2, 1/2). So two contrasts are asked for.
[[nodiscard]] bool looks_interpolated(const cv::Mat& rgb);

/// Where the green samples of a mosaic lie.
enum class Greens {
  kNone,  ///< it is none
  kOdd,   ///< x + y is odd: RGGB, BGGR
  kEven,  ///< x + y is even: GRBG, GBRG
};
[[nodiscard]] Greens greens_of(const Mosaic& mosaic);
/// Those of a picture of one channel, any depth: over blocks of 16 x 16 px the two green places
/// have the same mean, and red has not that of blue. Nothing where noise hides it, or without a
/// mosaic.
[[nodiscard]] Greens greens_of(const cv::Mat& samples);

/// The mosaic whose samples stand unchanged in a picture as stored (three channels of any depth):
/// where the picture has contrast, every other colour is, to rounding, what an interpolation makes
/// of them. Known are means of the nearest samples, a missing green also along one direction alone,
/// and the gradient-corrected filters of Malvar, He and Cutler (High-quality linear interpolation
/// for demosaicing of Bayer-patterned color images, ICASSP 2004). Nothing where none of them is it:
/// three full channels, another interpolation, or pictures that were changed after it.
[[nodiscard]] std::optional<Mosaic> mosaic_behind(const Camera& camera, const cv::Mat& stored);

}  // namespace pencilscan
