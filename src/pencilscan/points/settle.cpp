#include "pencilscan/points/settle.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "pencilscan/core/chunks.h"
#include "pencilscan/core/parallel.h"

namespace pencilscan {
namespace {

/// What the surface around a point says of it.
struct Opinion {
  double depth = 0;  ///< camera z, mm
  double sigma = 0;  ///< mm along the ray
};

Opinion opinion_of(const SurfacePatch& patch, const Camera& camera, const Eigen::Vector2f& pixel,
                   double ray_length, const SettleOptions& options) {
  const double w = patch.inverse_depth(pixel);
  const double footprint = 1 / (w * camera.focal_px());
  const double depth_per_footprint = patch.gradient(pixel).norm() / w * camera.focal_px();
  const double model = options.model_px * footprint * (1 + depth_per_footprint) *
                       std::max(1.0, static_cast<double>(patch.spread));
  return {1 / w, std::hypot(patch.sigma / w, model) * ray_length};
}

/// Standard deviation of a settled point along the ray. `propagated`: the one that follows from the
/// noise of point and patch. The noise does not hold all errors: a quadratic patch cannot follow
/// every surface, curves end at depth steps, and neighbours share errors. So the result grows with
///   - `propagated`, but more slowly than it does,
///   - the disagreement of the points around (patch.spread),
///   - how far these points lie to one side (patch.one_sidedness),
///   - the bend of the patch,
///   - `deviations`: how many of their own deviations point and patch lie apart.
/// Exponents and scale were fitted to the errors of rendered objects by a program that is not kept.
/// They order and weigh points until depth is known; what is written comes from error_model.h.
double settled_sigma(double propagated, double deviations, const Camera& camera, double footprint,
                     const SurfacePatch& patch) {
  constexpr double kScale = 0.43;
  constexpr double kLeastSpread = 0.3;
  constexpr double kUsualBend = 0.6;  // footprints over the patch's scale
  const double bend = static_cast<double>(patch.coefficients.tail<3>().norm()) * camera.focal_px();
  // Single precision: the fit of these exponents is far coarser.
  const auto power = [](double x, float exponent) {
    return static_cast<double>(std::pow(static_cast<float>(x), exponent));
  };
  return kScale * footprint * power(propagated / footprint, 0.7F) *
         power(std::max(kLeastSpread, static_cast<double>(patch.spread)), 0.55F) *
         static_cast<double>(std::exp(1.9F * patch.one_sidedness)) *
         power(1 + bend / kUsualBend, 0.25F) * power(1 + deviations * deviations, 0.35F);
}

/// The point settled; nothing if it contradicts its surroundings.
std::optional<MeasuredPoint> settled(const MeasuredPoint& point, const LocalSurface& surface,
                                     const Camera& camera, const SettleOptions& options) {
  const Eigen::Vector2f pixel(point.u, point.v);
  const SurfacePatch* patch = surface.nearest(pixel);
  if (patch == nullptr) {
    if (point.confidence < static_cast<float>(options.min_alone_confidence)) return std::nullopt;
    constexpr float kAlone = 1.8F;  // such points lie at depth steps
    MeasuredPoint result = point;
    result.sigma *= kAlone;
    return result;
  }
  const Vec3 center = camera.center();
  const Vec3 way = Vec3(point.x, point.y, point.z) - center;
  const double depth = way.dot(camera.forward());
  const double ray_length = way.norm() / depth;
  const Opinion others = opinion_of(*patch, camera, pixel, ray_length, options);
  const double own2 = static_cast<double>(point.sigma) * point.sigma;
  const double others2 = others.sigma * others.sigma;
  const double apart = (others.depth - depth) * ray_length;
  const double deviations = std::abs(apart) / std::sqrt(own2 + others2);
  if (deviations > options.max_deviations) return std::nullopt;
  const double own_share = others2 / (own2 + others2);
  // Inverse depth is what varies linearly over the image.
  const double w = 1 / others.depth + own_share * (1 / depth - 1 / others.depth);
  MeasuredPoint result = point;
  set_position(center + way / (depth * w), result);
  result.sigma = static_cast<float>(settled_sigma(std::sqrt(own_share * own2), deviations, camera,
                                                  others.depth / camera.focal_px(), *patch));
  if (options.errors_are_shared) result.sigma = std::max(result.sigma, point.sigma);
  return result;
}

}  // namespace

std::vector<std::vector<MeasuredPoint>> points_by_camera(const Rig& rig,
                                                         std::span<const MeasuredPoint> points) {
  std::vector<std::vector<MeasuredPoint>> by_camera(rig.cameras.size());
  for (const MeasuredPoint& p : points) by_camera[p.camera].push_back(p);
  return by_camera;
}

std::vector<LocalSurface> local_surfaces(const Rig& rig, std::span<const MeasuredPoint> points,
                                         const LocalSurfaceOptions& options) {
  std::vector<LocalSurface> surfaces;
  for (const Camera& camera : rig.cameras) surfaces.emplace_back(camera, options);
  const auto by_camera = points_by_camera(rig, points);
  parallel_for(surfaces.size(), [&](std::size_t c) { surfaces[c].add(by_camera[c]); });
  return surfaces;
}

std::vector<MeasuredPoint> settle_points(const Rig& rig, std::vector<MeasuredPoint> points,
                                         std::span<const LocalSurface> surfaces,
                                         const SettleOptions& options) {
  std::vector<char> stays(points.size(), 0);
  parallel_chunks(points.size(), [&](std::size_t i) {
    const auto c = static_cast<std::size_t>(points[i].camera);
    const auto point = settled(points[i], surfaces[c], rig.cameras[c], options);
    if (!point) return;
    points[i] = *point;
    stays[i] = 1;
  });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (stays[i] != 0) points[kept++] = points[i];
  }
  points.resize(kept);
  return points;
}

}  // namespace pencilscan
