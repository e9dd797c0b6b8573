#pragma once

#include <span>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/labeling/labeling.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Curves with a name, and those of them that are in part where the object can be (ObjectSpace) and
/// go on beyond the volume: the same curve of the picture, on its sheets of light, above the floor
/// where the rig states one. What they lie on is cut by the volume.
struct CutLines {
  std::size_t named = 0;
  std::size_t cut = 0;

  [[nodiscard]] double share() const {
    return named == 0 ? 0 : static_cast<double>(cut) / static_cast<double>(named);
  }
};

[[nodiscard]] CutLines lines_cut_by_volume(const Rig& rig, std::span<const GridGraph> graphs,
                                           const Labeling& labeling);

}  // namespace pencilscan
