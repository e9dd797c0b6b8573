#pragma once

#include <filesystem>

#include "pencilscan/rig/rig.h"
#include "pencilscan/simulation/render.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {

/// InputError (naming the rig file) when POV-Ray 3.7 cannot show this: it knows no camera lens
/// distortion, and colour matrices and procedural noise of ours are not translated.
void check_povray_can_show(const Rig& rig, const Reflectance& surface,
                           const std::filesystem::path& rig_path);

/// Writes mesh.inc, rig.inc, and per camera <camera>.pov and <camera>.ini into `folder`; `povray
/// <camera>.ini`, run there, writes <camera>.png (16 bit, linear light). The same model as
/// render_camera(): every line of a pattern is a slit (mesh) in front of its projector's point
/// light, which shines only through the slits (`projected_through`), one light per colour; slits of
/// a distorted projector are bent. The film is continuous and sharp; no sensor effects. POV-Ray
/// counts axes left-handed: the scene is the world as it is, the camera's vectors carry the
/// handedness. Its light fades as 2 / (1 + (d / d0)^2): d0 = D / 100 makes that (D / d)^2 to 1e-4.
void write_povray_scene(const std::filesystem::path& folder, const Rig& rig,
                        const SimulatedObject& object, const RenderOptions& options = {});

}  // namespace pencilscan
