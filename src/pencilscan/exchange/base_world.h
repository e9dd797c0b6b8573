#pragma once

#include <string>
#include <vector>

#include "pencilscan/exchange/merged_files.h"

namespace pencilscan {

/// What became of the files' poses.
struct BasePlacement {
  bool is_any_placed = false;  ///< by the files
  bool unit_known = true;      ///< of the lengths of all
  double mm_per_unit = 1;      ///< by which the files' lengths were multiplied
  std::vector<std::string> notes;
  std::vector<std::string> warnings;
};

/// Brings the poses of the files to the unit and into the world of the base. Where the files'
/// unit is known and the base's is not, the base is multiplied. Devices that nothing joins to the
/// others lose their pose.
///
/// A group of devices moves as one. Of each device that both place, its centre and three points
/// beside it, one spread of the centres along its axes, are laid onto those of the base by least
/// squares (Kabsch 1976; Umeyama 1991), over the most devices that agree within the bounds of the
/// options. One such device alone comes to stand where the base has it.
BasePlacement lay_into_base(bool world_is_arbitrary, const ExchangeOptions& options,
                            MergedFiles& files, UncalibratedRig& base);

}  // namespace pencilscan
