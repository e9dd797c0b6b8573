#include "pencilscan/pipeline/line_contrast.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "pencilscan/core/formatted.h"
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

/// True where a value is less than half of the others' median.
bool is_far_less(std::span<const double> values, std::size_t which) {
  std::vector<double> others(values.begin(), values.end());
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(which));
  return !others.empty() && values[which] < 0.5 * upper_median(std::move(others));
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

std::string times_less(double contrast) {
  return formatted(1 / std::sqrt(contrast), "%.1f") + " times less";
}

std::vector<Warning> focus_warnings(const Rig& rig, const Frame& frame,
                                    std::span<const GridGraph> graphs) {
  std::vector<double> points;
  std::vector<double> heights;
  for (const GridGraph& graph : graphs) {
    points.push_back(0);
    for (const Curve& curve : graph.curves)
      points.back() += static_cast<double>(curve.points.size());
    heights.push_back(median_of_points({&graph, 1}, &CurvePoint::amplitude));
  }
  std::vector<std::size_t> doubtful;
  for (std::size_t c = 0; c < graphs.size(); ++c)
    if (is_far_less(points, c) || is_far_less(heights, c)) doubtful.push_back(c);
  if (doubtful.empty()) return {};
  std::vector<Warning> warnings;
  const std::vector<double> contrasts = line_contrasts(rig, frame);
  for (const std::size_t c : doubtful) {
    if (!is_out_of_focus(contrasts[c])) continue;
    const std::string& name = rig.cameras[c].name;
    warnings.push_back({WarningCode::kOutOfFocus,
                        "camera " + name + ": lines stand out " + times_less(contrasts[c]) +
                            " in its picture than in the others': it is out of focus, or its lens "
                            "is fogged",
                        name,
                        {{"contrast", contrasts[c]}}});
  }
  return warnings;
}

void let_focus_explain(std::vector<Warning>& warnings) {
  std::vector<std::string> blurred;
  for (const Warning& w : warnings)
    if (w.code == WarningCode::kOutOfFocus) blurred.push_back(w.device);
  const auto is_left_out = [&](const std::string& device) {
    return std::any_of(warnings.begin(), warnings.end(), [&](const Warning& w) {
      return w.code == WarningCode::kWrongPicture && w.device == device;
    });
  };
  // A picture that was left out is said to be blurred where it is left out.
  std::erase_if(warnings, [&](const Warning& w) {
    return w.code == WarningCode::kOutOfFocus && is_left_out(w.device);
  });
  std::erase_if(warnings, [&](const Warning& w) {
    const bool may_follow = w.code == WarningCode::kDeviceIsOff ||
                            w.code == WarningCode::kViewsDisagree ||
                            w.code == WarningCode::kMissingLines;
    return may_follow && std::find(blurred.begin(), blurred.end(), w.device) != blurred.end();
  });
}

}  // namespace pencilscan
