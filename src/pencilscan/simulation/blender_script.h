#pragma once

namespace pencilscan {

/// blender_render.py: what Blender runs of a scene.
extern const char* const kBlenderScript;

}  // namespace pencilscan
