#include "pencilscan/surface/sample.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>

#include "pencilscan/core/error.h"
#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

void check_devices(const Rig& rig, const MeasuredPoint& p) {
  if (p.camera >= rig.cameras.size()) {
    throw InputError("points", "camera", std::to_string(p.camera), "must be an index of the rig");
  }
  if (p.projector >= rig.projectors.size()) {
    throw InputError("points", "projector", std::to_string(p.projector),
                     "must be an index of the rig");
  }
  const std::size_t patterns = rig.projectors[p.projector].patterns.size();
  if (p.pattern > 0 && p.pattern >= patterns) {
    throw InputError("points", "pattern", std::to_string(p.pattern),
                     "must be an index of the projector's patterns");
  }
}

/// Distance between the light sheets at x across them, and their normal. Distortion is ignored:
/// both only scale neighbourhoods.
std::pair<double, Vec3> light_sheet_at(const Projector& projector, std::size_t pattern_index,
                                       const Vec3& x) {
  const LinePattern fallback;
  const LinePattern& pattern =
      pattern_index < projector.patterns.size() ? projector.patterns[pattern_index] : fallback;
  const RigidTransform& pose = projector.device_from_world;
  const Vec3 local = pose * x;
  const int axis = pattern.axis == Axis::kColumn ? 0 : 1;
  const double z = std::max(std::abs(local.z()), 1e-9);
  const double slope = local[axis] / z;
  Vec3 normal = Vec3::Zero();
  normal[axis] = 1;
  normal.z() = -slope;
  const double spacing = pattern.pitch_px * z / projector.K(axis, axis) / normal.norm();
  return {spacing, pose.rotation.transpose() * normal.normalized()};
}

constexpr double kFarthest = 1e7;  // footprints: a ray that missed its sheet

using CurveKey = std::array<int, 4>;
CurveKey curve_key(const MeasuredPoint& p) { return {p.camera, p.projector, p.pattern, p.line}; }

}  // namespace

SampleSet sample_curves(const Rig& rig, std::span<const MeasuredPoint> points,
                        double sample_spacings) {
  SampleSet set;
  set.sample_of_point.assign(points.size(), -1);
  std::vector<std::uint32_t> order;
  std::vector<double> spacings;
  for (std::size_t i = 0; i < points.size(); ++i) {
    check_devices(rig, points[i]);
    if (!position_of(points[i]).allFinite() || position_of(points[i]).norm() > kFarthest) continue;
    order.push_back(static_cast<std::uint32_t>(i));
    spacings.push_back(light_sheet_at(rig.projectors[points[i].projector], points[i].pattern,
                                      position_of(points[i]))
                           .first);
  }
  set.spacing = upper_median(spacings);
  if (order.empty() || !(set.spacing > 0)) return set;

  const double cell = sample_spacings * set.spacing;
  const auto key = [&](std::uint32_t i) {
    const Vec3 x = position_of(points[i]) / cell;
    return std::tuple(curve_key(points[i]), std::floor(x[0]), std::floor(x[1]), std::floor(x[2]),
                      i);
  };
  using Key = decltype(key(0));
  std::vector<Key> keys;
  keys.reserve(order.size());
  for (const std::uint32_t i : order) keys.push_back(key(i));
  std::sort(keys.begin(), keys.end());

  std::uint32_t curve = 0;
  for (std::size_t begin = 0; begin < keys.size();) {
    const auto same_cell = [&](const Key& a, const Key& b) {
      return std::get<0>(a) == std::get<0>(b) && std::get<1>(a) == std::get<1>(b) &&
             std::get<2>(a) == std::get<2>(b) && std::get<3>(a) == std::get<3>(b);
    };
    if (begin > 0 && std::get<0>(keys[begin]) != std::get<0>(keys[begin - 1])) ++curve;
    SurfaceSample sample;
    double weight_sum = 0;
    std::size_t end = begin;
    for (; end < keys.size() && same_cell(keys[begin], keys[end]); ++end) {
      const std::uint32_t i = std::get<4>(keys[end]);
      const MeasuredPoint& p = points[i];
      // A sigma below a hundredth of the spacing (or none at all) must not make one point rule.
      const double sigma =
          std::max(std::isfinite(p.sigma) ? static_cast<double>(p.sigma) : 0.0, 0.01 * set.spacing);
      const double weight = 1 / (sigma * sigma);
      sample.position += weight * position_of(p);
      sample.confidence += std::isfinite(p.confidence) ? static_cast<double>(p.confidence) : 0.0;
      weight_sum += weight;
      ++sample.count;
      set.sample_of_point[i] = static_cast<std::int32_t>(set.samples.size());
    }
    const MeasuredPoint& p = points[std::get<4>(keys[begin])];
    sample.position /= weight_sum;
    // Neighbouring pixels of a curve share their error for the most part (blur, label,
    // calibration): the mean is taken to be as uncertain as one point.
    sample.sigma = std::sqrt(static_cast<double>(sample.count) / weight_sum);
    sample.confidence = std::clamp(sample.confidence / sample.count, 0.0, 1.0);
    sample.camera = p.camera;
    sample.projector = p.projector;
    sample.curve = curve;
    sample.to_camera = (rig.cameras[p.camera].center() - sample.position).normalized();
    std::tie(sample.spacing, sample.sheet_normal) =
        light_sheet_at(rig.projectors[p.projector], p.pattern, sample.position);
    set.samples.push_back(sample);
    begin = end;
  }
  return set;
}

}  // namespace pencilscan
