#pragma once

#include <algorithm>
#include <cmath>

#include "pencilscan/simulation/render.h"
#include "pencilscan/simulation/tracer.h"

namespace pencilscan {

// The model of render.h, ray by ray: shared by all that render.

/// A projector as the inner loop needs it.
struct Lamp {
  Vec3 center;
  double reference_mm;  ///< distance at which the light has its nominal strength
};

[[nodiscard]] inline Lamp make_lamp(const Rig& rig, std::size_t projector) {
  return {rig.projectors[projector].center(), reference_distance(rig)};
}

/// Reflected share of the light that arrives: everything of the model but M * pattern.
[[nodiscard]] inline double reflected(const SimulatedObject& object, const SightedPoint& sample,
                                      double albedo, const Lamp& lamp, const Incidence& light,
                                      const RenderOptions& options) {
  double value = albedo * light.cosine;
  const Reflectance& surface = object.surface();
  if (surface.specular > 0) {
    const double half = (light.to_light + sample.to_camera).normalized().dot(sample.normal);
    if (half > 0) value += surface.specular * std::pow(half, 1 / surface.roughness);
  }
  const double falloff = options.inverse_square ? lamp.reference_mm / light.distance : 1;
  return options.exposure * falloff * falloff * value;
}

/// Rays of one camera through its pixels, of each colour where its lens bends them.
class PixelRays {
 public:
  PixelRays(const Camera& camera, const SimulatedObject& object, int samples)
      : camera_(camera), tracer_(camera, object), samples_(samples) {}

  /// Calls shade(sample, colors) for every ray of a pixel that hits the object; colors: 1 for those
  /// of red, green and blue that come along it.
  template <typename Shade>
  void for_each_hit(int x, int y, const Shade& shade) const {
    if (camera_.color_registration.none()) {
      if (!tracer_.may_hit(x, y)) return;
      for_each_sample(x, y, [&](const Vec2& pixel) {
        if (const auto sample = tracer_.trace(pixel)) shade(*sample, Vec3(1, 1, 1));
      });
      return;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const auto bent = [&](const Vec2& pixel) {
        return camera_.color_registration.from_color(k, camera_, pixel);
      };
      const Vec2 middle = bent(Vec2(x, y));
      const auto near = [](double at, int size) {
        return std::clamp(static_cast<int>(std::lround(at)), 0, size - 1);
      };
      if (!tracer_.may_hit(near(middle.x(), camera_.width), near(middle.y(), camera_.height)))
        continue;
      for_each_sample(x, y, [&](const Vec2& pixel) {
        if (const auto sample = tracer_.trace(bent(pixel)))
          shade(*sample, Vec3::Unit(static_cast<Eigen::Index>(k)));
      });
    }
  }

 private:
  template <typename Visit>
  void for_each_sample(int x, int y, const Visit& visit) const {
    for (int j = 0; j < samples_; ++j)
      for (int i = 0; i < samples_; ++i)
        visit(Vec2(x + (i + 0.5) / samples_ - 0.5, y + (j + 0.5) / samples_ - 0.5));
  }

  const Camera& camera_;
  CameraTracer tracer_;
  int samples_;
};

}  // namespace pencilscan
