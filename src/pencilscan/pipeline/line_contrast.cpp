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
  // px: pictures are made smaller down to that, which takes a twelfth off a line's energy.
  constexpr double kPeriod = 6;
  cv::Mat light = full;
  if (period_px > kPeriod) {
    const double scale = kPeriod / period_px;
    cv::resize(full, light, {}, scale, scale, cv::INTER_AREA);
    period_px = kPeriod;
  }
  // Of a wave of one period their difference passes .65, the last one .0008.
  const cv::Mat lines = blurred(light, 0.1 * period_px) - blurred(light, 0.3 * period_px);
  const double all = cv::norm(blurred(light, 0.6 * period_px), cv::NORM_L2SQR);
  return all > 0 ? cv::norm(lines, cv::NORM_L2SQR) / all : 0;
}

/// Each value over the median of the others that are above 0, the lesser one of two; 1 where the
/// value is 0, or fewer than two others are above: of two cameras, either may be right.
std::vector<double> of_usual(std::span<const double> values) {
  constexpr std::size_t kFewest = 2;
  std::vector<double> result(values.size(), 1);
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::vector<double> others;
    for (std::size_t k = 0; k < values.size(); ++k)
      if (k != i && values[k] > 0) others.push_back(values[k]);
    if (values[i] > 0 && others.size() >= kFewest)
      result[i] = values[i] / lower_quantile(std::move(others), 0.5);
  }
  return result;
}

}  // namespace

std::vector<double> line_contrasts(const Rig& rig, const Frame& frame,
                                   std::span<const char> left_out) {
  constexpr double kLeastPeriod = 3;  // px: pixels take a third of the energy of finer lines
  const double spacing = line_spacing(rig);
  std::vector<double> contrast(rig.cameras.size(), 0);
  parallel_for(contrast.size(), [&](std::size_t c) {
    const Camera& camera = rig.cameras[c];
    const double period_px = pixels_at_center(rig, camera, spacing);
    if (camera.sees_texture_only || frame.images[c].empty() || period_px < kLeastPeriod) return;
    if (c < left_out.size() && left_out[c] != 0) return;
    contrast[c] = line_contrast(linear_light(camera, frame.images[c]), period_px);
  });
  return of_usual(contrast);
}

std::string times_less(double contrast) {
  return formatted(1 / std::sqrt(contrast), "%.1f") + " times less";
}

std::vector<Warning> focus_warnings(const Rig& rig, const Frame& frame, const PointResult& curves) {
  // A blur that takes seven eighths of the energy takes two thirds of the height: all such pictures
  // are asked, and few others.
  constexpr double kLess = 0.5;
  std::vector<double> points;
  std::vector<double> heights;
  for (const GridGraph& graph : curves.graphs) {
    points.push_back(static_cast<double>(curve_points(graph)));
    heights.push_back(median_of_points({&graph, 1}, &CurvePoint::amplitude));
  }
  points = of_usual(points);
  heights = of_usual(heights);
  std::vector<std::size_t> doubtful;
  for (std::size_t c = 0; c < points.size(); ++c)
    if (points[c] < kLess || heights[c] < kLess) doubtful.push_back(c);
  if (doubtful.empty()) return {};
  std::vector<Warning> warnings;
  const std::vector<double> contrasts = line_contrasts(rig, frame, curves.left_out);
  for (const std::size_t c : doubtful) {
    if (!is_out_of_focus(contrasts[c])) continue;
    const std::string& name = rig.cameras[c].name;
    warnings.push_back({WarningCode::kOutOfFocus,
                        "camera " + name + ": lines stand out " + times_less(contrasts[c]) +
                            " in its picture than in the others': it is out of focus, its lens is "
                            "fogged or covered, or much other light falls into it",
                        name,
                        {{"contrast", contrasts[c]}}});
  }
  return warnings;
}

void let_focus_explain(std::vector<Warning>& warnings) {
  std::vector<std::string> out_of_focus;
  for (const Warning& w : warnings)
    if (w.code == WarningCode::kOutOfFocus) out_of_focus.push_back(w.device);
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
    return may_follow &&
           std::find(out_of_focus.begin(), out_of_focus.end(), w.device) != out_of_focus.end();
  });
}

}  // namespace pencilscan
