#include "pencilscan/simulation/photography.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/geometry/ray_scene.h"

namespace pencilscan {
namespace {

constexpr double kWidestBlur = 256;  ///< footprints that an object may go in an exposure

SensorPreset preset_of(const PhotographyOptions& options) {
  const std::optional<SensorPreset> preset = sensor_preset(options.noise);
  if (!preset)
    throw InputError("options", "noise", options.noise, "must be none, low, medium or high");
  return *preset;
}

/// What each camera's picture is lit with: a texture camera sees white light instead of patterns.
std::vector<PanelLight> lights_for(const Camera& camera, const Rig& rig, const FilmOptions& film) {
  std::vector<PanelLight> lights = line_lights(rig, film);
  if (!camera.sees_texture_only) return lights;
  for (std::size_t p = 0; p < lights.size(); ++p)
    lights[p] = gray_code_light(rig.projectors[p], {GrayCodeImage::Kind::kWhite});
  return lights;
}

}  // namespace

SensorOptions camera_sensor(const PhotographyOptions& options, const Camera& camera) {
  SensorOptions sensor = preset_of(options).sensor;
  // A rig that states how colours mix describes its cameras whole; a preset adds nothing to it.
  if (camera.states_color_matrix()) sensor.crosstalk = 0;
  sensor.crosstalk = options.crosstalk.value_or(sensor.crosstalk);
  sensor.blur_px = options.blur_px.value_or(sensor.blur_px);
  sensor.full_well = options.full_well.value_or(sensor.full_well);
  sensor.read_noise = options.read_noise.value_or(sensor.read_noise);
  sensor.gain = options.gain;
  sensor.gamma = camera.gamma;
  sensor.black_level = camera.black_level;
  sensor.mosaic = camera.mosaic ? camera.mosaic : options.interpolated;
  sensor.interpolated = !camera.mosaic;
  sensor.bit_depth = options.bits;
  return sensor;
}

RenderOptions scene_light(const PhotographyOptions& options) {
  RenderOptions render = options.render;
  render.ambient = options.ambient.value_or(preset_of(options).ambient);
  return render;
}

FilmOptions panel_film(const PhotographyOptions& options) {
  FilmOptions film = options.film;
  film.black_level = options.black_level.value_or(0);
  return film;
}

std::vector<SimulatedObject> through_exposure(const TriangleMesh& mesh, const Reflectance& surface,
                                              const RigidTransform& middle,
                                              const ExposurePath& motion, double footprint_mm) {
  PENCILSCAN_CHECK(footprint_mm > 0);
  constexpr double kStep = 0.5;  // footprints
  double reach = 0;
  if (!motion.turn_rad.isZero()) {
    for (const Vec3& v : mesh.vertices) reach = std::max(reach, (middle * v - motion.pivot).norm());
  }
  const double way = motion.shift.norm() + motion.turn_rad.norm() * reach;
  if (!(way <= kWidestBlur * footprint_mm)) {
    throw InputError("options", "motion", formatted(way, "%g") + " within an exposure",
                     "must be at most " + formatted(kWidestBlur * footprint_mm, "%.3g") + " (" +
                         formatted(kWidestBlur, "%g") + " pixels of the rig, in its unit)");
  }
  const int count = std::max(1, static_cast<int>(std::ceil(way / (kStep * footprint_mm))));
  std::vector<SimulatedObject> moments;
  for (int k = 0; k < count; ++k) {
    const RigidTransform at = motion.since_middle((k + 0.5) / count - 0.5) * middle;
    moments.emplace_back(mesh, surface, at);
  }
  return moments;
}

cv::Mat photograph(const Rig& rig, std::size_t c, std::span<const SimulatedObject> moments,
                   const PhotographyOptions& options, std::uint32_t image) {
  PENCILSCAN_CHECK(!moments.empty());
  const Camera& camera = rig.cameras[c];
  const std::vector<PanelLight> lights = lights_for(camera, rig, panel_film(options));
  const RenderOptions render = scene_light(options);
  cv::Mat light = render_camera(rig, c, moments.front(), lights, render);
  for (const SimulatedObject& moment : moments.subspan(1))
    light += render_camera(rig, c, moment, lights, render);
  light /= static_cast<double>(moments.size());
  return apply_sensor(light, camera_sensor(options, camera), options.seed, image);
}

cv::Mat photograph(const Rig& rig, std::size_t camera, const SimulatedObject& object,
                   const PhotographyOptions& options, std::uint32_t image) {
  return photograph(rig, camera, std::span(&object, 1), options, image);
}

void check_scene(const Rig& rig, const TriangleMesh& mesh, const std::string& name,
                 const std::string& rig_name) {
  require_patterns(rig, rig_name, "there is nothing to show");
  for (const Camera& camera : rig.cameras) {
    for (const Vec3& vertex : mesh.vertices) {
      const auto pixel = camera.project(vertex);
      if (pixel && camera.contains(*pixel)) return;
    }
  }
  // Of a wall, all vertices may lie out of view.
  const RayScene rays(mesh);
  constexpr int kAcross = 32;  // rays of a camera; chosen
  for (const Camera& camera : rig.cameras) {
    for (int j = 0; j <= kAcross; ++j) {
      for (int i = 0; i <= kAcross; ++i) {
        const Vec2 pixel(i * (camera.width - 1.0) / kAcross, j * (camera.height - 1.0) / kAcross);
        if (rays.first_hit(camera.ray(pixel))) return;
      }
    }
  }
  const BoundingBox box = bounding_box(mesh);
  std::ostringstream extent;
  extent << "[" << box.low.transpose() << "] to [" << box.high.transpose() << "]";
  throw InputError(name, "vertices", extent.str(),
                   "must lie in the view of at least one camera (--fit moves them there)");
}

}  // namespace pencilscan
