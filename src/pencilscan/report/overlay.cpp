#include "pencilscan/report/overlay.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>

#include "pencilscan/core/check.h"

namespace pencilscan {
namespace {

void draw_curve(cv::Mat& picture, const OverlayCurve& curve, const OverlayOptions& options) {
  std::vector<cv::Point> path;
  path.reserve(curve.points.size());
  const double offset = 0.5 * (options.zoom - 1);
  for (const Eigen::Vector2f& p : curve.points) {
    if (!p.allFinite()) continue;
    const auto fixed = [&](float value) {
      return static_cast<int>(
          std::lround((options.zoom * static_cast<double>(value) + offset) * (1 << kSubpixelBits)));
    };
    path.emplace_back(fixed(p[0]), fixed(p[1]));
  }
  const cv::Scalar color = scalar(categorical_color(curve.key));
  if (path.size() == 1) {
    cv::circle(picture, path[0], (options.thickness_px << kSubpixelBits) * 3 / 4, color, cv::FILLED,
               cv::LINE_AA, kSubpixelBits);
  } else if (path.size() > 1) {
    cv::polylines(picture, path, false, color, options.thickness_px, cv::LINE_AA, kSubpixelBits);
  }
}

std::vector<LegendEntry> legend_of(std::span<const OverlayCurve> curves,
                                   const std::string& key_name) {
  std::set<int> keys;
  bool undecided = false;
  for (const OverlayCurve& curve : curves) {
    if (curve.key >= 0) keys.insert(curve.key);
    undecided = undecided || curve.key < 0;
  }
  std::vector<LegendEntry> entries;
  for (const int key : keys) {
    const std::string name = entries.empty() ? key_name + " " : "";
    entries.push_back({categorical_color(key), name + std::to_string(key)});
  }
  if (undecided) entries.push_back({kUndecidedColor, "undecided"});
  return entries;
}

/// Splits the points of one line into chains. They are ordered along the line's longer image side,
/// on which a curve is one-valued nearly everywhere; where it is not, the chain breaks.
void chain(std::vector<Eigen::Vector2f>& points, int key, std::vector<OverlayCurve>& curves) {
  constexpr float kGap = 2.5F;  // px
  Eigen::Vector2f low = points[0];
  Eigen::Vector2f high = points[0];
  for (const Eigen::Vector2f& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const int along = high[0] - low[0] > high[1] - low[1] ? 0 : 1;
  std::stable_sort(points.begin(), points.end(), [&](const auto& a, const auto& b) {
    return a[along] != b[along] ? a[along] < b[along] : a[1 - along] < b[1 - along];
  });
  std::vector<OverlayCurve> open;  // chains that may still grow
  for (const Eigen::Vector2f& p : points) {
    OverlayCurve* nearest = nullptr;
    float best = kGap;
    for (OverlayCurve& curve : open) {
      const float distance = (curve.points.back() - p).norm();
      if (distance <= best) {
        best = distance;
        nearest = &curve;
      }
    }
    if (nearest != nullptr) {
      nearest->points.push_back(p);
    } else {
      open.push_back({{p}, key});
    }
    for (std::size_t i = 0; i < open.size();) {
      if (p[along] - open[i].points.back()[along] > kGap) {
        curves.push_back(std::move(open[i]));
        open.erase(open.begin() + static_cast<std::ptrdiff_t>(i));
      } else {
        ++i;
      }
    }
  }
  for (OverlayCurve& curve : open) curves.push_back(std::move(curve));
}

}  // namespace

cv::Mat displayable(const cv::Mat& image) {
  if (image.type() == CV_8UC3) return image.clone();
  PENCILSCAN_CHECK(image.type() == CV_32FC3);
  constexpr double kDark = 1. / 16;
  double peak = 0;
  cv::minMaxIdx(image.reshape(1), nullptr, &peak);
  const double gain = peak > 0 && peak < kDark ? 1 / peak : 1;
  cv::Mat shown = cv::min(cv::max(gain * image, 0.0), 1.0);
  cv::pow(shown, 1 / 2.2, shown);
  shown.convertTo(shown, CV_8UC3, 255);
  return shown;
}

cv::Mat draw_overlay(const cv::Mat& image, std::span<const OverlayCurve> curves,
                     const OverlayOptions& options) {
  PENCILSCAN_CHECK(options.zoom >= 1 && options.zoom <= 8 && options.thickness_px >= 1);
  cv::Mat picture = displayable(image);
  picture.convertTo(picture, -1, options.brightness);
  if (options.zoom > 1) {
    cv::resize(picture, picture, {}, options.zoom, options.zoom, cv::INTER_LINEAR);
  }
  // Undecided curves first: a decided one must not hide below grey.
  for (const bool decided : {false, true}) {
    for (const OverlayCurve& curve : curves) {
      if ((curve.key >= 0) == decided) draw_curve(picture, curve, options);
    }
  }
  const std::vector<LegendEntry> entries = legend_of(curves, options.key_name);
  if (!options.legend || entries.empty()) return picture;
  cv::Mat whole;
  cv::vconcat(picture, legend_strip(entries, picture.cols), whole);
  return whole;
}

std::vector<OverlayCurve> curves_of_points(const Rig& rig, std::span<const MeasuredPoint> points,
                                           std::size_t camera, OverlayKey key,
                                           std::span<const char> used) {
  PENCILSCAN_CHECK(used.empty() || used.size() == points.size());
  using LineName = std::array<int, 4>;  // projector, pattern, line, used
  std::vector<std::pair<LineName, std::size_t>> order;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const MeasuredPoint& p = points[i];
    if (p.camera != camera || p.projector >= rig.projectors.size()) continue;
    const int is_used = used.empty() || used[i] ? 1 : 0;
    order.push_back({{p.projector, p.pattern, p.line, is_used}, i});
  }
  std::sort(order.begin(), order.end());
  std::vector<OverlayCurve> curves;
  for (std::size_t begin = 0; begin < order.size();) {
    std::vector<Eigen::Vector2f> line;
    std::size_t end = begin;
    for (; end < order.size() && order[end].first == order[begin].first; ++end) {
      line.emplace_back(points[order[end].second].u, points[order[end].second].v);
    }
    const auto& [projector, pattern, number, is_used] = order[begin].first;
    const auto& patterns = rig.projectors[static_cast<std::size_t>(projector)].patterns;
    int curve_key = projector;
    if (key == OverlayKey::kLocalId) {
      const auto index = static_cast<std::size_t>(pattern);
      curve_key = index < patterns.size() ? patterns[index].local_id(number) : number;
    }
    chain(line, is_used ? curve_key : -1, curves);
    begin = end;
  }
  return curves;
}

}  // namespace pencilscan
