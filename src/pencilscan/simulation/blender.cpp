#include "pencilscan/simulation/blender.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/simulation/blender_script.h"
#include "pencilscan/simulation/other_renderer.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// Texels of the film per panel pixel and axis: half a texel is below what any blur leaves.
constexpr int kTexels = 4;
/// Steps along each side of the panel where a distorted film is looked for.
constexpr int kSideSteps = 32;

ordered_json rows_of(const Mat3& m) {
  ordered_json rows;
  for (Eigen::Index r = 0; r < 3; ++r) rows.push_back({m(r, 0), m(r, 1), m(r, 2)});
  return rows;
}

ordered_json pose_of(const Device& device) {
  const Vec3& t = device.device_from_world.translation;
  return {{"name", device.name},
          {"R", rows_of(device.device_from_world.rotation)},
          {"t", {t.x(), t.y(), t.z()}}};
}

/// The part of the plane z = 1 before a projector that its panel lights.
struct FilmPlane {
  Vec2 low = Vec2::Constant(1e300);
  Vec2 high = Vec2::Constant(-1e300);
};

FilmPlane film_plane(const Projector& projector) {
  FilmPlane plane;
  const auto reach = [&](double u, double v) {
    const Vec2 at =
        projector.normalized_from_pixel({u * projector.width - 0.5, v * projector.height - 0.5});
    plane.low = plane.low.cwiseMin(at);
    plane.high = plane.high.cwiseMax(at);
  };
  for (int i = 0; i <= kSideSteps; ++i) {
    const double share = static_cast<double>(i) / kSideSteps;
    for (const double side : {0.0, 1.0}) {
      reach(share, side);
      reach(side, share);
    }
  }
  return plane;
}

cv::Mat film_image(const Projector& projector, const FilmPlane& plane, const PanelLight& light) {
  const int width = kTexels * projector.width;
  const int height = kTexels * projector.height;
  const Vec2 extent = plane.high - plane.low;
  cv::Mat image(height, width, CV_32FC3);
  parallel_for(static_cast<std::size_t>(height), [&](std::size_t row) {
    for (int column = 0; column < width; ++column) {
      const Vec2 share((column + 0.5) / width, (static_cast<double>(row) + 0.5) / height);
      const Vec3 ray = (plane.low + share.cwiseProduct(extent)).homogeneous();
      const Vec2 pixel = projector.pixel_from_device(ray);
      Vec3 value = Vec3::Zero();
      if (projector.contains(pixel)) value = light.at(pixel, Vec2::Constant(1.0 / kTexels));
      image.at<cv::Vec3f>(static_cast<int>(row), column) = cv::Vec3f(
          static_cast<float>(value[0]), static_cast<float>(value[1]), static_cast<float>(value[2]));
    }
  });
  return image;
}

ordered_json material_of(const Reflectance& surface) {
  const double a = surface.albedo;
  if (surface.specular == 0) return {{"Color", {a, a, a, 1}}};
  // Blinn's exponent n and Beckmann's roughness m describe the same lobe for m^2 = 2 / (n + 2)
  // (Walter et al. 2007, section 5.2); Blender's roughness is the root of m.
  const double exponent = 1 / surface.roughness;
  return {{"Base Color", {a, a, a, 1}},
          {"Specular", std::min(1.0, surface.specular)},
          {"Roughness", std::pow(2 / (exponent + 2), 0.25)}};
}

}  // namespace

void check_blender_can_show(const Rig& rig, const Reflectance& surface, const fs::path& rig_path) {
  check_other_renderer_can_show(rig, rig_path, "--export-blender", "Blender 3.4");
  for (const Camera& camera : rig.cameras) {
    if (camera.K(0, 1) != 0) {
      throw InputError(rig_path.string(), camera.name + ".K", "",
                       "must have no skew for --export-blender: its cameras have none");
    }
    if (camera.sees_texture_only) {
      throw InputError(rig_path.string(), camera.name + ".role", "",
                       "must not be texture for --export-blender: patterns stay on");
    }
  }
  if (surface.texture.kind != TextureKind::kNone) {
    throw InputError("--texture", "", "",
                     "must be none with --export-blender: give the material one in scene.json");
  }
}

void write_blender_scene(const fs::path& folder, const Rig& rig, const Reflectance& surface,
                         const FilmOptions& film, const RenderOptions& options) {
  ordered_json scene;
  scene["reference_distance"] = reference_distance(rig);
  scene["exposure"] = options.exposure;
  scene["falloff"] = options.inverse_square;
  scene["ambient"] = options.ambient;
  scene["samples"] = 256;
  scene["bounces"] = 4;
  scene["aperture"] = 0;
  scene["smooth"] = surface.smooth;
  scene["material"] = material_of(surface);
  for (const Camera& camera : rig.cameras) {
    ordered_json device = pose_of(camera);
    device["width"] = camera.width;
    device["height"] = camera.height;
    device["K"] = rows_of(camera.K);
    scene["cameras"].push_back(device);
  }
  for (const Projector& projector : rig.projectors) {
    const FilmPlane plane = film_plane(projector);
    ordered_json device = pose_of(projector);
    device["film"] = {plane.low.x(), plane.low.y(), plane.high.x(), plane.high.y()};
    scene["projectors"].push_back(device);
    write_image(folder / "film" / (projector.name + ".png"),
                film_image(projector, plane, line_light(projector, film)), 16);
  }
  write_json(folder / "scene.json", scene);
  write_text(folder / "render.py", kBlenderScript);
}

void write_blender_object(const fs::path& folder, const std::string& frame,
                          const SimulatedObject& object) {
  write_mesh(folder / "objects" / (frame + ".ply"), object.mesh());
}

}  // namespace pencilscan
