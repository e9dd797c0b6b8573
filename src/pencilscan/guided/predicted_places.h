#pragma once

#include <cmath>
#include <optional>
#include <span>

#include "pencilscan/detection/curve.h"
#include "pencilscan/guided/guided_matching.h"
#include "pencilscan/view/places.h"

namespace pencilscan {

/// Predicted points of one camera by place, and which points of curves lie on their lines.
class PredictedPlaces {
 public:
  /// A predicted line that a point of a curve lies on.
  struct LineAt {
    LineName name;
    float spacing_px = 0;
  };

  PredictedPlaces(const Rig& rig, const std::vector<ColorFamily>& families, const Camera& camera,
                  const GuidedMatchingOptions& options);

  void set(std::span<const PredictedPoint> points);
  /// Width of the profile of a predicted line, px.
  [[nodiscard]] float expected_width(const PredictedPoint& p) const;
  /// True where a point so far across a predicted line lies on it.
  [[nodiscard]] bool is_near(float across_px, const PredictedPoint& p) const {
    return across_px < options_.max_offset_px &&
           across_px < options_.max_offset_lines * p.spacing_px;
  }
  /// Calls visit(predicted, across_px) for predicted points beside a curve point, up to twice the
  /// largest offset and somewhat more across. Their lines have its direction and are not much
  /// thinner: a curve that is wider than a line shows another line, or two.
  template <class Visit>
  void aligned(const CurvePoint& point, Visit visit) const {
    constexpr float kAlong = 1.5F;  // px
    constexpr float kWidest = 1.2F;
    const float reach = std::hypot(2 * static_cast<float>(options_.max_offset_px), kAlong);
    places_.around(point.position, reach, [&](const PredictedPoint& p) {
      const Eigen::Vector2f way = point.position - p.position;
      const float along = std::abs(way.x() * p.normal.y() - way.y() * p.normal.x());
      if (along > kAlong || !have_same_direction(point.normal, p.normal) ||
          point.width_px > kWidest * expected_width(p))
        return;
      visit(p, std::abs(way.dot(p.normal)));
    });
  }

  /// Of curves or lines with such normals.
  [[nodiscard]] static bool have_same_direction(const Eigen::Vector2f& normal,
                                                const Eigen::Vector2f& other) {
    constexpr float kSameDirection = 0.9F;  // cosine
    return std::abs(normal.dot(other)) >= kSameDirection;
  }
  /// The family's only line at a point of a curve; nothing where there is none, or more than one.
  [[nodiscard]] std::optional<LineAt> line_at(const CurvePoint& point, int family) const;
  /// True where the named line lies at a point of a curve, whatever else does.
  [[nodiscard]] bool lies_on(const CurvePoint& point, const LineName& name) const;

 private:
  const Rig& rig_;
  const std::vector<ColorFamily>& families_;
  const GuidedMatchingOptions& options_;
  Places<PredictedPoint> places_;
};

}  // namespace pencilscan
