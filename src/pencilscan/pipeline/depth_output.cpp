#include "pencilscan/pipeline/depth_output.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/depth/depth_image.h"
#include "pencilscan/io/image.h"
#include "pencilscan/report/palette.h"
#include "pencilscan/report/pictures.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

struct ReasonColor {
  HoleReason reason;
  Color color;
  const char* label;
};

const std::array<ReasonColor, 8>& reason_colors() {
  static const std::array<ReasonColor, 8> colors = {{
      {HoleReason::kBackground, {24, 24, 28}, "background"},
      {HoleReason::kMeasured, {225, 225, 225}, "measured"},
      {HoleReason::kNoProjector, {70, 70, 160}, "no projector"},
      {HoleReason::kOneProjector, {60, 160, 230}, "one projector"},
      {HoleReason::kTooCompressed, {240, 180, 40}, "too compressed"},
      {HoleReason::kAmbiguous, {170, 80, 200}, "ambiguous"},
      {HoleReason::kContradicted, {220, 50, 50}, "contradicted"},
      {HoleReason::kSaturated, {255, 255, 90}, "saturated"},
  }};
  return colors;
}

cv::Mat hole_picture(const Device& camera, const DepthMap& map) {
  cv::Mat picture(camera.height, camera.width, CV_8UC3);
  for (int v = 0; v < camera.height; ++v) {
    const int row = std::min((v + map.stride / 2) / map.stride, map.rows - 1);
    for (int u = 0; u < camera.width; ++u) {
      const int column = std::min((u + map.stride / 2) / map.stride, map.columns - 1);
      const HoleReason reason = map.nodes[map.index(row, column)].reason;
      const auto entry =
          std::find_if(reason_colors().begin(), reason_colors().end(),
                       [&](const ReasonColor& color) { return color.reason == reason; });
      picture.at<Color>(v, u) = entry->color;
    }
  }
  std::vector<LegendEntry> legend;
  for (const ReasonColor& color : reason_colors()) legend.push_back({color.color, color.label});
  cv::Mat with_legend;
  cv::vconcat(picture, legend_strip(legend, camera.width), with_legend);
  return with_legend;
}

constexpr float kFarthest = 6553;  ///< that 16 bits of a tenth hold

/// Depth in tenths of the rig's unit; 0: none, or none that 16 bits hold.
cv::Mat in_tenths(const cv::Mat& depth) {
  cv::Mat tenths(depth.size(), CV_16U, cv::Scalar(0));
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      const float z = depth.at<float>(v, u);
      if (z < kFarthest)
        tenths.at<std::uint16_t>(v, u) = static_cast<std::uint16_t>(std::lround(10 * z));
    }
  }
  return tenths;
}

/// What the PNG of a camera lacks of its depth.
std::optional<std::string> png_warning(const Camera& camera, const cv::Mat& depth,
                                       const std::string& unit) {
  std::vector<float> depths;
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u)
      if (const float z = depth.at<float>(v, u); z > 0) depths.push_back(z);
  }
  if (depths.empty()) return std::nullopt;
  const std::string file = "depth/" + camera.name;
  const auto far =
      std::count_if(depths.begin(), depths.end(), [](float z) { return !(z < kFarthest); });
  if (far > 0) {
    const double percent = 100 * static_cast<double>(far) / static_cast<double>(depths.size());
    return file + ".png holds 0 (none) in place of " + formatted(percent, "%.3g") +
           " % of the depths, which reach " +
           formatted(static_cast<double>(*std::max_element(depths.begin(), depths.end())), "%.4g") +
           " " + unit + ": 16 bits in steps of 0.1 end at 6553; " + file + ".tiff holds them all";
  }
  constexpr double kWidestStep = 2;  // of what a pixel covers
  const double pixel = static_cast<double>(upper_median(std::move(depths))) / camera.K(0, 0);
  if (0.1 <= kWidestStep * pixel) return std::nullopt;
  return file + ".png is coarse: its steps are 0.1 " + unit + ", and a pixel covers " +
         formatted(pixel, "%.2g") + "; " + file + ".tiff holds the depths as they are";
}

}  // namespace

std::vector<std::string> write_depth_maps(const fs::path& folder, const Rig& rig,
                                          const ShapeResult& shape) {
  std::vector<std::string> warnings;
  for (const DepthMap& map : shape.depth.maps) {
    const Camera& camera = rig.cameras[static_cast<std::size_t>(map.camera)];
    const DepthImage image = depth_image(camera, map);
    write_image(folder / "depth" / (camera.name + ".tiff"), image.depth);
    write_image(folder / "sigma" / (camera.name + ".tiff"), image.sigma);
    write_image(folder / "depth" / (camera.name + ".png"), in_tenths(image.depth));
    if (auto warning = png_warning(camera, image.depth, unit_name(rig)))
      warnings.push_back(std::move(*warning));
  }
  return warnings;
}

void write_hole_pictures(const fs::path& folder, const Rig& rig, const ShapeResult& shape) {
  const std::vector<DepthMap>& maps = shape.depth.maps;
  std::vector<Picture> pictures(maps.size());
  parallel_for(maps.size(), [&](std::size_t i) {
    const Camera& camera = rig.camera(maps[i].camera);
    pictures[i] = {camera.name + "_holes", hole_picture(camera, maps[i])};
  });
  write_pictures(folder, pictures);
}

}  // namespace pencilscan
