#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/view/color_family.h"

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

/// Each pixel's colour times a matrix, CV_32FC3.
[[nodiscard]] cv::Mat mixed(const cv::Mat& colors, const Mat3& matrix);

/// Red, green and blue each where the camera's K, distortion and pose say (color_registration of
/// the rig), CV_32FC3. `corner`: pixel of the camera that is the image's first. The image itself
/// where the rig states nothing.
[[nodiscard]] cv::Mat registered(const Camera& camera, const cv::Mat& image,
                                 cv::Point corner = {0, 0});

/// Light of the projectors, RGB, each colour where the camera's model says, of a linear image
/// (CV_32FC3): unmixed, since lenses act before the sensor's filters, then registered.
[[nodiscard]] cv::Mat projector_light(const Camera& camera, const cv::Mat& linear,
                                      const Unmixing& unmixing, cv::Point corner = {0, 0});

/// Where a camera's mosaic has a sample that makes more than half of a family's presence, CV_8UC1:
/// 255; elsewhere presence is filled in from around. Empty where no colour makes so much of it, for
/// a camera without a mosaic, and where colours are registered away from their pixels.
[[nodiscard]] cv::Mat presence_samples(const Camera& camera, const Unmixing& unmixing,
                                       const ColorFamily& family);

/// Presence channel of a family, CV_32FC1.
[[nodiscard]] cv::Mat presence_image(const cv::Mat& unmixed_image, const ColorFamily& family);

}  // namespace pencilscan
