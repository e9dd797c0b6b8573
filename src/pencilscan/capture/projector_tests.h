#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pencilscan/capture/live_cameras.h"
#include "pencilscan/capture/picture_check.h"
#include "pencilscan/display/projector_screen.h"

namespace pencilscan {

/// What a projector's flashes show.
struct ProjectorTiming {
  /// From show() to the first picture (its time of soonest arrival, or our trigger) that has all of
  /// the new light: at least and at most, as most flashes say, in the slowest camera that sees it.
  double least_ms = 0;
  double most_ms = 0;
  double use_ms = 0;  ///< to wait for, with a frame of the projector to spare
  /// Frames of this projector that its light comes later than that of the fastest one.
  double frames_behind = 0;
  /// Largest change of its light from picture to picture, share of the mean: above the noise.
  double flicker = 0;
  std::vector<LitView> views;  ///< per camera
  bool measured = false;
};

struct ProjectorTestOptions {
  int flashes = 6;          ///< of each projector, each on and off, >= 2
  int still_pictures = 12;  ///< for the flicker, >= 4
  double patience_s = 3;
};

struct ProjectorTestReport {
  std::vector<ProjectorTiming> projectors;
  /// unseen: no camera sees its light; late: it is slower than the fastest; jitter: its delay
  /// changes from flash to flash; flicker; exposure: no whole multiple of its period; dim,
  /// saturated: what a camera has of all projectors together
  std::vector<Fault> faults;
};

/// false: stop.
using ProjectorTestWatch = std::function<bool(const std::string& what, double share)>;

/// Shows black and white on one projector after the other and looks at all cameras: who sees whom,
/// how long light takes, whether it flickers.
///
/// A picture that began before the light changed has a part of the old light; one that has all of
/// the new began after. So every flash bounds the delay from both sides, within the time between
/// two pictures; flashes at random moments narrow it. Single flashes that come at another time are
/// the computer's doing and are left out; more than a quarter are jitter.
[[nodiscard]] ProjectorTestReport test_projectors(LiveCameras& cameras, ProjectorScreen& screen,
                                                  const ProjectorTestOptions& options = {},
                                                  const ProjectorTestWatch& watch = {});

}  // namespace pencilscan
