#include "pencilscan/solution/predicted_lines.h"

#include <Eigen/Geometry>
#include <cmath>

namespace pencilscan {
namespace {

using Eigen::Vector2f;

/// Line coordinate of a pattern at camera pixels of known inverse depth.
class PatternOnSurface {
 public:
  PatternOnSurface(const Rig& rig, const Camera& camera, PatternRef ref)
      : camera_(camera),
        projector_(rig.projectors[static_cast<std::size_t>(ref.projector)]),
        pattern_(projector_.patterns[static_cast<std::size_t>(ref.pattern)]),
        bends_(projector_.has_distortion()) {
    const RigidTransform transform =
        projector_.device_from_world * camera.device_from_world.inverse();
    rotation_ = transform.rotation.cast<float>();
    translation_ = transform.translation.cast<float>();
    center_ = transform.inverse().translation;
    const auto axis = static_cast<Eigen::Index>(pattern_.axis);
    row_ = projector_.K.row(axis).cast<float>();
    other_row_ = projector_.K.row(1 - axis).cast<float>();
  }
  [[nodiscard]] const Vec3& center() const { return center_; }
  [[nodiscard]] int line_count() const { return projector_.line_count(pattern_); }

  /// ray: normalised camera coordinates (x, y, 1); NaN outside the panel.
  [[nodiscard]] float coordinate(const Eigen::Vector3f& ray, float w) const {
    const Eigen::Vector3f x = rotation_ * ray + w * translation_;
    if (!(x.z() > 0)) return std::nanf("");
    Eigen::Vector3f n = x / x.z();
    if (bends_) {
      n.head<2>() = distort(projector_.distortion, n.head<2>().cast<double>().eval()).cast<float>();
    }
    const float along = other_row_.dot(n);
    const float extent =
        static_cast<float>(pattern_.axis == Axis::kColumn ? projector_.height : projector_.width);
    if (!(along > -0.5F && along < extent - 0.5F)) return std::nanf("");
    return static_cast<float>(pattern_.coordinate(static_cast<double>(row_.dot(n))));
  }

 private:
  const Camera& camera_;
  const Projector& projector_;
  const LinePattern& pattern_;
  bool bends_;
  Eigen::Matrix3f rotation_;
  Eigen::Vector3f translation_;
  Vec3 center_;  ///< of the projector, in the camera frame
  Eigen::RowVector3f row_;
  Eigen::RowVector3f other_row_;
};

/// Normalised coordinates around a pixel, to first order.
struct LocalRays {
  Vector2f pixel;
  Vector2f normalized;
  Eigen::Matrix2f slope;

  LocalRays(const Camera& camera, const Vector2f& at) : pixel(at) {
    const auto n = [&](float dx, float dy) -> Vector2f {
      return camera.normalized_from_pixel((at + Vector2f(dx, dy)).cast<double>()).cast<float>();
    };
    normalized = n(0, 0);
    slope.col(0) = (n(2, 0) - n(-2, 0)) / 4;
    slope.col(1) = (n(0, 2) - n(0, -2)) / 4;
  }
  [[nodiscard]] Eigen::Vector3f ray(const Vector2f& at) const {
    return (normalized + slope * (at - pixel)).homogeneous();
  }
};

/// Cosine of the incidence of the light; negative: the surface faces away.
double incidence(const LocalRays& rays, const SurfacePatch& patch, const Vec3& projector) {
  // Plane q . X = 1: w is linear in the normalised pixel with gradient q_xy.
  const Vector2f g = rays.slope.transpose().inverse() * patch.gradient(patch.pixel);
  const float w = patch.inverse_depth(patch.pixel);
  const Vec3 q(g.x(), g.y(), w - g.dot(rays.normalized));
  const Vec3 point = rays.normalized.homogeneous().cast<double>() / static_cast<double>(w);
  return (1 - q.dot(projector)) / (q.norm() * (projector - point).norm());
}

}  // namespace

std::vector<PredictedPoint> predict_lines(const Rig& rig, const Camera& camera,
                                          const LocalSurface& surface, PatternRef ref,
                                          const PredictionOptions& options) {
  const PatternOnSurface pattern(rig, camera, ref);
  const int lines = pattern.line_count();
  const int step = surface.step_px();
  const int side = step + 1;
  std::vector<float> coordinates(static_cast<std::size_t>(side * side));
  std::vector<PredictedPoint> result;
  for (const SurfacePatch& patch : surface.patches()) {
    if (!patch.exists()) continue;
    const LocalRays rays(camera, patch.pixel);
    if (incidence(rays, patch, pattern.center()) < options.min_incidence_cos) continue;
    const float w = patch.inverse_depth(patch.pixel);
    const Eigen::Vector3f middle = rays.ray(patch.pixel);
    const float here = pattern.coordinate(middle, w);
    const float sigma_lines =
        std::abs(pattern.coordinate(middle, w * (1 + 1e-4F)) - here) * 1e4F * patch.sigma;
    if (!(sigma_lines < static_cast<float>(options.max_sigma_lines))) continue;
    const float x0 = patch.pixel.x() - 0.5F * static_cast<float>(step - 1);
    const float y0 = patch.pixel.y() - 0.5F * static_cast<float>(step - 1);
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const Vector2f at(x0 + static_cast<float>(x), y0 + static_cast<float>(y));
        coordinates[static_cast<std::size_t>(y * side + x)] =
            pattern.coordinate(rays.ray(at), patch.inverse_depth(at));
      }
    }
    for (int y = 0; y < step; ++y) {
      for (int x = 0; x < step; ++x) {
        const auto i = static_cast<std::size_t>(y * side + x);
        const float c = coordinates[i];
        const Vector2f slope(coordinates[i + 1] - c,
                             coordinates[i + static_cast<std::size_t>(side)] - c);
        const Eigen::Index along = std::abs(slope.x()) >= std::abs(slope.y()) ? 0 : 1;
        const float next = c + slope[along];
        const float norm = slope.norm();
        if (!(norm * static_cast<float>(options.min_spacing_px) < 1)) continue;
        const auto line = static_cast<int>(std::ceil(std::min(c, next)));
        if (static_cast<float>(line) >= std::max(c, next) || line < 0 || line >= lines) continue;
        PredictedPoint point{ref, line, {}, slope / norm, 1 / norm, sigma_lines / norm};
        point.position = Vector2f(x0 + static_cast<float>(x), y0 + static_cast<float>(y));
        point.position[along] += (static_cast<float>(line) - c) / slope[along];
        result.push_back(point);
      }
    }
  }
  return result;
}

}  // namespace pencilscan
