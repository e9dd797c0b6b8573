#pragma once

#include <span>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/labeling/labeling.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Curves with a name that are in part where the object can be (ObjectSpace), and those of them
/// that go on beyond the volume: the same curve of the picture, on its sheets of light, above the
/// floor where the rig states one. What they lie on is cut by the volume; or by the floor, where
/// they go on more than a line spacing below it.
struct CutLines {
  std::size_t inside = 0;
  std::size_t cut = 0;
  std::size_t below_floor = 0;

  [[nodiscard]] double share() const {
    return inside == 0 ? 0 : static_cast<double>(cut) / static_cast<double>(inside);
  }
  /// What was measured goes on beyond the volume. As of a room around it (joint/piece_labels.cpp):
  /// rims of an object that fills it stay below. A bunny and a ball with half and more of them
  /// outside: .30 each.
  [[nodiscard]] bool are_many() const { return share() > 0.1; }

  [[nodiscard]] double share_below() const {
    return inside == 0 ? 0 : static_cast<double>(below_floor) / static_cast<double>(inside);
  }
  /// The floor is stated too high. Nothing is seen below one that is there: .003 to .010 of the
  /// lines, by wrong names. Through the lower third of two objects: .066 and .063. Chosen between;
  /// of fewer than ten chance may make as many.
  [[nodiscard]] bool are_many_below() const { return below_floor >= 10 && share_below() > 0.03; }
};

[[nodiscard]] CutLines cut_lines(const Rig& rig, std::span<const GridGraph> graphs,
                                 const Labeling& labeling);

}  // namespace pencilscan
