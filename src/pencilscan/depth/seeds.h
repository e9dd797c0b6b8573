#pragma once

#include <span>
#include <vector>

#include "pencilscan/depth/window_fit.h"
#include "pencilscan/labeling/measured_point.h"

namespace pencilscan {

/// The labelled curve points of one camera in cells of its image: where dense depth starts.
class CurveSeeds {
 public:
  CurveSeeds(const Camera& camera, int camera_index, std::span<const MeasuredPoint> points);

  struct Point {
    Vec2 pixel;
    double w;        ///< inverse depth, 1/mm
    double sigma_w;  ///< its deviation
    double depth;    ///< 1 / w
  };

  /// Tangent planes w = q0 + q1 x + q2 y (x = dx / half) of the surfaces that pass within
  /// `radius_px` of the pixel, the nearest one first; at most two, none where no point is near.
  [[nodiscard]] std::vector<Quadric> planes(const Vec2& pixel, double radius_px, int half) const;

  /// Calls visit(point) for all points within radius_px.
  template <typename Visit>
  void for_each_near(const Vec2& pixel, double radius_px, Visit&& visit) const {
    for_cells_near(pixel, radius_px, [&](const std::vector<Point>& cell) {
      for (const Point& p : cell) {
        if ((p.pixel - pixel).squaredNorm() <= radius_px * radius_px) visit(p);
      }
    });
  }

 private:
  static constexpr double kCellPx = 8;
  [[nodiscard]] static int cell(double px) { return static_cast<int>(std::floor(px / kCellPx)); }

  /// Calls visit(points) for all cells that may hold such points.
  template <typename Visit>
  void for_cells_near(const Vec2& pixel, double radius_px, Visit&& visit) const {
    const int low_x = cell(pixel[0] - radius_px);
    const int high_x = cell(pixel[0] + radius_px);
    const int low_y = cell(pixel[1] - radius_px);
    const int high_y = cell(pixel[1] + radius_px);
    for (int y = std::max(0, low_y); y <= std::min(rows_ - 1, high_y); ++y) {
      for (int x = std::max(0, low_x); x <= std::min(columns_ - 1, high_x); ++x)
        visit(cells_[static_cast<std::size_t>(y * columns_ + x)]);
    }
  }

  int columns_ = 0;
  int rows_ = 0;
  double per_px_ = 0;  ///< length across a pixel at depth 1
  std::vector<std::vector<Point>> cells_;
};

}  // namespace pencilscan
