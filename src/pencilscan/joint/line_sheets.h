#pragma once

#include <array>
#include <optional>
#include <vector>

#include "pencilscan/rig/rig.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

/// Every projected line of the patterns as planes in the frame of one camera, so that its depth at
/// any pixel costs one scalar product: a plane gives inverse depth that is linear in normalised
/// camera coordinates (x, y),
///   w(x, y) = q . (x, y, 1), q = -n / d for n . X + d = 0.
/// A distorting projector bends the sheet: it is cut along the line into tangent planes, one per
/// 64 px (their sagitta stays below a tenth of a pixel for usual lenses).
class LineSheets {
 public:
  LineSheets(const Rig& rig, const Camera& camera, PatternRef ref);

  struct Sheet {
    Eigen::Vector3f q = Eigen::Vector3f::Zero();
    float inverse_depth_per_px = 0;  ///< |dw / d(projector px across)| at the queried place
  };

  [[nodiscard]] int line_count() const { return line_count_; }
  /// Lines that find() may find, among them all it does; ascending.
  void candidates(const Eigen::Vector2f& normalized, float w_low, float w_high,
                  std::vector<int>& lines) const;
  /// The sheet of `line` where the ray through (x, y) meets it, if inside the panel and in
  /// [w_low, w_high].
  [[nodiscard]] bool find(int line, const Eigen::Vector2f& normalized, float w_low, float w_high,
                          Sheet& sheet) const;

 private:
  [[nodiscard]] std::size_t index(int line, int part) const {
    return static_cast<std::size_t>(line * parts_ + part);
  }

  int line_count_ = 0;
  int parts_ = 1;
  float part_size_px_ = 1;
  float extent_px_ = 0;  ///< panel size along the lines
  std::vector<Eigen::Vector3f> q_;
  /// The middle parts' q by component, eight lines together.
  std::vector<std::array<std::array<float, 8>, 3>> middle_;
  std::vector<Eigen::Vector3f> q_slope_;  ///< d q / d(projector px across)
  /// Position along its line, panel px, of the point at (x, y, 1) / w.
  [[nodiscard]] float along(const Eigen::Vector3f& ray, float w) const;

  /// Rows of the pinhole matrix that give the position along a line: numerator and denominator on
  /// (x, y, 1) + w (0, 0, 0, 1).
  Eigen::Vector4f along_ = Eigen::Vector4f::Zero();
  Eigen::Vector4f along_scale_ = Eigen::Vector4f::Zero();
  /// A distorting projector, in the camera's frame.
  std::optional<Device> bent_;
  Eigen::Index along_axis_ = 0;
};

}  // namespace pencilscan
