#include "pencilscan/refinement/like_lines.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "pencilscan/geometry/light_sheet.h"

namespace pencilscan {
namespace {

/// Where the ray of a pixel meets the light sheet of a curve's line.
std::optional<Vec3> place_on(const Rig& rig, const Camera& camera,
                             const LikeLines::NamedCurve& curve, const Vec2& pixel) {
  const Projector& projector = rig.projectors[static_cast<std::size_t>(curve.pattern.projector)];
  const auto depth = RayInProjector(camera, projector, pixel)
                         .depth(curve.coordinate_px, rig.pattern(curve.pattern).axis);
  if (!depth) return std::nullopt;
  return camera.point_at_depth(pixel, *depth);
}

Vec2 tangent_of(const LikeLines::NamedCurve& curve) {
  return {-curve.normal.y(), curve.normal.x()};
}

struct TangentPlane {
  Vec3 point;
  Vec3 normal;  ///< towards the camera

  [[nodiscard]] std::optional<Vec3> at(const Camera& camera, const Vec2& pixel) const {
    const Ray ray = camera.ray(pixel);
    const double descent = normal.dot(ray.direction);
    if (!(descent < 0)) return std::nullopt;
    return ray.origin + normal.dot(point - ray.origin) / descent * ray.direction;
  }
};

/// Of the surface at a crossing: both curves lie on it.
std::optional<TangentPlane> tangent_plane(const Rig& rig, const Camera& camera, const Vec2& pixel,
                                          const LikeLines::NamedCurve& a,
                                          const LikeLines::NamedCurve& b) {
  const auto along = [&](const LikeLines::NamedCurve& curve) -> std::optional<Vec3> {
    const auto from = place_on(rig, camera, curve, pixel);
    const auto to = place_on(rig, camera, curve, pixel + tangent_of(curve));
    if (!from || !to) return std::nullopt;
    return *to - *from;
  };
  const auto point = place_on(rig, camera, a, pixel);
  const auto of_a = along(a);
  const auto of_b = along(b);
  if (!point || !of_a || !of_b) return std::nullopt;
  Vec3 normal = of_a->cross(*of_b);
  if (!(normal.norm() > 0)) return std::nullopt;
  normal.normalize();
  if (normal.dot(camera.center() - *point) < 0) normal = -normal;
  return TangentPlane{*point, normal};
}

/// Lines of a pattern on a plane, in a picture.
struct LinesInPicture {
  double line = 0;            ///< where the pixel is
  Vec2 slope = Vec2::Zero();  ///< of `line`, 1/px
};

std::optional<LinesInPicture> lines_in_picture(const Projector& projector,
                                               const LinePattern& pattern, const Camera& camera,
                                               const TangentPlane& plane, const Vec2& pixel) {
  const auto line_at = [&](const Vec2& at) -> std::optional<double> {
    const auto place = plane.at(camera, at);
    const auto seen = place ? projector.project(*place) : std::nullopt;
    if (!seen || !projector.contains(*seen)) return std::nullopt;
    return ((*seen)[static_cast<Eigen::Index>(pattern.axis)] - pattern.position_px(0)) /
           pattern.pitch_px;
  };
  const auto line = line_at(pixel);
  const auto right = line_at(pixel + Vec2(1, 0));
  const auto below = line_at(pixel + Vec2(0, 1));
  if (!line || !right || !below) return std::nullopt;
  return LinesInPicture{*line, {*right - *line, *below - *line}};
}

}  // namespace

bool LikeLines::may_touch(const Camera& camera, const Vec2& pixel, const NamedCurve& curve,
                          const NamedCurve& other) const {
  constexpr double kSameDirection = 0.9;  // cosine, as between a curve and a predicted line
  constexpr double kLeastCosine = 0.17;   // of the incidence, as of predicted lines
  constexpr double kEdges = 1;            // px: the blurred edges of two profiles (profile_fit.cpp)
  const int family = family_of(families_, curve.pattern);
  if (family < 0) return false;
  const auto& like = families_[static_cast<std::size_t>(family)].patterns;
  if (like.size() < 2) return false;
  const auto plane = tangent_plane(rig_, camera, pixel, curve, other);
  if (!plane) return false;
  const auto half_width_px = [&](const LinePattern& pattern, const LinesInPicture& lines) {
    return 0.5 * pattern.line_width_px / pattern.pitch_px / lines.slope.norm();
  };
  const auto lines_of = [&](const PatternRef& ref) {
    return lines_in_picture(rig_.projectors[static_cast<std::size_t>(ref.projector)],
                            rig_.pattern(ref), camera, *plane, pixel);
  };
  const auto own = lines_of(curve.pattern);
  if (!own) return false;
  return std::any_of(like.begin(), like.end(), [&](const PatternRef& ref) {
    if (ref == curve.pattern) return false;
    const Projector& projector = rig_.projectors[static_cast<std::size_t>(ref.projector)];
    const Vec3 to_light = projector.center() - plane->point;
    if (plane->normal.dot(to_light) < kLeastCosine * to_light.norm()) return false;
    const auto lines = lines_of(ref);
    if (!lines || std::abs(lines->slope.dot(curve.normal)) < kSameDirection * lines->slope.norm())
      return false;
    const double apart_px = std::abs(lines->line - std::round(lines->line)) / lines->slope.norm();
    return apart_px < half_width_px(rig_.pattern(curve.pattern), *own) +
                          half_width_px(rig_.pattern(ref), *lines) + kEdges;
  });
}

}  // namespace pencilscan
