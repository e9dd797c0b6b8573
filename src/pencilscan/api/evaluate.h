#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pencilscan/api/reconstruct.h"
#include "pencilscan/geometry/mesh.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

struct JudgementOptions {
  std::string align = "none";  ///< move the result onto the truth first: none, rigid, similarity
  std::uint64_t seed = 1;      ///< of the surface samples
  StageListener progress;
};

/// The figures of docs/figures.md as JSON text, the keys of `pencilscan evaluate --json`. `points`
/// or `measured` may be null: their figures are then left out. InputError when a point names a
/// device that the rig lacks.
[[nodiscard]] std::string judge(const TriangleMesh& truth, const Rig& rig,
                                const std::vector<MeasuredPoint>* points,
                                const TriangleMesh* measured, const JudgementOptions& options = {});
/// The same of all that a frame gave: its points, and its measured mesh if it has one.
[[nodiscard]] std::string judge(const TriangleMesh& truth, const Rig& rig,
                                const Reconstruction& result, const JudgementOptions& options = {});

}  // namespace pencilscan
