#include "pencilscan/grid/line_candidates.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/rig/view_of_volume.h"

namespace pencilscan {

std::optional<DepthRange> depth_range(const Camera& camera, const Sphere& volume,
                                      const Vec2& pixel) {
  const Vec3 direction = camera.normalized_from_pixel(pixel).homogeneous();
  const Vec3 center = camera.device_from_world * volume.center;
  // |z d - c|^2 = r^2
  const double a = direction.squaredNorm();
  const double b = direction.dot(center);
  const double discriminant = b * b - a * (center.squaredNorm() - volume.radius * volume.radius);
  if (discriminant <= 0) return std::nullopt;
  const double root = std::sqrt(discriminant);
  constexpr double kNearest = 1e-6;  // of the middle's depth, where the volume holds the camera
  const DepthRange range{std::max(kNearest * b / a, (b - root) / a), (b + root) / a};
  if (!(range.far > range.near)) return std::nullopt;
  return range;
}

std::vector<LineCandidate> line_candidates(const Rig& rig, const Camera& camera,
                                           const DepthRange& range, PatternRef ref,
                                           const Vec2& pixel) {
  const Projector& projector = rig.projectors[static_cast<std::size_t>(ref.projector)];
  const LinePattern& pattern = projector.patterns[static_cast<std::size_t>(ref.pattern)];
  const RayInProjector ray(camera, projector, pixel);
  std::vector<LineCandidate> candidates;
  const auto near = ray.pixel(range.near);
  const auto far = ray.pixel(range.far);
  if (!near || !far) return candidates;
  const auto axis = static_cast<Eigen::Index>(pattern.axis);
  const double a = pattern.coordinate((*near)[axis]);
  const double b = pattern.coordinate((*far)[axis]);
  // Near the projector's horizon they are beyond any int: cut before they become one.
  const double count = projector.line_count(pattern);
  const int first = static_cast<int>(std::clamp(std::ceil(std::min(a, b)), 0.0, count));
  const int last = static_cast<int>(std::clamp(std::floor(std::max(a, b)), -1.0, count - 1));
  for (int line = first; line <= last; ++line) {
    const auto depth = ray.depth(pattern.position_px(line), pattern.axis);
    if (!depth || *depth < range.near || *depth > range.far) continue;
    const auto at = ray.pixel(*depth);
    if (!at || !projector.contains(*at)) continue;
    candidates.push_back(
        {line, *depth, 1 / std::max(1e-6, std::abs(ray.slope(*depth, pattern.axis)))});
  }
  if (a > b) std::reverse(candidates.begin(), candidates.end());
  return candidates;
}

bool can_see_pattern(const Rig& rig, const Camera& camera, int projector) {
  // Light comes in at 77 degrees, and leaves so: a fifth of what it would be, on each way.
  constexpr double kMinCosine = -0.9;
  return gaze(camera).dot(gaze(rig.projectors[static_cast<std::size_t>(projector)])) > kMinCosine;
}

std::vector<float> phase_costs(const Rig& rig, const Camera& camera, const ColorFamily& family) {
  constexpr float kLeastShare = 1e-3F;  // opposite ones see none of each other's light
  const Vec3 center = working_volume(rig).center;
  const Vec3 to_camera = (camera.center() - center).normalized();
  std::vector<float> costs;
  for (const PatternRef& ref : family.patterns) {
    const Vec3 to_light = (rig.projector(ref.projector).center() - center).normalized();
    const float share = 0.5F * (1 + static_cast<float>(to_camera.dot(to_light)));
    costs.push_back(-std::log(std::max(share, kLeastShare)));
  }
  const float least = *std::min_element(costs.begin(), costs.end());
  for (float& cost : costs) cost -= least;
  return costs;
}

}  // namespace pencilscan
