#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/io/zarr_array.h"

namespace pencilscan {

/// A recording: what the cameras gave over many frames, as one folder `recording.zarr`
/// (docs/formats.md). Row k holds the k-th picture of every camera; which pictures show one moment
/// is said by their time stamps (frame_sets.h).

/// A camera's pictures: all of one size and type.
struct RecordedCamera {
  std::string name;
  int width = 0;
  int height = 0;
  int channels = 1;        ///< 1: grey, or the raw mosaic; 3: RGB
  int bit_depth = 8;       ///< 8 or 16; 12 bit of a sensor are the high bits of 16
  double exposure_us = 0;  ///< time that the shutter is open; 0: unknown

  /// CV_8UC1, CV_8UC3, CV_16UC1 or CV_16UC3.
  [[nodiscard]] int image_type() const {
    return CV_MAKETYPE(bit_depth == 8 ? CV_8U : CV_16U, channels);
  }
};

constexpr std::int64_t kUnknownTime = -1;  ///< as time stamp

/// A recording that is read. Const calls are safe on several threads.
class Recording {
 public:
  /// InputError names the file of the folder that breaks the format.
  [[nodiscard]] static Recording open(const std::filesystem::path& folder);
  /// True for a folder that looks like a recording and not like image folders.
  [[nodiscard]] static bool is_one(const std::filesystem::path& folder);

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] const std::vector<RecordedCamera>& cameras() const { return cameras_; }
  [[nodiscard]] std::optional<std::size_t> camera_named(const std::string& name) const;
  [[nodiscard]] std::size_t row_count() const { return rows_; }
  /// False where the recording ended without RecordingWriter::close(): it was cut off, or goes on.
  [[nodiscard]] bool is_closed() const { return closed_; }
  /// Whether all cameras' clocks count from the same moment; nothing where it does not say so.
  [[nodiscard]] std::optional<bool> shares_clock() const { return shares_clock_; }
  /// All attributes of the group.
  [[nodiscard]] const nlohmann::json& attributes() const { return attributes_; }

  /// Nanoseconds of the camera's clock at the start of the exposure, or kUnknownTime.
  [[nodiscard]] std::int64_t timestamp_ns(std::size_t row, std::size_t camera) const {
    return timestamps_[row * cameras_.size() + camera];
  }
  /// True where there shall be a picture.
  [[nodiscard]] bool valid(std::size_t row, std::size_t camera) const {
    return valid_[row * cameras_.size() + camera] != 0;
  }
  /// The picture as the sensor gave it (RecordedCamera::image_type, RGB); empty where there is
  /// none. InputError where it is damaged.
  [[nodiscard]] cv::Mat read(std::size_t row, std::size_t camera) const;
  /// The file that holds a picture.
  [[nodiscard]] std::filesystem::path picture_file(std::size_t row, std::size_t camera) const;

 private:
  Recording() = default;

  std::filesystem::path folder_;
  std::vector<RecordedCamera> cameras_;
  std::vector<ZarrArray> pictures_;  ///< one per camera
  std::size_t rows_ = 0;
  bool closed_ = true;
  std::optional<bool> shares_clock_;
  nlohmann::json attributes_;
  std::vector<std::int64_t> timestamps_;  ///< rows x cameras
  std::vector<std::uint8_t> valid_;       ///< rows x cameras
};

}  // namespace pencilscan
