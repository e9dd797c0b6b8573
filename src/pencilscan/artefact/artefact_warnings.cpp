#include <algorithm>
#include <cmath>

#include "pencilscan/artefact/artefact.h"
#include "pencilscan/artefact/find_shapes.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/length_units.h"

namespace pencilscan {

std::vector<std::string> artefact_warnings(const BallBarFigures& bar,
                                           const ArtefactOptions& options) {
  std::vector<std::string> warnings;
  if (bar.between > 0) {
    warnings.push_back(std::to_string(bar.between) +
                       " points lie between the balls; if that is the bar, give --bar-diameter");
  }
  if (!options.length_mm) return warnings;
  // The balls are found with the stated diameter to within kSizeTolerance, and so the scan's scale
  // is right to within it: what is farther off is no error of the scan.
  const double factor = bar.distance_mm.trimmed / *options.length_mm;
  if (std::abs(factor - 1) <= kSizeTolerance) return warnings;
  const UnitFactor* unit = unit_behind_factor(factor, kSizeTolerance);
  warnings.push_back(
      "the balls are " + formatted(bar.distance_mm.trimmed, "%.4g") + " mm apart, " +
      formatted(factor, "%.4g") + " times --length = " + formatted(*options.length_mm, "%.6g") +
      " mm" +
      (unit != nullptr
           ? ": it is probably in " + std::string(unit->words)
           : std::string(" though their size is as stated: is that the length of this bar?")));
  return warnings;
}

std::vector<std::string> artefact_warnings(const PlateFigures& plate,
                                           const ArtefactOptions& options) {
  // A tenth of both sides, which no scale of a scanner is off by, is a fifth of the area.
  constexpr double kNoticed = (1 + kSizeTolerance) * (1 + kSizeTolerance);
  if (!options.plate_length_mm || !options.plate_width_mm) return {};
  const double stated = *options.plate_length_mm * *options.plate_width_mm;
  if (plate.surface.area_mm2 <= kNoticed * stated) return {};
  return {"the plate's surface is " + formatted(plate.surface.length_mm, "%.4g") + " x " +
          formatted(plate.surface.width_mm, "%.4g") + " mm large, and --length and --width say " +
          formatted(std::max(*options.plate_length_mm, *options.plate_width_mm), "%.6g") + " x " +
          formatted(std::min(*options.plate_length_mm, *options.plate_width_mm), "%.6g") +
          " mm: are they this plate's?"};
}

}  // namespace pencilscan
