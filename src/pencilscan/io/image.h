#pragma once

#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <optional>

#include "pencilscan/io/png.h"

namespace pencilscan {

/// Reads PNG, TIFF, JPEG or BMP, 8 or 16 bit, grey or colour. Result: CV_32FC3 in **RGB** order,
/// values in [0, 1] as stored (no gamma applied); grey is replicated. InputError when the file is
/// missing, truncated (PNG: no IEND, JPEG: no end marker, even where OpenCV would read on) or no
/// image.
[[nodiscard]] cv::Mat read_image(const std::filesystem::path& path);

/// The same as stored: CV_8U, CV_16U (or CV_32F of TIFF) of one channel, or of three in RGB order.
[[nodiscard]] cv::Mat read_stored_image(const std::filesystem::path& path);
/// CV_32F in [0, 1] of an image as stored, of as many channels.
[[nodiscard]] cv::Mat unit_values(const cv::Mat& stored);
/// CV_32FC3 in [0, 1] of an image as stored; grey is replicated.
[[nodiscard]] cv::Mat unit_image(const cv::Mat& stored);

/// The shape of a PNG of 8 or 16 bits, grey or RGB, whose bytes are those that were written, by the
/// checksums of its chunks: a tenth of the time that decoding takes. Nothing of any other file.
[[nodiscard]] std::optional<ImageShape> sound_png(const std::filesystem::path& path);

/// The pictures in a folder (.png .tiff .tif .jpg .jpeg .bmp, in capitals or not), listed once;
/// none where there is no such folder. InputError where it cannot be listed.
class FolderImages {
 public:
  explicit FolderImages(std::filesystem::path folder);

  /// The file of that name without its ending. InputError that names both where there are two.
  [[nodiscard]] std::optional<std::filesystem::path> find(const std::string& stem) const;
  /// All names without their endings, sorted.
  [[nodiscard]] std::vector<std::string> stems() const;

 private:
  std::filesystem::path folder_;
  std::map<std::string, std::vector<std::string>> names_;  ///< by stem
};

/// FolderImages(folder).find(stem), for one picture of a folder.
[[nodiscard]] std::optional<std::filesystem::path> find_image(const std::filesystem::path& folder,
                                                              const std::string& stem);

/// Writes an RGB (CV_32FC3 in [0,1], CV_8UC3, CV_16UC3) or one-channel (8U, 16U, 32F) image, whole
/// or not at all. Float images become `bit_depth` (8 or 16) integers, except in .tiff, which keeps
/// them.
void write_image(const std::filesystem::path& path, const cv::Mat& image, int bit_depth = 8);
/// The same as JPEG of a quality in [1, 100].
void write_jpeg(const std::filesystem::path& path, const cv::Mat& image, int quality);

}  // namespace pencilscan
