#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pencilscan/artefact/coverage.h"
#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// Deviations over a map of the artefact, in cells of equal area.
struct ResidualMap {
  int columns = 0;
  int rows = 0;
  /// Row by row from the top; the deviation of greatest size in the cell, nothing without points.
  std::vector<std::optional<float>> cells;
};

/// Of a sphere: longitude across (from -x over -y, +x, +y), height up: cells of equal area
/// (Lambert's cylindrical map).
[[nodiscard]] ResidualMap map_of_sphere(std::span<const Vec3> points, const Sphere& sphere);
/// Of a plate: its length across, its width up.
[[nodiscard]] ResidualMap map_of_plate(std::span<const Vec3> points, const PlateRectangle& plate);

struct Histogram {
  double half_range = 0;            ///< bins cover [-half_range, half_range]
  std::vector<std::size_t> counts;  ///< the outer ones also hold what lies beyond
};
[[nodiscard]] Histogram histogram_of(std::span<const double> deviations, double half_range);

}  // namespace pencilscan
