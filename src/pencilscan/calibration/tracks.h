#pragma once

#include <cstdint>
#include <vector>

#include "pencilscan/bundle/observations.h"
#include "pencilscan/gray/gray_decode.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {

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
