#include "pencilscan/pipeline/line_contrast.h"

#include <opencv2/imgproc.hpp>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/rig/camera_light.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {
namespace {

cv::Mat blurred(const cv::Mat& light, double deviation) {
  cv::Mat result;
  cv::GaussianBlur(light, result, {}, deviation);
  return result;
}

/// `period_px`: from line to line.
double line_contrast(const cv::Mat& full, double period_px) {
  constexpr double kPeriod = 6;  // px, in which lines are looked at: of finer ones contrast is lost
  cv::Mat light = full;
  if (period_px > kPeriod) {
    const double scale = kPeriod / period_px;
    cv::resize(full, light, {}, scale, scale, cv::INTER_AREA);
    period_px = kPeriod;
  }
  // Their difference passes .65 of a wave of one period.
  const cv::Mat lines = blurred(light, 0.1 * period_px) - blurred(light, 0.3 * period_px);
  const double all = cv::norm(blurred(light, 0.6 * period_px), cv::NORM_L2SQR);
  return all > 0 ? cv::norm(lines, cv::NORM_L2SQR) / all : 0;
}

}  // namespace

std::vector<double> line_contrasts(const Rig& rig, const Frame& frame) {
  const double spacing = line_spacing(rig);
  std::vector<double> contrast(rig.cameras.size(), 0);
  parallel_for(contrast.size(), [&](std::size_t c) {
    const Camera& camera = rig.cameras[c];
    if (camera.sees_texture_only || frame.images[c].empty()) return;
    contrast[c] = line_contrast(linear_light(camera, frame.images[c]),
                                pixels_at_center(rig, camera, spacing));
  });
  std::vector<double> of_usual(contrast.size(), 1);
  for (std::size_t c = 0; c < contrast.size(); ++c) {
    std::vector<double> of_others;
    for (std::size_t k = 0; k < contrast.size(); ++k)
      if (k != c && contrast[k] > 0) of_others.push_back(contrast[k]);
    if (contrast[c] > 0 && !of_others.empty())
      of_usual[c] = contrast[c] / upper_median(std::move(of_others));
  }
  return of_usual;
}

}  // namespace pencilscan
