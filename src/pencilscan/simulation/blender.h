#pragma once

#include <filesystem>

#include "pencilscan/rig/rig.h"
#include "pencilscan/simulation/render.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {

/// InputError (naming the rig file) when Blender's cameras and lights cannot show this rig.
void check_blender_can_show(const Rig& rig, const Reflectance& surface,
                            const std::filesystem::path& rig_path);

/// Writes what Blender 3.4 needs to path-trace the rig's frames with Cycles: render.py, scene.json
/// (devices, exposure, material; what it may hold is said in render.py) and film/<projector>.png.
/// The objects are added by write_blender_object(). `blender -b -P render.py` writes
/// light/<frame>/<camera>.png there: linear light, 16 bit, the same as render_camera() of a matt
/// surface without light from surface to surface. The film of a distorted projector is bent.
void write_blender_scene(const std::filesystem::path& folder, const Rig& rig,
                         const Reflectance& surface, const FilmOptions& film,
                         const RenderOptions& options);
/// Adds frame `frame` (its name) of the object.
void write_blender_object(const std::filesystem::path& folder, const std::string& frame,
                          const SimulatedObject& object);

}  // namespace pencilscan
