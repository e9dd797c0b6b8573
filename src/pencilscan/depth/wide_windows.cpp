#include "pencilscan/depth/wide_windows.h"

#include <cmath>
#include <memory>

#include "pencilscan/rig/binning.h"

namespace pencilscan {
namespace {

/// A presence image; where a mosaic has samples of it (`sampled`), the means of these.
cv::Mat binned_presence(const cv::Mat& presence, const cv::Mat& sampled, int binning) {
  if (sampled.empty()) return binned(presence, binning);
  cv::Mat counted;
  sampled.convertTo(counted, CV_32F, 1 / 255.0);
  return binned(presence, counted, binning);
}

}  // namespace

void scale_pixels(float size, DepthMap& map) {
  for (DepthNode& node : map.nodes) {
    for (float* slope : {&node.wx, &node.wy}) *slope *= size;
    for (float* bend : {&node.wxx, &node.wxy, &node.wyy}) *bend *= size * size;
  }
}

CameraLight binned_light(const CameraLight& light, int binning) {
  CameraLight result;
  const auto camera = std::make_shared<const Camera>(binned(*light.camera, binning));
  result.own_camera = camera;
  result.camera = camera.get();
  result.patterns = light.patterns;
  result.noise = light.noise;
  for (std::size_t f = 0; f < light.families.size(); ++f) {
    const cv::Mat sampled = f < light.sampled.size() ? light.sampled[f] : cv::Mat();
    result.families.push_back(binned_presence(light.families[f], sampled, binning));
    // Means that overlap share noise: over a window they are worth as many samples as they count.
    const double share = sampled.empty() ? 1 : cv::mean(sampled)[0] / 255;
    const auto samples = static_cast<float>(binning * binning * share);
    result.noise[f].offset /= samples;
    result.noise[f].slope /= samples;
  }
  result.sampled.resize(light.sampled.size());
  cv::Mat invalid;
  light.valid.convertTo(invalid, CV_32F, -1, 1);
  cv::bitwise_and(binned(invalid, binning) == 0, 1, result.valid);
  result.spacing_px = light.spacing_px / static_cast<float>(binning);
  result.line_px = light.line_px / static_cast<float>(binning);
  result.of_mosaic = light.of_mosaic;
  const auto blur2 = static_cast<double>(light.blur_px * light.blur_px);
  result.blur_px = static_cast<float>(std::sqrt(blur2 + binning_blur_px2(binning)) / binning);
  result.usual_residual = light.usual_residual;
  return result;
}

int binning_for(double spacing_px, const DepthOptions& options) {
  // Windows 11 px wide find less with wider ones beside them where lines are 11.3 px apart, and
  // more where they are 15.1 px apart (docs/depth.md).
  constexpr double kNarrow = 1.2;
  const double width = 2 * options.half + 1;
  int binning = 1;
  // Nodes lie on whole pixels of the joined ones.
  while (2 * binning <= options.stride && kNarrow * binning * width < spacing_px) binning *= 2;
  return binning;
}

void with_wider_windows(const CameraLight& light, int widest, DepthMap& map,
                        const std::function<void(const CameraLight&, DepthMap&)>& work) {
  CameraLight wide = light;
  const int stride = map.stride;
  int binning = 2;
  for (; binning <= widest && stride % binning == 0; binning *= 2) {
    wide = binned_light(wide, 2);
    scale_pixels(2, map);
    map.stride = stride / binning;
    work(wide, map);
  }
  scale_pixels(2.F / static_cast<float>(binning), map);
  map.stride = stride;
}

}  // namespace pencilscan
