#include "pencilscan/detection/refine_scales.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;

constexpr std::size_t kMostSizes = 8;

/// Of two points of one curve.
CurvePoint between(const CurvePoint& a, const CurvePoint& b) {
  CurvePoint middle = a;
  middle.position = 0.5F * (a.position + b.position);
  const Vector2f normal = a.normal + b.normal;
  if (normal.squaredNorm() > 0) middle.normal = normal.normalized();
  middle.amplitude = 0.5F * (a.amplitude + b.amplitude);
  middle.width_px = 0.5F * (a.width_px + b.width_px);
  middle.sigma_px = 0.5F * (a.sigma_px + b.sigma_px);
  return middle;
}

void scale_point(float factor, CurvePoint& point) {
  point.position *= factor;
  point.width_px *= factor;
  point.sigma_px *= factor;
}

std::vector<CurvePoint> halved(const std::vector<CurvePoint>& points) {
  std::vector<CurvePoint> result;
  result.reserve(points.size() / 2 + 1);
  for (std::size_t i = 0; i < points.size(); i += 2) {
    result.push_back(i + 1 < points.size() ? between(points[i], points[i + 1]) : points[i]);
    scale_point(0.5F, result.back());
  }
  return result;
}

/// Middle of Hermite's cubic from a to b: (a + b) / 2 + (tangent at a - tangent at b) / 8.
CurvePoint middle_of_cubic(const CurvePoint& a, const CurvePoint& b) {
  CurvePoint middle = between(a, b);
  const Vector2f way = b.position - a.position;
  const auto along = [&](const CurvePoint& p) -> Vector2f {
    return p.tangent().dot(way) * p.tangent();  // either sense of the tangent gives the same
  };
  middle.position += 0.125F * (along(a) - along(b));
  return middle;
}

std::vector<CurvePoint> doubled(const std::vector<CurvePoint>& points) {
  std::vector<CurvePoint> result;
  result.reserve(2 * points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i > 0) result.push_back(middle_of_cubic(points[i - 1], points[i]));
    result.push_back(points[i]);
  }
  for (CurvePoint& point : result) scale_point(2, point);
  return result;
}

/// Size at which a profile of this width (px of the full image) is fitted: the largest that holds
/// it.
std::size_t size_of_width(float width_px) {
  std::size_t size = 0;
  for (; width_px > kWidestProfilePx && size < kMostSizes; ++size) width_px *= 0.5F;
  return size;
}

}  // namespace

float median_width(std::span<const CurvePoint> points) {
  std::vector<float> widths;
  for (const CurvePoint& p : points) widths.push_back(p.width_px);
  return upper_median(std::move(widths));
}

std::size_t size_of_curve(const Curve& curve, std::size_t size) {
  if (curve.points.empty()) return size;
  return size_of_width(median_width(curve.points) * static_cast<float>(1U << size));
}

Curve resized(Curve curve, std::size_t from, std::size_t to) {
  for (; from < to; ++from) curve.points = halved(curve.points);
  for (; from > to; --from) curve.points = doubled(curve.points);
  return curve;
}

cv::Mat resized_image(cv::Mat image, std::size_t size) {
  for (std::size_t k = 0; k < size; ++k) {
    cv::Mat half;
    cv::pyrDown(image, half);
    image = half;
  }
  return image;
}

}  // namespace pencilscan
