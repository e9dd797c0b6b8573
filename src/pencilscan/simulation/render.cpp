#include "pencilscan/simulation/render.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "pencilscan/core/check.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/simulation/shading.h"

namespace pencilscan {
namespace {

/// What a projector shows at a place of its model's panel, of the colours that are 1 and not 0.
Vec3 shown_at(const Projector& projector, const PanelLight& light, const Vec2& pixel,
              const Vec2& box_px, const Vec3& colors) {
  if (projector.color_registration.none()) return light.at(pixel, box_px).cwiseProduct(colors);
  Vec3 shown = Vec3::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    if (colors[i] != 0)
      shown[i] = light.at(projector.color_registration.of_color(k, projector, pixel), box_px)[i];
  }
  return shown;
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
    const Projector* projector;
    Lamp lamp;
    const PanelLight* light;
    Mat3 color;
  };
  std::vector<Source> sources;
  for (std::size_t p = 0; p < lights.size(); ++p) {
    if (!lights[p].on()) continue;
    sources.push_back({&rig.projectors[p], make_lamp(rig, p), &lights[p],
                       camera.color_matrix_for(rig.projectors[p].name)});
  }
  const PixelRays rays(camera, object, options.samples);
  const double per_ray = 1.0 / (options.samples * options.samples);
  cv::Mat image(camera.height, camera.width, CV_32FC3, cv::Scalar::all(0));
  parallel_for(static_cast<std::size_t>(camera.height), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < camera.width; ++x) {
      Vec3 sum = Vec3::Zero();
      rays.for_each_hit(x, y, [&](const SightedPoint& sample, const Vec3& colors) {
        const double albedo = object.albedo_at(sample.point);
        sum += options.ambient * albedo * colors;
        for (const Source& source : sources) {
          const auto light = incidence(*source.projector, source.lamp.center, sample);
          if (!light) continue;
          const Vec3 shown = shown_at(*source.projector, *source.light, light->pixel,
                                      light->footprint_px / options.samples, colors);
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

namespace {

/// What a sequence of patterns looks like in so many channels, grey or RGB; empty where no point
/// that the projector lights is seen.
std::vector<cv::Mat> render_patterns_of(const Rig& rig, std::size_t camera_index,
                                        std::size_t projector_index, const SimulatedObject& object,
                                        std::span<const PanelLight> sequence, bool in_color,
                                        const RenderOptions& options) {
  PENCILSCAN_CHECK(options.samples >= 1);
  const Camera& camera = rig.cameras[camera_index];
  const Projector& projector = rig.projectors[projector_index];
  const Lamp lamp = make_lamp(rig, projector_index);
  const PixelRays rays(camera, object, options.samples);
  const double per_ray = 1.0 / (options.samples * options.samples);
  const Mat3 matrix = camera.color_matrix_for(projector.name);
  // White light seen by a grey camera: the mean response of the three channels.
  const double response = matrix.sum() / 3;
  std::vector<cv::Mat> images;
  for (std::size_t i = 0; i < sequence.size(); ++i)
    images.emplace_back(camera.height, camera.width, in_color ? CV_32FC3 : CV_32FC1,
                        cv::Scalar::all(0));
  const auto add = [&](cv::Mat& image, int x, int y, double share, const Vec3& light, bool mixed) {
    if (!in_color) {
      image.at<float>(y, x) += static_cast<float>((mixed ? response : 1) * share * light.mean());
      return;
    }
    const Vec3 seen = share * (mixed ? matrix * light : light);
    image.at<cv::Vec3f>(y, x) += cv::Vec3f(
        static_cast<float>(seen.x()), static_cast<float>(seen.y()), static_cast<float>(seen.z()));
  };
  std::atomic<bool> any = false;
  parallel_for(static_cast<std::size_t>(camera.height), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < camera.width; ++x) {
      rays.for_each_hit(x, y, [&](const SightedPoint& sample, const Vec3& colors) {
        const double albedo = object.albedo_at(sample.point);
        if (options.ambient > 0) {
          for (cv::Mat& image : images)
            add(image, x, y, per_ray * options.ambient * albedo, colors, false);
        }
        const auto light = incidence(projector, lamp.center, sample);
        if (!light || !object.lit(sample.point, sample.face_normal, lamp.center)) return;
        any = true;
        const double share = per_ray * reflected(object, sample, albedo, lamp, *light, options);
        for (std::size_t i = 0; i < sequence.size(); ++i)
          add(images[i], x, y, share,
              shown_at(projector, sequence[i], light->pixel, light->footprint_px / options.samples,
                       colors),
              true);
      });
    }
  });
  if (!any) images.clear();
  return images;
}

}  // namespace

std::vector<cv::Mat> render_sequence(const Rig& rig, std::size_t camera, std::size_t projector,
                                     const SimulatedObject& object,
                                     std::span<const PanelLight> sequence,
                                     const RenderOptions& options) {
  return render_patterns_of(rig, camera, projector, object, sequence, false, options);
}

std::vector<cv::Mat> render_color_sequence(const Rig& rig, std::size_t camera,
                                           std::size_t projector, const SimulatedObject& object,
                                           std::span<const PanelLight> sequence,
                                           const RenderOptions& options) {
  return render_patterns_of(rig, camera, projector, object, sequence, true, options);
}

}  // namespace pencilscan
