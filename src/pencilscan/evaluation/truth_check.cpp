#include "pencilscan/evaluation/truth_check.h"

#include <algorithm>
#include <limits>
#include <numbers>
#include <vector>

#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/length_units.h"
#include "pencilscan/evaluation/statistics.h"
#include "pencilscan/evaluation/surface_figures.h"

namespace pencilscan {
namespace {

constexpr double kNear = 0.05;         ///< of the result's extent
constexpr std::size_t kLooked = 2000;  ///< of so many points the median is known well enough

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

/// Which file is in another unit, where the result is `factor` times as large as the truth: the
/// smaller one in a larger unit, and seldom the larger one in micrometres. Empty: neither.
std::string unit_advice(double factor) {
  constexpr double kTolerance = 0.15;  // some of the surface may not have been measured
  const char* smaller = factor > 1 ? "the truth" : "the result";
  const char* larger = factor > 1 ? "the result" : "the truth";
  const double ratio = std::max(factor, 1 / factor);
  const UnitFactor* of_smaller = unit_behind_factor(ratio, kTolerance);
  if (of_smaller == nullptr) return {};
  const UnitFactor* of_larger = unit_behind_factor(1 / ratio, kTolerance);
  return std::string(smaller) + " is probably in " + of_smaller->words +
         (of_larger == nullptr ? "" : std::string(", or ") + larger + " in " + of_larger->words);
}

}  // namespace

std::optional<std::string> truth_warning(const RayScene& truth, std::span<const Vec3> points) {
  const std::vector<Vec3> looked = evenly_picked(points, kLooked);
  std::vector<Vec3> of_truth;
  for (const DrawnPoint& drawn : sample_surface(truth.mesh(), kLooked, 1))
    of_truth.push_back(drawn.point);
  if (looked.empty() || of_truth.empty()) return std::nullopt;
  const double extent = extent_of(looked);
  const double median = quantile(distances_to(truth, looked), 0.5);
  if (!(extent > 0) || median <= kNear * extent) return std::nullopt;
  const double size = extent_of(of_truth);
  const std::string advice = unit_advice(extent / size);
  return "this is hardly the truth of the result: taken as mm, half of the result lies " +
         formatted(median, "%.3g") + " and more off it; the truth is " + formatted(size, "%.3g") +
         " large, the result " + formatted(extent, "%.3g") +
         (advice.empty() ? ". Of a simulated scene it is truth/mesh.ply in the scene's folder, not "
                           "the mesh that was given to simulate; evaluate --align moves a result "
                           "onto it"
                         : ": " + advice);
}

std::optional<std::string> alignment_warning(const AlignmentReport& alignment) {
  if (!alignment.rival) return std::nullopt;
  const double degrees = alignment.rival->turn_rad * 180 / std::numbers::pi;
  return "the object looks alike from several sides: turned by " + formatted(degrees, "%.0f") +
         " degrees it lies about as well on the truth (median " +
         formatted(alignment.rival->median_mm, "%.3g") + " instead of " +
         formatted(alignment.median_mm, "%.3g") +
         " mm), and figures of lines and coverage may be of the wrong pose; move the rig into the "
         "truth's frame to be sure";
}

std::optional<std::string> unit_warning(const Rig& rig, AlignmentKind align) {
  if (rig.unit_known || align == AlignmentKind::kSimilarity) return std::nullopt;
  return "the rig's unit is unknown: figures and thresholds that are named mm are in that unit; "
         "--align similarity measures in the truth's";
}

std::optional<std::string> other_rig_warning(const Rig& rig,
                                             std::span<const MeasuredPoint> points) {
  constexpr double kBesidePx = 1;
  std::vector<double> beside;
  for (const MeasuredPoint& point : evenly_picked(points, kLooked)) {
    const Vec2 pixel(static_cast<double>(point.u), static_cast<double>(point.v));
    const auto seen = rig.cameras[point.camera].project(position_of(point));
    beside.push_back(seen ? (*seen - pixel).norm() : std::numeric_limits<double>::max());
  }
  if (beside.empty()) return std::nullopt;
  const double median = quantile(std::move(beside), 0.5);
  if (median <= kBesidePx) return std::nullopt;
  return "this is hardly the rig that the result was made with: its cameras see half of the "
         "points " +
         (median < std::numeric_limits<double>::max()
              ? formatted(median, "%.3g") + " px and more beside the pixels of points.ply"
              : std::string("behind them")) +
         "; devices.json beside the frames of a result is its rig";
}

}  // namespace pencilscan
