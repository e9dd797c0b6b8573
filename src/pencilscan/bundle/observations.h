#pragma once

#include <cstddef>
#include <vector>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// One device's view of a surface point. Devices are numbered cameras first, then projectors.
struct TrackView {
  std::size_t device = 0;
  Vec2 pixel = Vec2::Zero();
  double sigma_px = 0;  ///< of each coordinate, one standard deviation, > 0
};

/// A surface point seen by two or more devices. All views but the hub are measured at the hub's
/// pixel, which is exact by definition: a camera pixel that several projectors light, or a panel
/// pixel that several cameras see. So camera-projector, camera-camera (through a panel pixel) and
/// projector-projector correspondences (through a camera pixel) come together.
struct Track {
  std::vector<TrackView> views;  ///< views[0] is the hub
  std::size_t capture = 0;       ///< object pose; pieces of one capture do not move
};

/// A device's view of a track; null when it has none.
[[nodiscard]] inline const TrackView* view_in(const Track& track, std::size_t device) {
  for (const TrackView& view : track.views)
    if (view.device == device) return &view;
  return nullptr;
}

/// A flat board of known size seen by devices: chessboard corners.
struct BoardView {
  std::size_t board = 0;  ///< which placing of the board
  Vec2 position_mm = Vec2::Zero();
  TrackView view;
};

}  // namespace pencilscan
