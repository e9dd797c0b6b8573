#include "pencilscan/artefact/residual_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pencilscan/artefact/sphere_fit.h"

namespace pencilscan {
namespace {

constexpr int kMapColumns = 72;
constexpr int kBins = 41;

/// The cell of a share in [0, 1].
int cell_of(double share, int count) {
  return std::clamp(static_cast<int>(std::floor(share * count)), 0, count - 1);
}

void put(ResidualMap& map, double across, double up, double deviation) {
  const int column = cell_of(across, map.columns), row = cell_of(1 - up, map.rows);
  auto& cell = map.cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(map.columns) +
                         static_cast<std::size_t>(column)];
  const auto value = static_cast<float>(deviation);
  if (!cell || std::abs(value) > std::abs(*cell)) cell = value;
}

ResidualMap empty_map(int columns, int rows) {
  ResidualMap map{columns, rows, {}};
  map.cells.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  return map;
}

}  // namespace

ResidualMap map_of_sphere(std::span<const Vec3> points, const Sphere& sphere) {
  ResidualMap map = empty_map(kMapColumns, kMapColumns / 2);
  for (const Vec3& point : points) {
    const Vec3 offset = point - sphere.center;
    const double distance = offset.norm();
    if (distance == 0) continue;
    const double longitude = std::atan2(offset.y(), offset.x());
    put(map, 0.5 + longitude / (2 * std::numbers::pi), 0.5 + 0.5 * offset.z() / distance,
        distance - sphere.radius);
  }
  return map;
}

ResidualMap map_of_plate(std::span<const Vec3> points, const PlateRectangle& plate) {
  if (!(plate.width > 0)) return {};
  const int rows =
      std::clamp(static_cast<int>(kMapColumns * plate.width / plate.length), 1, kMapColumns);
  ResidualMap map = empty_map(kMapColumns, rows);
  const Vec3 across = plate.plane.normal.cross(plate.along);
  for (const Vec3& point : points) {
    const Vec3 offset = point - plate.center;
    const double x = 0.5 + plate.along.dot(offset) / plate.length;
    const double y = 0.5 + across.dot(offset) / plate.width;
    if (x < 0 || x > 1 || y < 0 || y > 1) continue;
    put(map, x, y, plate.plane.signed_distance(point));
  }
  return map;
}

Histogram histogram_of(std::span<const double> deviations, double half_range) {
  Histogram histogram{half_range, std::vector<std::size_t>(kBins)};
  if (!(half_range > 0)) return histogram;
  for (const double deviation : deviations) {
    const double share = std::clamp(0.5 + 0.5 * deviation / half_range, 0.0, 1.0);
    ++histogram.counts[static_cast<std::size_t>(cell_of(share, kBins))];
  }
  return histogram;
}

}  // namespace pencilscan
