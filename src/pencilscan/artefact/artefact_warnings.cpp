#include <algorithm>
#include <cmath>

#include "pencilscan/artefact/artefact.h"
#include "pencilscan/artefact/find_shapes.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/length_units.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/name_list.h"

namespace pencilscan {
namespace {

/// That lengths are not in mm, where they are those of a rig without scale.
std::vector<std::string> unit_warnings(const ArtefactPoints& points) {
  if (points.unit_known) return {};
  return {
      "the rig's unit is unknown: lengths are in that unit and not in mm, and what they differ by "
      "from the stated ones says nothing"};
}

/// That an artefact is smaller or larger than any, with the unit that its points are probably in.
void warn_of_unit(double size_mm, const std::string& what, const ArtefactPoints& points,
                  std::vector<std::string>& warnings) {
  // Artefacts of 2 mm or less and of 10 m or more are none that lines of a projector measure: these
  // are 2 m and a centimetre in metres and micrometres. In inches, 0.2 mm would be 5 mm.
  constexpr double kSmallestMm = 2, kInchesFromMm = 0.2, kLargestMm = 1e4;
  if (!points.unit_known || !(size_mm > 0)) return;
  if (size_mm > kSmallestMm && size_mm < kLargestMm) return;
  warnings.push_back(what + " is " + formatted(size_mm, "%.3g") +
                     " mm large: the points are probably in " +
                     (size_mm >= kLargestMm      ? "micrometres; multiply them by 0.001"
                      : size_mm >= kInchesFromMm ? "metres or inches; multiply them by 1000 or 25.4"
                                                 : "metres; multiply them by 1000") +
                     ", for no figure is in mm");
}

/// Of a ball less than what one camera sees of it at up to 60 degrees from head on, which is
/// (1 - cos 60) / 2 of the whole.
constexpr double kLittleCoverage = 0.25;

void warn_of_coverage(double coverage, const std::string& what,
                      std::vector<std::string>& warnings) {
  if (coverage >= kLittleCoverage) return;
  warnings.push_back("only " + formatted(100 * coverage, "%.3g") + " % of " + what +
                     " has points near it, and less than " +
                     formatted(100 * kLittleCoverage, "%.3g") +
                     " % says little of the whole: measure it from more sides");
}

/// That half of the points lie farther from the fitted shape than a point counts as near it: 1 % of
/// its size (docs/figures.md). No label or scale that is wrong makes that of the shape asked for.
/// True where it is said.
bool warn_of_shape(std::vector<double> distances, double size_mm, const std::string& shape,
                   const std::string& hint, std::vector<std::string>& warnings) {
  constexpr double kNear = 0.01;
  if (distances.empty()) return false;
  const double usual = upper_median(std::move(distances));
  if (usual <= kNear * size_mm) return false;
  warnings.push_back("half of the points lie more than " + formatted(usual, "%.3g") +
                     " mm from the " + shape + " that fits them best: they are hardly one, " +
                     hint);
  return true;
}

template <class Shape>
std::vector<double> distances_of(const ArtefactPoints& points, const Shape& distance) {
  std::vector<double> distances;
  for (const Vec3& x : points.points) distances.push_back(std::abs(distance(x)));
  return distances;
}

bool has_stated_size(const BallFigures& ball, double diameter_mm) {
  return std::abs(2 * ball.trimmed.radius - diameter_mm) <= kSizeTolerance * diameter_mm;
}

/// Of a ball whose points do not lie near one of the stated size: its radius is off by more than
/// 1 % of that diameter, by which a point counts as near (docs/figures.md).
void warn_of_size(const BallFigures& ball, const std::string& what, const ArtefactOptions& options,
                  std::vector<std::string>& warnings) {
  constexpr double kNoticed = 0.02;
  if (!options.diameter_mm || !ball.points.unit_known) return;
  const double diameter = 2 * ball.trimmed.radius;
  const double excess = diameter / *options.diameter_mm - 1;
  if (std::abs(excess) <= kNoticed) return;
  warnings.push_back(what + " is " + formatted(diameter, "%.4g") + " mm across, " +
                     formatted(100 * std::abs(excess), "%.3g") + " % " +
                     (excess > 0 ? "more" : "less") +
                     " than --diameter = " + formatted(*options.diameter_mm, "%.6g") +
                     " mm: if that is its diameter, the scale of the rig is off");
}

/// "199.6 and 201.3".
std::string sizes_of(const std::vector<BallFigures>& balls) {
  std::string text;
  for (const BallFigures& ball : balls)
    add_name(text, formatted(2 * ball.trimmed.radius, "%.4g"), " and ");
  return text;
}

/// What may be wrong where the distance of the balls is `factor` times the stated one. The scan's
/// scale is right to within kSizeTolerance where the balls have the stated size.
std::string reason_of(const BallBarFigures& bar, const ArtefactOptions& options, double factor) {
  const double diameter = *options.diameter_mm;
  const bool have_size =
      std::all_of(bar.balls.begin(), bar.balls.end(),
                  [&](const BallFigures& ball) { return has_stated_size(ball, diameter); });
  if (!have_size)
    return ", and " + sizes_of(bar.balls) + " mm across, and --diameter says " +
           formatted(diameter, "%.6g") +
           " mm: these are hardly the balls, or the scan is not in mm";
  const UnitFactor* unit = unit_behind_factor(factor, kSizeTolerance);
  if (unit != nullptr) return ": it is probably in " + std::string(unit->words);
  return " though their size is as stated: is that the length of this bar?";
}

}  // namespace

std::vector<std::string> artefact_warnings(const BallFigures& ball,
                                           const ArtefactOptions& options) {
  std::vector<std::string> warnings = unit_warnings(ball.points);
  warn_of_unit(2 * ball.trimmed.radius, "the ball", ball.points, warnings);
  const auto distance = [&](const Vec3& x) { return signed_distance(ball.trimmed, x); };
  if (warn_of_shape(distances_of(ball.points, distance), 2 * ball.trimmed.radius, "sphere",
                    "or much else is among them", warnings))
    return warnings;  // its size is that of no ball
  warn_of_size(ball, "the ball", options, warnings);
  warn_of_coverage(ball.coverage, "the ball", warnings);
  return warnings;
}

std::vector<std::string> artefact_warnings(const BallBarFigures& bar,
                                           const ArtefactOptions& options) {
  std::vector<std::string> warnings = unit_warnings(bar.balls.front().points);
  if (bar.between > 0) {
    warnings.push_back(std::to_string(bar.between) +
                       " points lie between the balls; if that is the bar, give --bar-diameter");
  }
  for (std::size_t b = 0; b < bar.balls.size(); ++b) {
    const std::string name = "ball " + std::to_string(b + 1);
    warn_of_unit(2 * bar.balls[b].trimmed.radius, name, bar.balls[b].points, warnings);
    warn_of_size(bar.balls[b], name, options, warnings);
    warn_of_coverage(bar.balls[b].coverage, name, warnings);
  }
  if (!options.length_mm || !bar.balls.front().points.unit_known) return warnings;
  const double factor = bar.distance_mm.trimmed / *options.length_mm;
  if (std::abs(factor - 1) <= kSizeTolerance) return warnings;
  warnings.push_back("the balls are " + formatted(bar.distance_mm.trimmed, "%.4g") + " mm apart, " +
                     formatted(factor, "%.4g") +
                     " times --length = " + formatted(*options.length_mm, "%.6g") + " mm" +
                     reason_of(bar, options, factor));
  return warnings;
}

std::vector<std::string> artefact_warnings(const PlateFigures& plate,
                                           const ArtefactOptions& options) {
  // A tenth of both sides, which no scale of a scanner is off by, is a fifth of the area.
  constexpr double kNoticed = (1 + kSizeTolerance) * (1 + kSizeTolerance);
  std::vector<std::string> warnings = unit_warnings(plate.points);
  warn_of_unit(plate.surface.length_mm, "the plate", plate.points, warnings);
  const auto distance = [&](const Vec3& x) { return plate.trimmed.signed_distance(x); };
  warn_of_shape(distances_of(plate.points, distance), plate.surface.length_mm, "plane",
                options.plate_thickness_mm ? "or two faces, farther apart than --thickness says"
                                           : "or two faces of a plate: then state its --thickness",
                warnings);
  warn_of_coverage(plate.coverage, "the plate", warnings);
  if (!options.plate_length_mm || !options.plate_width_mm || !plate.points.unit_known)
    return warnings;
  const double stated = *options.plate_length_mm * *options.plate_width_mm;
  if (plate.surface.area_mm2 <= kNoticed * stated) return warnings;
  warnings.push_back(
      "the plate's surface is " + formatted(plate.surface.length_mm, "%.4g") + " x " +
      formatted(plate.surface.width_mm, "%.4g") + " mm large, and --length and --width say " +
      formatted(std::max(*options.plate_length_mm, *options.plate_width_mm), "%.6g") + " x " +
      formatted(std::min(*options.plate_length_mm, *options.plate_width_mm), "%.6g") +
      " mm: are they this plate's?");
  return warnings;
}

}  // namespace pencilscan
