#pragma once

#include <functional>

#include "pencilscan/depth/dense_depth.h"

namespace pencilscan {

/// The light of a camera in pixels of which each is `binning` x `binning` (rig/binning.h): windows
/// of as many pixels are wider. A mosaic's samples are joined alone. It points to the rig that the
/// patterns point to, and holds its camera.
[[nodiscard]] CameraLight binned_light(const CameraLight& light, int binning);

/// Slopes and bends of a map's nodes where pixels have become `size` times as large.
void scale_pixels(float size, DepthMap& map);

/// Where lines lie farther apart than windows are wide, windows between two lines see none: by how
/// much pixels have to be joined (1, 2, 4 ...) until windows are about as wide as lines are apart.
[[nodiscard]] int binning_for(double spacing_px, const DepthOptions& options);

/// Calls work(light, map) with the light in pixels of twice the size, then of four times, up to
/// `widest` times, as long as nodes lie whole pixels apart. The map is in those pixels meanwhile.
void with_wider_windows(const CameraLight& light, int widest, DepthMap& map,
                        const std::function<void(const CameraLight&, DepthMap&)>& work);

}  // namespace pencilscan
