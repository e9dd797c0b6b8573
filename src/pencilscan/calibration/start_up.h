#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pencilscan/bundle/priors.h"
#include "pencilscan/calibration/calibrate.h"

namespace pencilscan {

/// What a first structure may rest on.
struct StartUp {
  const CalibrationInput& input;
  const Rig& rig;                  ///< with focal lengths that boards give
  const std::vector<char>& known;  ///< per device: K is given, or from boards
  std::span<const PairGeometry> pairs;
  std::optional<GivenTolerance> tolerance;  ///< of given values; none: they are rough
  std::size_t hypotheses = 5;               ///< guesses of unknown focal lengths, >= 1
};

/// Devices and points of the problem's tracks from the best of several starts, the one with most
/// devices, then with least cost: a guess of unknown focal lengths each, and one in which devices
/// whose K is known place the others, K and all; and from boards. False where none places two
/// devices.
[[nodiscard]] bool find_structure(const StartUp& start, BundleProblem& problem);

}  // namespace pencilscan
