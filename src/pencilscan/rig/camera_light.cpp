#include "pencilscan/rig/camera_light.h"

#include <algorithm>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>

#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/linear_light.h"
#include "pencilscan/io/mosaic_light.h"

namespace pencilscan {
namespace {

void check_size(const Camera& camera, int width, int height, const std::filesystem::path& path) {
  if (width == camera.width && height == camera.height) return;
  throw InputError(path.string(), "image size",
                   std::to_string(width) + "x" + std::to_string(height),
                   "must be " + std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                       " as camera " + camera.name + " of the rig");
}

}  // namespace

void check_channels(const Camera& camera, int channels, const std::filesystem::path& path) {
  if (camera.mosaic && channels != 1) {
    throw InputError(path.string(), "channels", std::to_string(channels),
                     "must be 1: camera " + camera.name + " of the rig has a mosaic");
  }
}

void check_light(const cv::Mat& image, const std::filesystem::path& path) {
  if (image.depth() != CV_32F) return;  // of integers the type says what the range is
  // Noise around black, of pictures whose black was taken out, has a hundredth below this where its
  // deviation is .043, three and a half times that of the sensor preset "high".
  constexpr double kLeast = -0.1;
  const cv::Mat values = image.reshape(1);
  constexpr int kFew = 100;  // one in so many: more are no glints of a renderer's light
  const bool is_above = are_more_than_one_in(kFew, values > 1);
  if (!is_above && !are_more_than_one_in(kFew, values < kLeast)) return;
  double least = 0;
  double most = 0;
  cv::minMaxIdx(values, &least, &most);
  throw InputError(path.string(), is_above ? "greatest value" : "least value",
                   formatted(is_above ? most : least, "%g"),
                   std::string(is_above ? "must be at most 1" : "must not be below 0") +
                       ", in a picture of floating point: light from 0 to 1");
}

cv::Mat read_camera_image(const Camera& camera, const std::filesystem::path& path) {
  cv::Mat image = read_stored_image(path);
  check_channels(camera, image.channels(), path);
  check_size(camera, image.cols, image.rows, path);
  check_light(image, path);
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

cv::Mat camera_values(const Camera& camera, const cv::Mat& stored) {
  if (!camera.mosaic) return stored.type() == CV_32FC3 ? stored : unit_image(stored);
  PENCILSCAN_CHECK(stored.channels() == 1);
  return stored.type() == CV_32FC1 ? stored : unit_values(stored);
}

cv::Mat linear_light(const Camera& camera, const cv::Mat& stored) {
  const cv::Mat linear =
      linearized(camera_values(camera, stored), camera.gamma, camera.black_level);
  return camera.mosaic ? light_behind(linear, *camera.mosaic) : linear;
}

bool are_more_than_one_in(int n, const cv::Mat& found) {
  return static_cast<std::int64_t>(cv::countNonZero(found)) * n >
         static_cast<std::int64_t>(found.total());
}

double sensor_range(const cv::Mat& stored) {
  if (stored.depth() != CV_16U) return 1;
  // Chosen: a sensor has fewer pixels that are stuck, and a driver writes fewer numbers of its own
  // into a picture; light that needs 16 bits takes more, as a line does.
  constexpr int kStuck = 10000;  // one in so many
  const cv::Mat values = stored.reshape(1);
  for (const int bits : {10, 12, 14})
    if (!are_more_than_one_in(kStuck, values >= 1 << bits)) return ((1 << bits) - 1) / 65535.;
  return 1;
}

cv::Mat overexposed(const cv::Mat& stored) {
  cv::Mat full(stored.size(), CV_8UC1);
  const int channels = stored.channels();
  cv::Mat values;
  for (int y = 0; y < stored.rows; ++y) {
    values = stored.row(y);
    auto* const row = full.ptr<std::uint8_t>(y);
    double most = 0;  // mostly, no value of a row is full
    cv::minMaxIdx(values.reshape(1), nullptr, &most);
    cv::Mat brightest(1, 1, CV_MAKETYPE(stored.depth(), 1), cv::Scalar(most));
    if (stored.depth() != CV_32F) brightest = unit_values(brightest);
    if (brightest.at<float>(0) < kFullRange) {
      std::fill_n(row, stored.cols, std::uint8_t{0});
      continue;
    }
    if (stored.depth() != CV_32F) values = unit_values(values);
    const float* in = values.ptr<float>();
    for (int x = 0; x < stored.cols; ++x, in += channels) {
      bool any = false;
      for (int k = 0; k < channels; ++k) any = any || in[k] >= kFullRange;
      row[x] = any ? 255 : 0;
    }
  }
  if (channels == 1) cv::dilate(full, full, cv::Mat::ones(3, 3, CV_8U));
  return full;
}

}  // namespace pencilscan
