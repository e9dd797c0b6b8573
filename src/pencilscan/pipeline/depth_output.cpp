#include "pencilscan/pipeline/depth_output.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

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

}  // namespace

void write_depth_maps(const fs::path& folder, const Rig& rig, const ShapeResult& shape) {
  for (const DepthMap& map : shape.depth.maps) {
    const Camera& camera = rig.cameras[static_cast<std::size_t>(map.camera)];
    const DepthImage image = depth_image(camera, map);
    write_image(folder / "depth" / (camera.name + ".tiff"), image.depth);
    write_image(folder / "sigma" / (camera.name + ".tiff"), image.sigma);
    cv::Mat tenths(camera.height, camera.width, CV_16U, cv::Scalar(0));
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        const float z = image.depth.at<float>(v, u);
        if (z < 6553)
          tenths.at<std::uint16_t>(v, u) = static_cast<std::uint16_t>(std::lround(10 * z));
      }
    }
    write_image(folder / "depth" / (camera.name + ".png"), tenths);
  }
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
