#include "pencilscan/report/device_drawing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "pencilscan/report/palette.h"

namespace pencilscan {
namespace {

struct Frustum {
  cv::Point apex;
  std::array<cv::Point, 4> corners;
};

std::optional<Frustum> project_frustum(const Device& device, const Device& view, double size_mm) {
  const auto fixed = [&](const Vec3& x) -> std::optional<cv::Point> {
    const auto pixel = view.project(x);
    if (!pixel || pixel->cwiseAbs().maxCoeff() > 1e5) return std::nullopt;
    return cv::Point(static_cast<int>(std::lround((*pixel)[0] * (1 << kSubpixelBits))),
                     static_cast<int>(std::lround((*pixel)[1] * (1 << kSubpixelBits))));
  };
  Frustum frustum;
  const auto apex = fixed(device.center());
  if (!apex) return std::nullopt;
  frustum.apex = *apex;
  const std::array<Vec2, 4> pixels = {Vec2(-0.5, -0.5), Vec2(device.width - 0.5, -0.5),
                                      Vec2(device.width - 0.5, device.height - 0.5),
                                      Vec2(-0.5, device.height - 0.5)};
  for (std::size_t i = 0; i < 4; ++i) {
    const auto corner = fixed(device.point_at_depth(pixels[i], size_mm));
    if (!corner) return std::nullopt;
    frustum.corners[i] = *corner;
  }
  return frustum;
}

void draw_frustum(const Frustum& frustum, const Color& color, bool filled, cv::Mat& picture) {
  const std::vector<cv::Point> base(frustum.corners.begin(), frustum.corners.end());
  cv::Mat layer = picture.clone();
  const double opacity = filled ? 0.32 : 0.12;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::vector<cv::Point> side = {frustum.apex, base[i], base[(i + 1) % 4]};
    cv::fillConvexPoly(layer, side, scalar(color), cv::LINE_AA, kSubpixelBits);
  }
  cv::fillConvexPoly(layer, base, scalar(color), cv::LINE_AA, kSubpixelBits);
  cv::addWeighted(layer, opacity, picture, 1 - opacity, 0, picture);
  cv::polylines(picture, base, true, scalar(color), 1, cv::LINE_AA, kSubpixelBits);
  for (const cv::Point& corner : base) {
    cv::line(picture, frustum.apex, corner, scalar(color), 1, cv::LINE_AA, kSubpixelBits);
  }
  cv::circle(picture, frustum.apex, 3 << kSubpixelBits, scalar(color), cv::FILLED, cv::LINE_AA,
             kSubpixelBits);
}

}  // namespace

Color light_color(const Projector& projector) {
  Rgb sum{};
  for (const LinePattern& pattern : projector.patterns) {
    for (int i = 0; i < pattern.period(); ++i) {
      const Rgb c = pattern.color(i);
      for (std::size_t k = 0; k < 3; ++k) sum[k] += c[k] / pattern.period();
    }
  }
  const double peak = std::max({sum[0], sum[1], sum[2]});
  if (peak <= 0) return {110, 110, 110};
  Color color;
  for (std::size_t k = 0; k < 3; ++k) {
    color[static_cast<int>(k)] = static_cast<uchar>(30 + 200 * sum[k] / peak);
  }
  return color;
}

void draw_devices(const Rig& rig, const Device& view, double size_mm, double depth_mm,
                  bool in_front, cv::Mat& picture) {
  const auto draw = [&](const Device& device, const Color& color, bool filled) {
    const double depth = (view.device_from_world * device.center()).z();
    if (depth <= 0 || (depth < depth_mm) != in_front) return;
    const auto frustum = project_frustum(device, view, size_mm);
    if (!frustum) return;
    draw_frustum(*frustum, color, filled, picture);
    const cv::Point at(frustum->apex.x / (1 << kSubpixelBits) + 8,
                       frustum->apex.y / (1 << kSubpixelBits) - 6);
    draw_text(picture, device.name, at, {88, 92, 100}, 0.4);
  };
  for (const Projector& projector : rig.projectors) draw(projector, light_color(projector), true);
  for (const Camera& camera : rig.cameras) draw(camera, {62, 68, 78}, false);
}

}  // namespace pencilscan
