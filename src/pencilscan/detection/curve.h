#pragma once

#include <Eigen/Core>
#include <vector>

namespace pencilscan {

/// One sub-pixel point of a detected curve, about one per pixel of arc length.
struct CurvePoint {
  Eigen::Vector2f position = Eigen::Vector2f::Zero();  ///< camera pixel
  Eigen::Vector2f normal = Eigen::Vector2f::UnitX();  ///< unit; (normal, tangent) turns like (x, y)
  float sigma_px = 0;   ///< standard deviation of the position along the normal
  float amplitude = 0;  ///< height of the line above its surroundings, presence channel
  float width_px = 0;   ///< standard deviation of the profile
  float response = 0;   ///< ridge filter response

  [[nodiscard]] Eigen::Vector2f tangent() const { return {-normal.y(), normal.x()}; }
};

/// A detected curve: what a camera sees of (a piece of) one projected line of one colour family.
struct Curve {
  int family = 0;
  std::vector<CurvePoint> points;  ///< in order; consecutive points lie about 1 px apart
  /// Soft code evidence, points.size() x family colours: log-likelihood of each colour, the best 0.
  std::vector<float> code;
};

}  // namespace pencilscan
