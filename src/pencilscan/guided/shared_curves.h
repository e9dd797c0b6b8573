#pragma once

#include <span>
#include <vector>

#include "pencilscan/guided/line_chains.h"
#include "pencilscan/guided/named_points.h"
#include "pencilscan/guided/predicted_places.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

/// A stretch of a curve once more, under the name of another line that its light shows too.
struct SharedCurve {
  Curve curve;  ///< without code
  LineName name;
};

/// Lines of two projectors with like colours that meet within a pixel or so make one curve, which
/// has one name or none. A predicted line lies on such a curve too where the curve is as bright as
/// that line and all others there are together, by the two lines to either side of each.
/// `curves`: of one camera. `missing`: predicted points that have no name, in chains. `named` and
/// `predicted`: what else lies on the curves. The points' sigma grows by how far the curve is from
/// the line.
[[nodiscard]] std::vector<SharedCurve> find_shared(
    const Camera& camera, const std::vector<ColorFamily>& families, std::span<const Curve> curves,
    std::span<const LineChain> missing, const NamedPoints& named, const PredictedPlaces& predicted,
    const GuidedMatchingOptions& options);

}  // namespace pencilscan
