#include "pencilscan/evaluation/truth_check.h"

#include <algorithm>
#include <vector>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/length_units.h"
#include "pencilscan/evaluation/statistics.h"
#include "pencilscan/evaluation/surface_figures.h"

namespace pencilscan {
namespace {

constexpr double kNear = 0.05;         ///< of the result's extent
constexpr std::size_t kLooked = 2000;  ///< of so many points the median is known well enough

std::vector<Vec3> evenly_picked(std::span<const Vec3> points) {
  std::vector<Vec3> picked;
  const std::size_t count = std::min(points.size(), kLooked);
  for (std::size_t i = 0; i < count; ++i) picked.push_back(points[i * points.size() / count]);
  return picked;
}

/// Diagonal of the box that holds nine tenths of the points along each axis: few that are far off
/// do not change it.
double extent_of(std::span<const Vec3> points) {
  Vec3 size;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vec3& point : points) values.push_back(point[axis]);
    size[axis] = quantile(values, 0.95) - quantile(values, 0.05);
  }
  return size.norm();
}

}  // namespace

std::optional<std::string> truth_warning(const RayScene& truth, std::span<const Vec3> points) {
  const std::vector<Vec3> looked = evenly_picked(points);
  std::vector<Vec3> of_truth;
  for (const DrawnPoint& drawn : sample_surface(truth.mesh(), kLooked, 1))
    of_truth.push_back(drawn.point);
  if (looked.empty() || of_truth.empty()) return std::nullopt;
  const double extent = extent_of(looked);
  const double median = quantile(distances_to(truth, looked), 0.5);
  if (!(extent > 0) || median <= kNear * extent) return std::nullopt;
  const double size = extent_of(of_truth);
  constexpr double kUnitTolerance = 0.15;  // some of the surface may not have been measured
  const UnitFactor* unit = unit_behind_factor(extent / size, kUnitTolerance);
  return "this is hardly the truth of the result, half of which lies " + formatted(median, "%.3g") +
         " mm and more off it; the truth is " + formatted(size, "%.3g") + " mm large, the result " +
         formatted(extent, "%.3g") + " mm" +
         (unit != nullptr ? ": the truth is probably in " + std::string(unit->words)
                          : std::string(". Of a simulated scene it is truth/mesh.ply in the "
                                        "scene's folder, not the mesh that was given to simulate; "
                                        "evaluate --align moves a result onto it"));
}

}  // namespace pencilscan
