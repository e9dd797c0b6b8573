#pragma once

#include <span>
#include <vector>

#include "pencilscan/points/local_surface.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

/// A projected line.
struct LineName {
  PatternRef pattern;
  int line = 0;
  friend bool operator==(const LineName&, const LineName&) = default;
};

/// Where a camera must see a projected line, if nothing is in the way of the light.
struct PredictedPoint {
  PatternRef pattern;
  int line = 0;
  Eigen::Vector2f position = Eigen::Vector2f::Zero();  ///< camera pixel
  Eigen::Vector2f normal = Eigen::Vector2f::UnitX();   ///< across the line
  float spacing_px = 0;                                ///< of the pattern's lines here
  float sigma_px = 0;                                  ///< across the line
  std::size_t patch = 0;                               ///< of the surface, that says so
};

[[nodiscard]] inline LineName name_of(const PredictedPoint& p) { return {p.pattern, p.line}; }

struct PredictionOptions {
  double min_spacing_px = 2.6;      ///< denser lines cannot be told apart
  double max_sigma_lines = 0.2;     ///< of the prediction
  double min_incidence_cos = 0.17;  ///< to the projector
};

/// Predicts every line of the patterns on the patches of the surface that its last add() fitted.
/// A line has one point per image row, or per column if it is flatter than 45 degrees. The points
/// are ordered by patch.
[[nodiscard]] std::vector<PredictedPoint> predict_lines(const Rig& rig, const Camera& camera,
                                                        const LocalSurface& surface,
                                                        std::span<const PatternRef> patterns,
                                                        const PredictionOptions& options = {});

}  // namespace pencilscan
