#pragma once

#include <span>
#include <vector>

#include "pencilscan/depth/window_fit.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/uncertainty/error_model.h"

namespace pencilscan {

/// Vertices that a picture denies by darkness: it shows no light where a line would have to be. Per
/// vertex, 1: so it is. Depth windows see the light around a hole, and vertices reach beyond the
/// last of them; neither asks whether there is light at the place itself.
///   1. In each picture, a pixel is lit in a family where its lines stand out: by three hundredths
///      of the highest line within three spacings, and beyond the noise of the dark; by six in any
///      case.
///   2. The line of a pattern that is predicted nearest to a vertex is at most half a spacing from
///      it, whatever the surface does around. A vertex is unlit in a camera that it faces and that
///      sees it if no pixel within half a spacing and a pixel is lit in the pattern's family,
///      although the projector lights the place of that line. Spacings are those of the surface
///      there, in that picture. Where one camera's depth made the vertex, light of other
///      families does not count: a surface that goes on before what lies behind its rim fits the
///      lines of one projector there, a line or more off, and lacks those of the others. So does
///      paint that gives back one family's light alone; depths of several cameras speak for it, and
///      there any light counts.
///   3. What else a camera sees in the disc without light of any family around such a vertex is
///      unlit too.
/// A place whose paint gives back less than that is denied as well: no picture tells it from a
/// hole, and nothing was measured there. `scene`: casts the shadows; within a footprint or so it is
/// the mesh. `lights`: with their noise or without; those of a rig in footprints.
/// `evidence`: of each vertex; empty: as of one camera.
[[nodiscard]] std::vector<char> unlit_vertices(const Rig& rig, const RayScene& scene,
                                               std::span<const CameraLight> lights,
                                               const TriangleMesh& mesh,
                                               std::span<const SurfaceEvidence> evidence = {});

}  // namespace pencilscan
