#include "pencilscan/io/image.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/lower_case.h"
#include "pencilscan/io/codec.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/found_files.h"
#include "pencilscan/io/png.h"

namespace pencilscan {
namespace {

using std::string_view_literals::operator""sv;

constexpr std::array<const char*, 6> kEndings = {".png", ".tiff", ".tif", ".jpg", ".jpeg", ".bmp"};

/// True when an end-of-image marker follows the last start-of-scan. Cameras append bytes after it.
bool jpeg_is_whole(std::string_view bytes) {
  const auto scan = bytes.rfind("\xff\xda"sv);
  return scan != std::string_view::npos && bytes.find("\xff\xd9"sv, scan) != std::string_view::npos;
}

/// BMP header: bytes 2..5 hold the file's size (some writers leave 0).
bool bmp_is_whole(std::string_view bytes) {
  if (bytes.size() < 26) return false;
  std::uint32_t size = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    size |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[2 + k])) << (8 * k);
  }
  return size <= bytes.size();
}

void check_whole(const std::filesystem::path& path, std::string_view bytes) {
  const auto fail = [&](const char* rule) { throw InputError(path.string(), "", "", rule); };
  if (bytes.empty()) fail("the image file is empty");
  if (is_png(bytes)) {
    if (!png_reaches_end(bytes)) fail("truncated PNG: it must end with an IEND chunk");
  } else if (bytes.starts_with("\xff\xd8"sv)) {
    if (!jpeg_is_whole(bytes)) fail("truncated JPEG: it must end with an end-of-image marker");
  } else if (bytes.starts_with("BM"sv)) {
    if (!bmp_is_whole(bytes)) fail("truncated BMP: it is shorter than its header says");
  } else if (!bytes.starts_with("II*\0"sv) && !bytes.starts_with("MM\0*"sv)) {
    fail("must be a PNG, TIFF, JPEG or BMP image");
  }
}

/// As stored, in RGB order: without rotation by EXIF, alpha dropped, palette expanded.
cv::Mat decode(const std::filesystem::path& path, const std::string& bytes) {
  cv::Mat image = decoded_picture(
      bytes, cv::IMREAD_ANYDEPTH | cv::IMREAD_ANYCOLOR | cv::IMREAD_IGNORE_ORIENTATION);
  if (image.empty()) throw InputError(path.string(), "", "", "cannot be decoded as an image");
  if (image.depth() != CV_8U && image.depth() != CV_16U && image.depth() != CV_32F)
    throw InputError(path.string(), "", "", "must have 8 or 16 bit per channel");
  if (image.channels() == 4) cv::cvtColor(image, image, cv::COLOR_RGBA2RGB);
  if (image.channels() != 1 && image.channels() != 3)
    throw InputError(path.string(), "", "", "must be grey or colour");
  return image;
}

/// In integers, but for floating-point TIFF.
cv::Mat encodable(const cv::Mat& image, const std::string& ending, int bit_depth) {
  if (image.depth() != CV_32F || ending == ".tiff") return image;
  cv::Mat integers;
  image.convertTo(integers, bit_depth == 16 ? CV_16U : CV_8U, bit_depth == 16 ? 65535 : 255);
  return integers;
}

std::string lower_ending(const std::filesystem::path& path) {
  return lower_case(path.extension().string());
}

}  // namespace

cv::Mat read_stored_image(const std::filesystem::path& path) {
  const std::string bytes = read_file(path);
  check_whole(path, bytes);
  if (std::optional<cv::Mat> plain = plain_png(bytes)) return *std::move(plain);
  cv::Mat image = decode(path, bytes);
  cv::Point wrong;
  constexpr double kMost = std::numeric_limits<float>::max();
  if (image.depth() == CV_32F && !cv::checkRange(image, true, &wrong, -kMost, kMost)) {
    throw InputError(path.string(), "pixel",
                     std::to_string(wrong.x) + " " + std::to_string(wrong.y),
                     "must be a finite number");
  }
  return image;
}

