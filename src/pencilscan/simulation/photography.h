#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/simulation/placement.h"
#include "pencilscan/simulation/render.h"
#include "pencilscan/simulation/sensor.h"

namespace pencilscan {

/// How the pictures of a scene come about. What is not stated is that of the preset `noise`.
struct PhotographyOptions {
  RenderOptions render;  ///< its ambient light counts only where `ambient` states it
  FilmOptions film;
  std::optional<double> black_level;  ///< of the film
  std::string noise = "none";         ///< none, low, medium, high
  std::optional<double> crosstalk;
  std::optional<double> ambient;
  std::optional<double> blur_px;
  std::optional<double> full_well;
  std::optional<double> read_noise;
  double gain = 1;
  int bits = 8;  ///< 8 or 16
  /// Pictures of cameras without a mosaic come through this one, interpolated.
  std::optional<Mosaic> interpolated;
  std::uint64_t seed = 1;
};

/// The sensor of one camera. InputError for an unknown preset.
[[nodiscard]] SensorOptions camera_sensor(const PhotographyOptions& options, const Camera& camera);
/// options.render with the ambient light of the preset, unless it is stated.
[[nodiscard]] RenderOptions scene_light(const PhotographyOptions& options);

/// options.film with the black level that is stated for it.
[[nodiscard]] FilmOptions panel_film(const PhotographyOptions& options);

/// An object at even steps through an exposure; `middle`: where half of the exposure has it. No
/// vertex steps by more than half a footprint (mm), below what a pixel resolves: the mean of the
/// moments' light is that of the exposure. One moment where nothing moves. InputError beyond 256
/// footprints, more than lines are apart in any picture of use: every moment is an object in
/// memory.
[[nodiscard]] std::vector<SimulatedObject> through_exposure(const TriangleMesh& mesh,
                                                            const Reflectance& surface,
                                                            const RigidTransform& middle,
                                                            const ExposurePath& motion,
                                                            double footprint_mm);

/// What camera `camera` of the rig stores of the rig's patterns on the object: 8U or 16U, RGB, or
/// one channel of a camera with a mosaic. A texture camera sees white light instead. The
/// `moments` of the object share the exposure: the light is their mean. `image`: a number of its
/// own for every picture of a run, which its noise depends on.
[[nodiscard]] cv::Mat photograph(const Rig& rig, std::size_t camera,
                                 std::span<const SimulatedObject> moments,
                                 const PhotographyOptions& options, std::uint32_t image);
/// The same of an object that stands still.
[[nodiscard]] cv::Mat photograph(const Rig& rig, std::size_t camera, const SimulatedObject& object,
                                 const PhotographyOptions& options, std::uint32_t image);

/// InputError, with `name` for the mesh, when no camera would see any of it; or when a projector
/// has nothing to show, with `rig_name`.
void check_scene(const Rig& rig, const TriangleMesh& mesh, const std::string& name,
                 const std::string& rig_name);

}  // namespace pencilscan
