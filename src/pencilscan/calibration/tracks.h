#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pencilscan/calibration/gray_decode.h"
#include "pencilscan/geometry/types.h"
#include "pencilscan/rig/device_list.h"

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

struct GrayTrackOptions {
  int spacing_px = 16;             ///< of the lattices of hub pixels, >= 8: windows do not overlap
  double hub_sigma_px = 0.02;      ///< stands for "exact", > 0
  double least_sigma_px = 0.03;    ///< of a measured view: what the window's fit cannot know, > 0
  double largest_sigma_px = 0.5;   ///< worse views are left out, > 0
  std::size_t max_tracks = 20000;  ///< of all captures together, >= 1
};

/// Collects what the pairs of one capture contribute, then joins views of the same hub pixel.
class TrackBuilder {
 public:
  TrackBuilder(const Rig& rig, const GrayTrackOptions& options);

  /// Adds the views of one camera-projector pair. Not for several threads at once.
  void add(std::size_t capture, std::size_t camera, std::size_t projector,
           const DecodedView& decoded);
  /// All tracks with two views or more, at most max_tracks, spread evenly over captures, hubs and
  /// images. Those with more views go first.
  [[nodiscard]] std::vector<Track> tracks() const;
  [[nodiscard]] std::size_t samples() const { return samples_.size(); }

 private:
  struct Sample {
    std::size_t capture;
    std::size_t hub;     ///< device
    std::uint32_t cell;  ///< lattice cell of the hub, row by row
    Vec2 hub_pixel;
    TrackView view;
  };
  void add_camera_hubs(std::size_t capture, std::size_t camera, std::size_t projector,
                       const DecodedView& decoded);
  void add_projector_hubs(std::size_t capture, std::size_t camera, std::size_t projector,
                          const DecodedView& decoded);

  GrayTrackOptions options_;
  std::size_t cameras_;
  std::vector<int> columns_;  ///< of each device's lattice
  std::vector<Vec2> size_;    ///< of each device's image
  std::vector<Sample> samples_;
};

}  // namespace pencilscan
