#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/check.h"
#include "pencilscan/report/shaded_view.h"

namespace pencilscan {
namespace {

constexpr int kSupersampling = 2;

/// Nearest point per pixel, as depth and colour.
void splat(std::span<const Vec3> points, std::span<const Color> colors, const Device& view,
           double radius_mm, cv::Mat& depth, cv::Mat& color) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double z = (view.device_from_world * points[i]).z();
    const auto pixel = view.project(points[i]);
    if (!pixel || pixel->cwiseAbs().maxCoeff() > 1e6) continue;
    const Vec2 at = kSupersampling * *pixel + Vec2::Constant(0.5 * (kSupersampling - 1));
    const double r = std::max(radius_mm * kSupersampling * view.focal_px() / z, 0.71);
    for (int y = static_cast<int>(std::ceil(at[1] - r)); y <= at[1] + r; ++y) {
      for (int x = static_cast<int>(std::ceil(at[0] - r)); x <= at[0] + r; ++x) {
        if (x < 0 || y < 0 || x >= depth.cols || y >= depth.rows) continue;
        if ((Vec2(x, y) - at).squaredNorm() > r * r) continue;
        if (static_cast<float>(z) >= depth.at<float>(y, x)) continue;
        depth.at<float>(y, x) = static_cast<float>(z);
        color.at<Color>(y, x) = colors[i];
      }
    }
  }
}

/// Share of light that is left at a pixel whose neighbours at `step` stand in front of it.
double eye_dome(const cv::Mat& depth, int y, int x, int step) {
  constexpr double kStrength = 60;  // per unit of log2 depth
  const double own = std::log2(static_cast<double>(depth.at<float>(y, x)));
  double response = 0;
  int count = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const int v = y + dy * step;
      const int u = x + dx * step;
      if (v < 0 || u < 0 || v >= depth.rows || u >= depth.cols || (dx == 0 && dy == 0)) continue;
      ++count;
      if (!std::isfinite(depth.at<float>(v, u))) continue;
      response += std::max(0.0, own - std::log2(static_cast<double>(depth.at<float>(v, u))));
    }
  }
  return count > 0 ? std::exp(-kStrength * response / count) : 1;
}

}  // namespace

cv::Mat point_view(std::span<const Vec3> points, std::span<const Color> colors, const Device& view,
                   double radius_mm) {
  PENCILSCAN_CHECK(points.size() == colors.size());
  cv::Mat depth(view.height * kSupersampling, view.width * kSupersampling, CV_32F,
                cv::Scalar(std::numeric_limits<float>::infinity()));
  cv::Mat color(depth.size(), CV_8UC3, cv::Scalar(27, 30, 36));
  splat(points, colors, view, radius_mm, depth, color);
  cv::Mat lit = color.clone();
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      if (!std::isfinite(depth.at<float>(y, x))) continue;
      const double light = std::max(eye_dome(depth, y, x, 2), 0.12);
      for (int k = 0; k < 3; ++k) {
        lit.at<Color>(y, x)[k] = static_cast<uchar>(std::lround(color.at<Color>(y, x)[k] * light));
      }
    }
  }
  cv::Mat picture;
  cv::resize(lit, picture, {view.width, view.height}, 0, 0, cv::INTER_AREA);
  return picture;
}

}  // namespace pencilscan
