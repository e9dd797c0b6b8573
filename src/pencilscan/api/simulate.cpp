#include "pencilscan/api/simulate.h"

#include <array>
#include <cmath>
#include <vector>

#include "pencilscan/api/run_stages.h"
#include "pencilscan/core/error.h"
#include "pencilscan/geometry/used_vertices.h"
#include "pencilscan/simulation/photography.h"

namespace pencilscan {
namespace {

UpAxis up_axis(const std::string& name) {
  if (name == "x") return UpAxis::kX;
  if (name == "y") return UpAxis::kY;
  if (name == "z") return UpAxis::kZ;
  throw InputError("options", "up", name, "must be x, y or z");
}

void check_options(const SimulationOptions& options) {
  if (options.bits != 8 && options.bits != 16)
    throw InputError("options", "bits", std::to_string(options.bits), "must be 8 or 16");
  if (!(options.albedo >= 0 && options.albedo <= 1))
    throw InputError("options", "albedo", std::to_string(options.albedo), "must be in [0, 1]");
  if (!std::isfinite(options.rotate_rad))
    throw InputError("options", "rotate", std::to_string(options.rotate_rad), "must be finite");
  if (!options.translate_mm.allFinite())
    throw InputError("options", "translate", "", "must have three finite numbers");
  if (options.frame < 0)
    throw InputError("options", "frame", std::to_string(options.frame), "must be >= 0");
}

}  // namespace

SimulatedFrame simulate(const Rig& rig, const TriangleMesh& mesh,
                        const SimulationOptions& options) {
  check_options(options);
  if (mesh.faces.empty()) throw InputError("mesh", "faces", "0", "the mesh must have faces");
  TriangleMesh placed = turned_upright(without_unused_vertices(mesh), up_axis(options.up));
  if (options.fit) placed = fitted(std::move(placed), working_volume(rig));
  check_scene(rig, placed, "mesh", "rig");
  PhotographyOptions photo;
  photo.noise = options.noise;
  photo.seed = options.seed;
  photo.bits = options.bits;
  Reflectance surface;
  surface.albedo = options.albedo;
  surface.smooth = options.smooth;
  const Motion motion{options.rotate_rad, options.translate_mm, working_volume(rig).center};

  SimulatedFrame result;
  std::vector<std::string> stage_names;
  for (const Camera& camera : rig.cameras) stage_names.push_back("camera " + camera.name);
  const std::vector<std::string_view> stages(stage_names.begin(), stage_names.end());
  run_stages(options.progress, stages, [&](const Progress& progress) {
    const SimulatedObject object(placed, surface, motion.at(options.frame));
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      if (progress) progress(stages[c], 0);
      const auto image = static_cast<std::uint32_t>(
          static_cast<std::size_t>(options.frame) * rig.cameras.size() + c);
      result.images[rig.cameras[c].name] = photograph(rig, c, object, photo, image);
    }
    result.truth = object.mesh();
  });
  return result;
}

}  // namespace pencilscan
