#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Values in [0, 1] of an image as stored (any depth): CV_32FC3 RGB, or CV_32FC1 for a camera with
/// a mosaic; what has this type already stays where it is. InputError, named by `path`, when a
/// camera with a mosaic has three channels.
[[nodiscard]] cv::Mat camera_values(const Camera& camera, const cv::Mat& stored,
                                    const std::filesystem::path& path);
/// The same of a file of the camera's size; InputError when it has another one.
[[nodiscard]] cv::Mat read_camera_image(const Camera& camera, const std::filesystem::path& path);

/// InputError where read_camera_image() would have one, without decoding what is sound by its
/// checksums.
void check_camera_image(const Camera& camera, const std::filesystem::path& path);

/// Linear light of camera_values(), CV_32FC3 RGB: black level and gamma taken out, the colours that
/// a mosaic leaves out interpolated (io/mosaic.h).
[[nodiscard]] cv::Mat linear_light(const Camera& camera, const cv::Mat& values);

/// camera_values() from here on are at the top of the range.
inline constexpr float kFullRange = 0.998F;

/// Where camera_values() are at the top of the range, CV_8UC1: 255. For a mosaic, every pixel whose
/// interpolated colours have such a sample in them.
[[nodiscard]] cv::Mat overexposed(const cv::Mat& values);

}  // namespace pencilscan
