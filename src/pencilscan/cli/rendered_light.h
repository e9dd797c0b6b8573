#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>

#include "pencilscan/rig/rig.h"

namespace pencilscan::cli {

/// Linear light that another renderer made: <folder>/<frame>/<camera>.png, or another image.
class RenderedLight {
 public:
  /// InputError where a picture of a camera is missing in one of the frames 0 .. frame_count - 1.
  RenderedLight(std::filesystem::path folder, const Rig& rig, int frame_count);

  /// CV_32FC3, RGB. InputError where it is no picture of the camera's size.
  [[nodiscard]] cv::Mat read(const std::string& frame, const Camera& camera) const;

 private:
  [[nodiscard]] std::filesystem::path file(const std::string& frame, const Camera& camera) const;

  std::filesystem::path folder_;
};

}  // namespace pencilscan::cli
