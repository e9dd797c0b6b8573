#include "pencilscan/rig/camera_light.h"

#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>

#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/linear_light.h"

namespace pencilscan {
namespace {

void check_channels(const Camera& camera, int channels, const std::filesystem::path& path) {
  if (camera.mosaic && channels != 1) {
    throw InputError(path.string(), "channels", std::to_string(channels),
                     "must be 1: camera " + camera.name + " of the rig has a mosaic");
  }
}

void check_size(const Camera& camera, int width, int height, const std::filesystem::path& path) {
  if (width == camera.width && height == camera.height) return;
  throw InputError(path.string(), "image size",
                   std::to_string(width) + "x" + std::to_string(height),
                   "must be " + std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                       " as camera " + camera.name + " of the rig");
}

}  // namespace

cv::Mat camera_values(const Camera& camera, const cv::Mat& stored,
                      const std::filesystem::path& path) {
  if (!camera.mosaic) return stored.type() == CV_32FC3 ? stored : unit_image(stored);
  check_channels(camera, stored.channels(), path);
  return stored.type() == CV_32FC1 ? stored : unit_values(stored);
}

cv::Mat read_camera_image(const Camera& camera, const std::filesystem::path& path) {
  const cv::Mat image = camera_values(camera, read_stored_image(path), path);
  check_size(camera, image.cols, image.rows, path);
  return image;
}

void check_camera_image(const Camera& camera, const std::filesystem::path& path) {
  const std::optional<ImageShape> shape = sound_png(path);
  if (!shape) {
    static_cast<void>(read_camera_image(camera, path));
    return;
  }
  check_channels(camera, shape->channels, path);
  check_size(camera, shape->width, shape->height, path);
}

cv::Mat linear_light(const Camera& camera, const cv::Mat& values) {
  PENCILSCAN_CHECK(values.type() == (camera.mosaic ? CV_32FC1 : CV_32FC3));
  const cv::Mat linear = linearized(values, camera.gamma, camera.black_level);
  return camera.mosaic ? demosaiced(linear, *camera.mosaic) : linear;
}

cv::Mat overexposed(const cv::Mat& values) {
  cv::Mat full(values.size(), CV_8UC1);
  const int channels = values.channels();
  for (int y = 0; y < values.rows; ++y) {
    const float* in = values.ptr<float>(y);
    auto* out = full.ptr<std::uint8_t>(y);
    for (int x = 0; x < values.cols; ++x, in += channels) {
      bool any = false;
      for (int k = 0; k < channels; ++k) any = any || in[k] >= kFullRange;
      out[x] = any ? 255 : 0;
    }
  }
  if (channels == 1) cv::dilate(full, full, cv::Mat::ones(3, 3, CV_8U));
  return full;
}

}  // namespace pencilscan
