#pragma once

#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <span>
#include <string>

namespace pencilscan {

/// One picture in the caller's memory, which has to stay as it is while the picture is in use. One
/// channel (grey, or the mosaic that the rig states) or three in RGB order, rows one after another.
/// std::uint8_t and std::uint16_t use their whole range, float lies in [0, 1]; values are as the
/// camera gave them. Three channels of float are worked on where they lie; of others a float copy
/// is made once.
class ImageView {
 public:
  /// `values`: height x width x channels of them. InputError when they are not so many.
  ImageView(std::span<const std::uint8_t> values, int width, int height, int channels = 3);
  ImageView(std::span<const std::uint16_t> values, int width, int height, int channels = 3);
  ImageView(std::span<const float> values, int width, int height, int channels = 3);
  /// CV_8U, CV_16U or CV_32F; shares the matrix's pixels. In RGB order, not OpenCV's usual BGR.
  /// InputError for another type.
  ImageView(const cv::Mat& image);  // NOLINT(google-explicit-constructor): a matrix is a picture

  [[nodiscard]] const cv::Mat& stored() const { return stored_; }

 private:
  ImageView(const void* values, std::size_t count, int width, int height, int depth, int channels);

  cv::Mat stored_;
};

/// Pictures of one moment by the name of their camera. A camera may be absent.
using Images = std::map<std::string, ImageView>;

}  // namespace pencilscan
