#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "pencilscan/depth/seeds.h"
#include "pencilscan/depth/window_fit.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {

/// What one camera may see beside the object: where the object cannot be, and points of it that
/// have named lines.
struct Background {
  ObjectSpace space;
  std::vector<MeasuredPoint> points;  ///< of this camera
};

/// A tangent plane as the start of a window's fit.
[[nodiscard]] Quadric quadric_of(const TangentView& at, int half);

/// Floors and walls in one camera. Their lines continue those of the object one or more lines off;
/// there a window may fit a surface in the air beside the object as well as the background that it
/// shows.
class BackgroundView {
 public:
  /// The light must outlive it. seed_radius_px: around a window, points that a fit may start from.
  BackgroundView(const CameraLight& light, const Background& background, double seed_radius_px);

  /// True when the background explains the window as well as the fit does.
  [[nodiscard]] bool shows(const Vec2& pixel, const WindowFit& fit, WindowFitter& fitter) const;

 private:
  [[nodiscard]] bool shows_named_lines(const Vec2& pixel, const WindowFit& fit,
                                       WindowFitter& fitter) const;
  [[nodiscard]] bool shows_floor(const Vec2& pixel, const WindowFit& fit,
                                 WindowFitter& fitter) const;
  [[nodiscard]] std::optional<double> line(std::size_t pattern, const Vec2& m,
                                           const Eigen::Matrix2d& jacobian, double w) const;

  const CameraLight& light_;
  double seed_radius_px_;
  std::optional<Floor> floor_;
  ObjectSpace space_;
  std::optional<CurveSeeds> seeds_;
};

}  // namespace pencilscan
