#include "pencilscan/simulation/render.h"

#include <atomic>
#include <cmath>

#include "pencilscan/core/check.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/simulation/tracer.h"

namespace pencilscan {
namespace {

/// A projector as the inner loop needs it.
struct Lamp {
  const Device* device;
  Vec3 center;
  double reference_mm;  ///< distance at which the light has its nominal strength
};

Lamp make_lamp(const Rig& rig, std::size_t projector) {
  const Device& device = rig.projectors[projector];
  return {&device, device.center(), reference_distance(rig)};
}

/// Reflected share of the light that arrives: everything of the model but M * pattern.
double reflected(const SimulatedObject& object, const SightedPoint& sample, double albedo,
                 const Lamp& lamp, const Incidence& light, const RenderOptions& options) {
  double value = albedo * light.cosine;
  const Reflectance& surface = object.surface();
  if (surface.specular > 0) {
    const double half = (light.to_light + sample.to_camera).normalized().dot(sample.normal);
    if (half > 0) value += surface.specular * std::pow(half, 1 / surface.roughness);
  }
  const double falloff = options.inverse_square ? lamp.reference_mm / light.distance : 1;
  return options.exposure * falloff * falloff * value;
}

/// Calls shade(sample) for each of the rays of a pixel that hits the object.
template <typename Shade>
void for_each_hit(const CameraTracer& tracer, int x, int y, int samples, const Shade& shade) {
  for (int j = 0; j < samples; ++j) {
    for (int i = 0; i < samples; ++i) {
      const Vec2 pixel(x + (i + 0.5) / samples - 0.5, y + (j + 0.5) / samples - 0.5);
      if (const auto sample = tracer.trace(pixel)) shade(*sample);
    }
  }
}

}  // namespace

double reference_distance(const Rig& rig) {
  const Vec3 middle = working_volume(rig).center;
  double sum = 0;
  for (const Projector& projector : rig.projectors) sum += (projector.center() - middle).norm();
  return sum / static_cast<double>(rig.projectors.size());
}

cv::Mat render_camera(const Rig& rig, std::size_t camera_index, const SimulatedObject& object,
                      std::span<const PanelLight> lights, const RenderOptions& options) {
  PENCILSCAN_CHECK(lights.size() == rig.projectors.size() && options.samples >= 1);
  const Camera& camera = rig.cameras[camera_index];
  struct Source {
    Lamp lamp;
    const PanelLight* light;
    Mat3 color;
  };
  std::vector<Source> sources;
  for (std::size_t p = 0; p < lights.size(); ++p) {
    if (!lights[p].on()) continue;
    sources.push_back(
        {make_lamp(rig, p), &lights[p], camera.color_matrix_for(rig.projectors[p].name)});
  }
  const CameraTracer tracer(camera, object);
  const double per_ray = 1.0 / (options.samples * options.samples);
  cv::Mat image(camera.height, camera.width, CV_32FC3, cv::Scalar::all(0));
  parallel_for(static_cast<std::size_t>(camera.height), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < camera.width; ++x) {
      if (!tracer.may_hit(x, y)) continue;
      Vec3 sum = Vec3::Zero();
      for_each_hit(tracer, x, y, options.samples, [&](const SightedPoint& sample) {
        const double albedo = object.albedo_at(sample.point);
        sum += Vec3::Constant(options.ambient * albedo);
        for (const Source& source : sources) {
          const auto light = incidence(*source.lamp.device, source.lamp.center, sample);
          if (!light) continue;
          const Vec3 shown = source.light->at(light->pixel, light->footprint_px / options.samples);
          // Two thirds of the rays fall between lines: no shadow ray for those.
          if (shown.isZero(0) ||
              !object.lit(sample.point, sample.face_normal, source.lamp.center)) {
            continue;
          }
          sum += reflected(object, sample, albedo, source.lamp, *light, options) *
                 (source.color * shown);
        }
      });
      sum *= per_ray;
      image.at<cv::Vec3f>(y, x) = cv::Vec3f(
          static_cast<float>(sum.x()), static_cast<float>(sum.y()), static_cast<float>(sum.z()));
    }
  });
  return image;
}

std::vector<cv::Mat> render_sequence(const Rig& rig, std::size_t camera_index,
                                     std::size_t projector, const SimulatedObject& object,
                                     std::span<const PanelLight> sequence,
                                     const RenderOptions& options) {
  PENCILSCAN_CHECK(options.samples >= 1);
  const Camera& camera = rig.cameras[camera_index];
  const Lamp lamp = make_lamp(rig, projector);
  const CameraTracer tracer(camera, object);
  const double per_ray = 1.0 / (options.samples * options.samples);
  // White light seen by a grey camera: the mean response of the three channels.
  const double response = camera.color_matrix_for(rig.projectors[projector].name).sum() / 3;
  std::vector<cv::Mat> images;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    images.emplace_back(camera.height, camera.width, CV_32FC1, cv::Scalar::all(0));
  }
  std::atomic<bool> any = false;
  parallel_for(static_cast<std::size_t>(camera.height), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < camera.width; ++x) {
      if (!tracer.may_hit(x, y)) continue;
      for_each_hit(tracer, x, y, options.samples, [&](const SightedPoint& sample) {
        const double albedo = object.albedo_at(sample.point);
        if (options.ambient > 0) {
          const auto even = static_cast<float>(per_ray * options.ambient * albedo);
          for (cv::Mat& image : images) image.at<float>(y, x) += even;
        }
        const auto light = incidence(*lamp.device, lamp.center, sample);
        if (!light || !object.lit(sample.point, sample.face_normal, lamp.center)) return;
        any = true;
        const double share =
            per_ray * response * reflected(object, sample, albedo, lamp, *light, options);
        for (std::size_t i = 0; i < sequence.size(); ++i) {
          const Vec3 shown = sequence[i].at(light->pixel, light->footprint_px / options.samples);
          images[i].at<float>(y, x) += static_cast<float>(share * shown.mean());
        }
      });
    }
  });
  if (!any) images.clear();
  return images;
}

}  // namespace pencilscan
