#pragma once

#include <span>
#include <vector>

#include "pencilscan/evaluation/truth_scene.h"

namespace pencilscan {

/// A place in a camera image where the true line coordinate of a projector passes an integer.
struct TrueLinePixel {
  int camera = 0;
  PatternChannel channel;
  int line = 0;
  Vec2 pixel = Vec2::Zero();    ///< sub-pixel; the pixel it stands for is the rounded one
  Vec2 across = Vec2::UnitX();  ///< unit direction of the gradient, across the line
  double spacing_px = 0;        ///< image spacing of the lines here
  double cos_camera = 0;        ///< cosines of the incidences
  double cos_projector = 0;
};

struct TrueLineOptions {
  double min_spacing_px = 2;  ///< > 1; closer lines are left out
};

/// All true line pixels of a camera, by ray tracing: one per pixel and line, found between
/// neighbouring pixels (in a row where the line is steeper than 45 degrees in the image, else in a
/// column) and refined on the surface to about 0.01 px. Lines end at depth steps and shadows.
/// Ordered by row.
[[nodiscard]] std::vector<TrueLinePixel> true_line_pixels(const TruthScene& truth, int camera,
                                                          const TrueLineOptions& options = {});

/// Distance in pixels from a camera pixel to the true line `line` of a channel, walked to on the
/// true surface; infinite where the line is not lit there.
[[nodiscard]] double distance_to_true_line(const TruthScene& truth, int camera,
                                           PatternChannel channel, int line, const Vec2& pixel);

}  // namespace pencilscan
