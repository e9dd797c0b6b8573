#pragma once

#include <cstdint>
#include <optional>

#include "pencilscan/artefact/artefact_points.h"
#include "pencilscan/artefact/plane_surface.h"

namespace pencilscan {

/// A ring of cameras sees both faces of a plate and its rim; flatness is of one face.
struct PlateFace {
  double thickness_mm = 1;                    ///< of the plate, > 0
  double border_mm = 0;                       ///< at the rim, left out; >= 0
  std::optional<double> length_mm, width_mm;  ///< of the face, where they are known
  std::uint64_t seed = 1;
};

/// What was measured of one face.
struct FacePoints {
  ArtefactPoints points;
  PlateRectangle rim;    ///< the border begins here
  PlaneSurface surface;  ///< in the face's plane, also beyond the rim
};

/// The points of the face that has most of them. The other face lies a thickness behind it: what is
/// nearer to that than to this face is left out, and so is what lies beyond the rim, less the
/// border. The rim is that of the known sides, placed_rectangle(), or else of all points near the
/// face. What lies before the face stays, however far off: it is an error of this face. Where
/// nothing lies a thickness off on either side, one face was measured and both sides stay.
[[nodiscard]] FacePoints points_of_face(const ArtefactPoints& points, const PlateFace& face);

}  // namespace pencilscan
