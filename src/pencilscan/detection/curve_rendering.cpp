#include "pencilscan/detection/curve_rendering.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/detection/profile_fit.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;

/// Adds `sign` times the profile between two points. Every image row (column for flat pieces) that
/// the segment passes gets it once: the half-open range [from, to) makes neighbouring segments
/// share no row.
void render_segment(const CurvePoint& p, const CurvePoint& q, float sign, cv::Mat& model) {
  if (p.amplitude <= 0 || q.amplitude <= 0) return;
  const Vector2f way = q.position - p.position;
  const Eigen::Index major = std::abs(p.normal.y()) < std::abs(p.normal.x()) ? 1 : 0;
  const Eigen::Index minor = 1 - major;
  if (std::abs(way[major]) < 1e-6F) return;
  const float from = std::min(p.position[major], q.position[major]);
  const float to = std::max(p.position[major], q.position[major]);
  const int last_major = major == 1 ? model.rows - 1 : model.cols - 1;
  const int last_minor = major == 1 ? model.cols - 1 : model.rows - 1;
  for (int m = std::max(0, static_cast<int>(std::ceil(from)));
       m <= last_major && static_cast<float>(m) < to; ++m) {
    const float f = (static_cast<float>(m) - p.position[major]) / way[major];
    const float center = p.position[minor] + f * way[minor];
    const float amplitude = sign * (p.amplitude + f * (q.amplitude - p.amplitude));
    const float width = p.width_px + f * (q.width_px - p.width_px);
    const float lean = std::abs(p.normal[minor]);
    const float reach = kModelReach * width / lean;
    const int low = std::max(0, static_cast<int>(std::ceil(center - reach)));
    const int high = std::min(last_minor, static_cast<int>(std::floor(center + reach)));
    float* image = major == 1 ? model.ptr<float>(m, low) : model.ptr<float>(low, m);
    add_line_profile(amplitude, width, lean * (static_cast<float>(low) - center), lean,
                     high - low + 1, image,
                     major == 1 ? 1 : static_cast<std::ptrdiff_t>(model.step1()));
  }
}

/// The end point of a curve moved outwards: profiles near the end reach beyond it, and what is
/// added back to them must have been subtracted.
CurvePoint beyond(const CurvePoint& end, const CurvePoint& inner) {
  constexpr float kOverhang = 2;
  CurvePoint point = end;
  point.position += kOverhang * (end.position - inner.position).normalized();
  return point;
}

void render_curve(const Curve& curve, float sign, cv::Mat& model) {
  const std::size_t n = curve.points.size();
  if (n < 2) return;
  const auto& points = curve.points;
  render_segment(beyond(points[0], points[1]), points[0], sign, model);
  for (std::size_t i = 0; i + 1 < n; ++i) render_segment(points[i], points[i + 1], sign, model);
  render_segment(points[n - 1], beyond(points[n - 1], points[n - 2]), sign, model);
}

}  // namespace

cv::Mat render_curves(const std::vector<Curve>& curves, cv::Size size) {
  cv::Mat model(size, CV_32F, cv::Scalar(0));
  for (const Curve& curve : curves) add_curve(curve, model);
  return model;
}

void add_curve(const Curve& curve, cv::Mat& image) { render_curve(curve, 1, image); }

void subtract_curve(const Curve& curve, cv::Mat& image) { render_curve(curve, -1, image); }

}  // namespace pencilscan
