#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/detection/color_family.h"

namespace pencilscan {

/// Camera RGB -> projector RGB of one camera.
struct Unmixing {
  Mat3 projector_from_camera = Mat3::Identity();
  bool estimated = false;  ///< from the frame, since the rig states no color_matrix
};

/// The stated matrix inverted (the mean over projectors where they differ), or else an estimate
/// from the frame: what each colour of lines looks like above the dark between them says what a
/// channel shows of the others where it was not projected (crosstalk of the projector panel,
/// filters and sensor together). `image` is linear light, CV_32FC3, RGB.
[[nodiscard]] Unmixing estimate_unmixing(const Camera& camera, const Rig& rig,
                                         const std::vector<ColorFamily>& families,
                                         const cv::Mat& image);

/// linear = value^gamma.
[[nodiscard]] cv::Mat linearized(const cv::Mat& image, double gamma);

/// Unmixed image (projector RGB), CV_32FC3.
[[nodiscard]] cv::Mat unmixed(const cv::Mat& image, const Unmixing& unmixing);

/// Presence channel of a family, CV_32FC1.
[[nodiscard]] cv::Mat presence_image(const cv::Mat& unmixed_image, const ColorFamily& family);

}  // namespace pencilscan
