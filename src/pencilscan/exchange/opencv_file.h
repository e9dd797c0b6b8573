#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pencilscan/exchange/exchanged_device.h"

namespace pencilscan {

/// Reads a calibration that OpenCV's FileStorage wrote (YAML or XML; YAML of ROS' camera_info, too)
/// and adds it to `rig`: one device, or the two of a stereo calibration. Keys in any of the usual
/// spellings (docs/formats.md). `names` replaces the names that the file gives or implies: none, or
/// one per device. InputError when the file is neither, or a value breaks its rule.
void read_opencv(const std::filesystem::path& path, const std::vector<std::string>& names,
                 ExchangedRig& rig);

enum class OpencvSyntax { kYaml, kXml };

/// One device: camera_name, image_width, image_height, camera_matrix, distortion_coefficients, and
/// the pose R, T (x_device = R x_world + T, mm). InputError when K has skew, which OpenCV has not.
[[nodiscard]] std::string opencv_text(const Device& device, OpencvSyntax syntax);
/// Two devices as a stereo calibration: K1, D1, K2, D2, image_size1, image_size2, and R, T, with
/// x_second = R x_first + T.
[[nodiscard]] std::string opencv_stereo_text(const Device& first, const Device& second,
                                             OpencvSyntax syntax);

}  // namespace pencilscan
