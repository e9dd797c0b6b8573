#include "pencilscan/page/image_blocks.h"

#include <cmath>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/codec.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/report/overlay.h"
#include "pencilscan/report/shaded_view.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {
namespace {

constexpr int kStride = 4;  ///< of depth and hole maps on the page, px: as DepthOptions::stride

cv::Mat limited(const cv::Mat& image, int max_width) {
  if (image.cols <= max_width) return image;
  cv::Mat small;
  const int height = std::max(1, image.rows * max_width / image.cols);
  cv::resize(image, small, {max_width, height}, 0, 0, cv::INTER_AREA);
  return small;
}

cv::Mat shown_image(const std::filesystem::path& file, const Camera& camera, bool linear) {
  if (linear) return displayable(linear_light(camera, read_camera_image(camera, file)));
  cv::Mat image = read_image(file);
  image.convertTo(image, CV_8UC3, 255);
  return image;
}

}  // namespace

std::optional<EncodedImage> camera_image(const ResultEntry& entry, const Camera& camera,
                                         int max_width, int quality) {
  std::optional<std::filesystem::path> file;
  bool linear = true;
  if (!entry.captured.empty()) file = find_image(entry.captured, camera.name);
  if (!file) {
    file = find_image(entry.folder / "pictures", camera.name);
    linear = false;
  }
  if (!file) return std::nullopt;
  const cv::Mat image = shown_image(*file, camera, linear);
  return EncodedImage{"image/webp", encoded_picture(limited(image, max_width), ".webp",
                                                    {cv::IMWRITE_WEBP_QUALITY, quality})};
}

std::optional<EncodedImage> hole_image(const ResultEntry& entry, const Camera& camera) {
  const auto file = entry.folder / "pictures" / (camera.name + "_holes.png");
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) return std::nullopt;
  cv::Mat image = read_image(file);
  if (image.cols != camera.width || image.rows < camera.height)
    throw InputError(file.string(), "", "", "must be as wide as its camera's image");
  image = image.rowRange(0, camera.height);
  image.convertTo(image, CV_8UC3, 255);
  cv::Mat nodes((camera.height + kStride - 1) / kStride, (camera.width + kStride - 1) / kStride,
                CV_8UC3);
  for (int row = 0; row < nodes.rows; ++row) {
    for (int column = 0; column < nodes.cols; ++column)
      nodes.at<cv::Vec3b>(row, column) = image.at<cv::Vec3b>(kStride * row, kStride * column);
  }
  return EncodedImage{"image/png",
                      encoded_picture(nodes, ".png", {cv::IMWRITE_PNG_COMPRESSION, 9})};
}

std::optional<Block> depth_block(const ResultEntry& entry, const Camera& camera,
                                 const RayScene* measured) {
  const auto file = entry.folder / "depth" / (camera.name + ".tiff");
  const int columns = (camera.width + kStride - 1) / kStride;
  const int rows = (camera.height + kStride - 1) / kStride;
  const auto width = static_cast<std::size_t>(columns);
  std::vector<float> depth(width * static_cast<std::size_t>(rows),
                           std::numeric_limits<float>::quiet_NaN());
  std::error_code ignored;
  const bool stored = std::filesystem::is_regular_file(file, ignored);
  if (stored) {
    const cv::Mat image = decoded_picture(read_file(file), cv::IMREAD_UNCHANGED);
    if (image.type() != CV_32F || image.cols != camera.width || image.rows != camera.height)
      throw InputError(file.string(), "", "", "must be a float image of its camera's size");
    for (std::size_t i = 0; i < depth.size(); ++i) {
      depth[i] = image.at<float>(kStride * static_cast<int>(i / width),
                                 kStride * static_cast<int>(i % width));
    }
  } else if (measured != nullptr) {
    parallel_for(depth.size(), [&](std::size_t i) {
      const Ray ray = camera.ray(
          {static_cast<double>(kStride * (i % width)), static_cast<double>(kStride * (i / width))});
      if (const auto hit = measured->first_hit(ray))
        depth[i] = static_cast<float>((camera.device_from_world * hit->point).z());
    });
  } else {
    return std::nullopt;
  }
  Block block;
  block.put("columns", columns);
  block.put("rows", rows);
  block.put("stride", kStride);
  block.put("source", stored ? "depth map" : "measured surface");
  block.add_floats("depth", depth);
  return block;
}

EncodedImage mesh_thumbnail(const TriangleMesh& mesh, int width, int height) {
  const BoundingBox box = bounding_box(mesh);
  const Sphere around{0.5 * (box.low + box.high),
                      std::max(0.5 * (box.high - box.low).norm(), 1e-6)};
  ShadeOptions options;
  options.supersampling = 2;
  const cv::Mat picture =
      MeshPainter(mesh, 0).draw(make_view(around, Vec3(1, -0.4, 0.35), width, height), options);
  return {"image/jpeg", encoded_picture(picture, ".jpg", {cv::IMWRITE_JPEG_QUALITY, 78})};
}

}  // namespace pencilscan
