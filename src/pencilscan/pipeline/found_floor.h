#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/labeling/labeling.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A plane that named lines show and that the rig does not state: what the object stands on.
struct FoundFloor {
  Floor floor;       ///< its point below the volume's centre
  double share = 0;  ///< of the places on named lines, those on it
  double sides = 0;  ///< of the directions around the object, those in which it goes on
};

/// A place on a named line.
struct NamedPlace {
  Vec3 x;        ///< world
  float weight;  ///< confidence of its name
};

/// Of all runs every few points, on their sheets of light, wherever that is.
[[nodiscard]] std::vector<NamedPlace> named_places(const Rig& rig,
                                                   std::span<const GridGraph> graphs,
                                                   const Labeling& labeling);

/// The plane with most of the places near the volume, by drawing three of them again and again (M.
/// Fischler and R. Bolles, Comm. ACM 24, 1981), then by least squares. It is a floor if
///   1. all devices are above it, and so is the volume's centre, by no more than the volume's
///      radius,
///   2. a good part of the places lies on it, and next to none below it in the volume: cameras do
///      not see through it,
///   3. others, the object, lie above it in the volume,
///   4. it goes on beyond the object on most sides.
/// Nothing where the rig states a floor. Lengths count in line spacings.
[[nodiscard]] std::optional<FoundFloor> find_floor(const Rig& rig,
                                                   std::span<const NamedPlace> places);

}  // namespace pencilscan
