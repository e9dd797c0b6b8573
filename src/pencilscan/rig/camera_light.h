#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

// An image stays as the sensor gave it, a byte or two a sample, as long as possible.

/// InputError, named by `path`, when an image of a camera with a mosaic has three channels.
void check_channels(const Camera& camera, int channels, const std::filesystem::path& path);
/// InputError, named by `path`, when an image is of floating point and no light from 0 to 1: more
/// than 1 % of it are above 1, or so far below 0 that it is no noise around black (-0.1).
void check_light(const cv::Mat& image, const std::filesystem::path& path);
/// The image of a file as read_stored_image() has it; InputError when it has other channels or
/// another size than the camera, or is none of check_light().
[[nodiscard]] cv::Mat read_camera_image(const Camera& camera, const std::filesystem::path& path);

/// InputError where read_camera_image() would have one, without decoding what is sound by its
/// checksums.
void check_camera_image(const Camera& camera, const std::filesystem::path& path);

/// Values in [0, 1] of an image as stored (any depth): CV_32FC3 RGB, or CV_32FC1 for a camera with
/// a mosaic; what has this type already stays where it is.
[[nodiscard]] cv::Mat camera_values(const Camera& camera, const cv::Mat& stored);

/// Linear light of an image as stored, CV_32FC3 RGB: black level and gamma taken out, the colours
/// that a mosaic leaves out interpolated (io/mosaic_light.h).
[[nodiscard]] cv::Mat linear_light(const Camera& camera, const cv::Mat& stored);

/// True where more than one value in `n` of an image is among those found, CV_8UC1: not 0.
[[nodiscard]] bool are_more_than_one_in(int n, const cv::Mat& found);

/// Sensors of 10, 12 or 14 bits fill 16 of them, or leave their values in the low ones. The
/// greatest value, in [0, 1] of 16 bits, of the sensor with the fewest bits that hold the image:
/// all of it but a ten-thousandth, of pixels that are stuck. 1 for other images than CV_16U.
[[nodiscard]] double sensor_range(const cv::Mat& stored);

/// Values in [0, 1] from here on are at the top of the range.
inline constexpr float kFullRange = 0.998F;

/// Where an image as stored is at the top of the range, CV_8UC1: 255. For a mosaic, every pixel
/// that is such a sample or lies beside one.
[[nodiscard]] cv::Mat overexposed(const cv::Mat& stored);

}  // namespace pencilscan
