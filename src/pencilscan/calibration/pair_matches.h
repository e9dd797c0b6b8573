#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "pencilscan/calibration/tracks.h"

namespace pencilscan {

/// One surface point as a camera and a projector see it.
struct PairMatch {
  std::size_t capture = 0;
  Vec2 in_camera = Vec2::Zero();
  Vec2 in_projector = Vec2::Zero();
};

using DevicePair = std::pair<std::size_t, std::size_t>;  ///< camera, projector (devices)

/// Of a track's hub and another of its views.
[[nodiscard]] inline DevicePair pair_of(const Track& track, const TrackView& view) {
  return std::minmax(track.views[0].device, view.device);
}
[[nodiscard]] inline PairMatch match_of(const Track& track, const TrackView& view) {
  const TrackView& hub = track.views[0];
  if (hub.device < view.device) return {track.capture, hub.pixel, view.pixel};
  return {track.capture, view.pixel, hub.pixel};
}

[[nodiscard]] inline std::map<DevicePair, std::vector<PairMatch>> matches_by_pair(
    std::span<const Track> tracks) {
  std::map<DevicePair, std::vector<PairMatch>> matches;
  for (const Track& track : tracks)
    for (std::size_t i = 1; i < track.views.size(); ++i)
      matches[pair_of(track, track.views[i])].push_back(match_of(track, track.views[i]));
  return matches;
}

}  // namespace pencilscan
