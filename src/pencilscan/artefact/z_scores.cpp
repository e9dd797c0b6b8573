#include "pencilscan/artefact/z_scores.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {

std::optional<double> error_along_ray(const Sphere& sphere, const Vec3& point, const Vec3& center) {
  // |center + t d - c|^2 = R^2 with t counted from the point: t^2 + 2 b t + q = 0.
  const Vec3 direction = (point - center).normalized();
  const Vec3 offset = point - sphere.center;
  const double b = direction.dot(offset);
  const double q = offset.squaredNorm() - sphere.radius * sphere.radius;
  const double root = b * b - q;
  if (!(root >= 0)) return std::nullopt;
  const double near = -b - std::sqrt(root), far = -b + std::sqrt(root);
  return -(std::abs(near) < std::abs(far) ? near : far);
}

std::optional<ZScores> z_scores(const ArtefactPoints& points, const Rig* rig,
                                const SurfaceError& error) {
  if (points.sigma.empty()) return std::nullopt;
  const bool along_rays = !points.origins.empty();
  if (along_rays && rig == nullptr) return std::nullopt;
  ZScores scores;
  std::size_t below[3] = {};
  double sum = 0;
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    if (!(points.sigma[i] > 0) || !std::isfinite(points.sigma[i])) continue;
    std::optional<Vec3> center;
    if (along_rays) {
      const auto camera = static_cast<std::size_t>(points.origins[i].camera);
      if (camera >= rig->cameras.size()) continue;
      center = rig->cameras[camera].center();
    }
    ++scores.count;
    const auto found = error(points.points[i], center);
    if (!found) {
      ++scores.missed;
      continue;
    }
    const double z = std::abs(*found) / static_cast<double>(points.sigma[i]);
    for (int k = 0; k < 3; ++k) below[k] += z < k + 1 ? 1 : 0;
    sum += z * z;
    scores.greatest = std::max(scores.greatest, z);
  }
  if (scores.count == 0) return std::nullopt;
  const auto share = [&](std::size_t n) {
    return static_cast<double>(n) / static_cast<double>(scores.count);
  };
  scores.below_1 = share(below[0]);
  scores.below_2 = share(below[1]);
  scores.below_3 = share(below[2]);
  const std::size_t hits = scores.count - scores.missed;
  scores.rms = hits > 0 ? std::sqrt(sum / static_cast<double>(hits)) : 0;
  return scores;
}

}  // namespace pencilscan
