#include "pencilscan/detection/detect.h"

#include "pencilscan/core/check.h"
#include "pencilscan/core/parallel.h"

namespace pencilscan {
namespace {

std::size_t count_saturated(const cv::Mat& image) {
  constexpr float kFull = 0.998F;
  std::size_t count = 0;
  for (int y = 0; y < image.rows; ++y) {
    const auto* row = image.ptr<cv::Vec3f>(y);
    for (int x = 0; x < image.cols; ++x) {
      count += row[x][0] >= kFull || row[x][1] >= kFull || row[x][2] >= kFull;
    }
  }
  return count;
}

}  // namespace

CameraDetection detect_curves(const Camera& camera, const Rig& rig,
                              const std::vector<ColorFamily>& families, const cv::Mat& image,
                              const DetectionOptions& options) {
  PENCILSCAN_CHECK(image.type() == CV_32FC3);
  CameraDetection result;
  result.saturated_pixels = count_saturated(image);
  // Unmix the colour families.
  const cv::Mat linear = linearized(image, camera.gamma);
  result.unmixing = estimate_unmixing(camera, rig, families, linear);
  const cv::Mat rgb = unmixed(linear, result.unmixing);
  // Find and trace the curves of each family, then fit them together.
  for (std::size_t f = 0; f < families.size(); ++f) {
    const cv::Mat presence = presence_image(rgb, families[f]);
    const std::vector<Ridgel> ridgels = find_ridgels(presence, options.ridge);
    std::vector<Curve> curves = trace_curves(ridgels, presence.size(), options.trace);
    for (Curve& curve : curves) curve.family = static_cast<int>(f);
    curves = refine_curves(presence, std::move(curves), options.refine);
    result.curves.insert(result.curves.end(), curves.begin(), curves.end());
  }
  // Read the colour code along each curve.
  measure_code(rgb, families, result.curves, options.code);
  return result;
}

}  // namespace pencilscan
