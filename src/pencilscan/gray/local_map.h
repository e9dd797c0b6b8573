#pragma once

#include <optional>

#include "pencilscan/geometry/types.h"
#include "pencilscan/gray/gray_decode.h"

namespace pencilscan {

struct LocalMapOptions {
  int radius_px = 5;            ///< half side of the window, camera px, >= 2
  int largest_radius_px = 9;    ///< it grows to this while crossings are few
  int least_crossings = 14;     ///< per axis, >= 8
  double edge_sigma_px = 0.05;  ///< of a crossing's place beyond noise (rendering, blur), > 0
  /// Texture finer than the blur pushes all crossings of a window one way, unseen by their scatter.
  double bias_sigma_px = 0.012;
  double worst_rms_px = 0.6;   ///< of the crossings about the fit, panel px
  double least_inliers = 0.7;  ///< share of the crossings that fit
};

/// How one camera sees a piece of panel: near the pixel, each panel coordinate is a quadratic
///   x(u, v) = c0 + c1 a + c2 b + c3 a^2 + c4 a b + c5 b^2,   (a, b) = (u, v) - center,
/// fitted robustly (Tukey's weights) to the places where the code changes, which a plane or a
/// smooth surface passes within a few hundredths of a pixel.
class LocalMap {
 public:
  /// Nothing when the pixel has no code or lies outside of the picture, the crossings are too few
  /// or one-sided, or no smooth surface explains them (a depth edge).
  [[nodiscard]] static std::optional<LocalMap> fit(const DecodedView& view, int u, int v,
                                                   const LocalMapOptions& options = {});

  /// Panel coordinates at a camera pixel.
  [[nodiscard]] Vec2 panel_from_camera(const Vec2& pixel) const;
  /// d panel / d camera there.
  [[nodiscard]] Eigen::Matrix2d jacobian(const Vec2& pixel) const;
  /// The camera pixel of a panel coordinate, if within `reach_px` of the centre.
  [[nodiscard]] std::optional<Vec2> camera_from_panel(const Vec2& panel, double reach_px) const;
  /// One standard deviation of each panel coordinate at the centre, px.
  [[nodiscard]] const Vec2& sigma_panel_px() const { return sigma_; }
  /// Covariance of a camera pixel found by camera_from_panel(), px^2.
  [[nodiscard]] Eigen::Matrix2d camera_covariance(const Vec2& pixel) const;

 private:
  Vec2 center_ = Vec2::Zero();
  Eigen::Matrix<double, 2, 6> coefficients_ = Eigen::Matrix<double, 2, 6>::Zero();
  Vec2 sigma_ = Vec2::Zero();
};

/// Share of the pixels with a code, on a lattice, whose surroundings have a LocalMap: near 1 for
/// surfaces, near 0 when the images are in the wrong order.
[[nodiscard]] double smooth_share(const DecodedView& view, int step_px = 8,
                                  const LocalMapOptions& options = {});

}  // namespace pencilscan
