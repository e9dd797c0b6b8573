#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pencilscan/pipeline/pose_search.h"
#include "pencilscan/pipeline/rig_refinement.h"

namespace pencilscan {

/// A place of a line in space, measured without the projector that shows it.
struct MeasuredPlace {
  PlaceOfLine place;
  /// How the place moves with the two curves that measure it, times their deviations: its
  /// covariance is spread spread^T.
  Eigen::Matrix<double, 3, 2> spread = Eigen::Matrix<double, 3, 2>::Zero();
};

/// Where lines of projector `p` are in space, with the colours that cameras see there:
/// - where a line of another projector that has a name crosses a curve in the colours of `p` that
///   has none of others: the camera ray meets the light sheet of the other line;
/// - where two cameras see a line that has the same name of `p` in both: the ray of the one meets
///   the curve of the other. Which line it is does not matter.
/// `labelings`: one per frame; empty: of labels that are made without `p`, in which its own lines
/// have no names. Of several frames four are looked at, of lines that two cameras see an even
/// share. `rig`: in footprints, with registered patterns.
[[nodiscard]] std::vector<MeasuredPlace> places_of_projector(const Rig& rig,
                                                             std::span<const FrameCurves> frames,
                                                             std::span<const Labeling> labelings,
                                                             std::size_t p);

}  // namespace pencilscan
