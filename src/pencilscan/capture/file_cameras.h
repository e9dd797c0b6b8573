#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "pencilscan/capture/camera_device.h"

namespace pencilscan {

/// A camera that another program writes pictures of into a folder. What is there when it starts is
/// old; then every new picture file (PNG, TIFF, JPEG, BMP) counts, in order of its time, as soon as
/// it is whole. With a software trigger, trigger() writes the number of the wanted picture to
/// `folder`/request.txt. The time stamp is the file's.
[[nodiscard]] std::unique_ptr<CameraDevice> open_folder_camera(const std::filesystem::path& folder);

/// A camera that a program takes one picture of at a time: DSLRs, phones. `words` is the program
/// with its arguments, run without a shell; "{file}" in them becomes the file to write (JPEG, PNG
/// or TIFF whatever its name says).
[[nodiscard]] std::unique_ptr<CameraDevice> open_command_camera(
    const std::vector<std::string>& words);

}  // namespace pencilscan