std::optional<ImageShape> sound_png(const std::filesystem::path& path) {
  return sound_png_shape(read_file(path));
}

cv::Mat unit_values(const cv::Mat& stored) {
  const double scale = stored.depth() == CV_8U    ? 1.0 / 255
                       : stored.depth() == CV_16U ? 1.0 / 65535
                                                  : 1;
  cv::Mat image;
  stored.convertTo(image, CV_32F, scale);
  return image;
}

cv::Mat unit_image(const cv::Mat& stored) {
  cv::Mat image = unit_values(stored);
  if (image.channels() == 1) cv::cvtColor(image, image, cv::COLOR_GRAY2RGB);
  return image;
}

cv::Mat read_image(const std::filesystem::path& path) {
  return unit_image(read_stored_image(path));
}

FolderImages::FolderImages(std::filesystem::path folder) : folder_(std::move(folder)) {
  std::error_code error;
  for (std::filesystem::directory_iterator it(folder_, error), end; !error && it != end;
       it.increment(error)) {
    const std::filesystem::path name = it->path().filename();
    if (name.has_extension() &&
        std::find(kEndings.begin(), kEndings.end(), lower_ending(name)) != kEndings.end())
      names_[name.stem().string()].push_back(name.string());
  }
  if (error && !is_absence(error))
    throw InputError(folder_.string(), "", "", "cannot be listed: " + error.message());
}

std::optional<std::filesystem::path> FolderImages::find(const std::string& stem) const {
  const auto at = names_.find(stem);
  if (at == names_.end()) return std::nullopt;
  // A name of which the system does not tell whether it is a file counts: reading it says why.
  std::vector<std::string> found;
  for (const std::string& name : at->second) {
    std::error_code unknown;
    const bool is_file = std::filesystem::is_regular_file(folder_ / name, unknown);
    if (is_file || (unknown && !is_absence(unknown))) found.push_back(name);
  }
  if (found.empty()) return std::nullopt;
  std::sort(found.begin(), found.end());
  if (found.size() > 1)
    throw InputError(folder_.string(), stem, found[0] + " and " + found[1],
                     "must be one file: which of them is the picture?");
  return folder_ / found.front();
}

std::vector<std::string> FolderImages::stems() const {
  std::vector<std::string> stems;
  for (const auto& [stem, names] : names_) stems.push_back(stem);
  return stems;
}

std::optional<std::filesystem::path> find_image(const std::filesystem::path& folder,
                                                const std::string& stem) {
  return FolderImages(folder).find(stem);
}

namespace {

void write_encoded(const std::filesystem::path& path, const std::string& ending,
                   const cv::Mat& image, const std::vector<int>& parameters) {
  std::string bytes;
  try {
    bytes = encoded_picture(image, ending, parameters);
  } catch (const StageError& error) {
    throw StageError(path.string() + ": " + error.what());
  }
  write_atomically(path, [&](std::ostream& stream) {
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  });
}

}  // namespace

void write_image(const std::filesystem::path& path, const cv::Mat& image, int bit_depth) {
  PENCILSCAN_CHECK(!image.empty() && (image.channels() == 1 || image.channels() == 3));
  PENCILSCAN_CHECK(bit_depth == 8 || bit_depth == 16);
  const std::string ending = lower_ending(path);
  if (std::find(kEndings.begin(), kEndings.end(), ending) == kEndings.end()) {
    throw InputError(path.string(), "", "", "must end with .png, .tiff, .jpg or .bmp");
  }
  write_encoded(path, ending, encodable(image, ending, bit_depth), {});
}

void write_jpeg(const std::filesystem::path& path, const cv::Mat& image, int quality) {
  PENCILSCAN_CHECK(!image.empty() && quality >= 1 && quality <= 100);
  write_encoded(path, ".jpg", encodable(image, ".jpg", 8), {cv::IMWRITE_JPEG_QUALITY, quality});
}

}  // namespace pencilscan
