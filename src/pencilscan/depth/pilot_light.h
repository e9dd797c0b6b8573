#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pencilscan/depth/window_fit.h"

namespace pencilscan {

/// A window whose depth is known about: pictures show their blur and noise there.
struct PilotWindow {
  Vec2 pixel = Vec2::Zero();
  Quadric start = Quadric::Zero();
};

/// The blur, px, with which the windows of a light fit best, in [0.3, 2.5] and to 0.16 px. Its own
/// blur_px does not matter. `half`: radius of the windows, px.
[[nodiscard]] float best_blur(std::span<const PilotWindow> pilots, int half, CameraLight light);

/// What a window that was fitted shows of one family's noise.
struct NoiseSample {
  float mean = 0;      ///< image value
  float variance = 0;  ///< of what the fit leaves
};
/// A line through the medians of the darker and the brighter half. Nothing of fewer than 20
/// samples: ten each tell the noise in the dark and the bright.
[[nodiscard]] std::optional<NoiseModel> noise_of(std::vector<NoiseSample> samples);

/// Fills in the blur and noise that the images of a light show in pilot windows, which have the
/// radius `half`, px. Without windows that fit it stays as it is.
void measure_light(std::span<const PilotWindow> pilots, int half, CameraLight& light);

}  // namespace pencilscan
