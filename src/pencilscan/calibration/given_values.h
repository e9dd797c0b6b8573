#pragma once

#include <array>
#include <vector>

#include "pencilscan/bundle/uncertainty.h"
#include "pencilscan/calibration/calibrate.h"

namespace pencilscan {

/// A sum of `count` squares of unit normals as one normal deviation (Wilson and Hilferty 1931).
[[nodiscard]] double normal_deviation(double sum, double count);

/// How far fx, fy, cx, cy are from given ones, in deviations of the tolerance; infinite for values
/// that were to be exact and moved.
[[nodiscard]] std::array<double, 4> moved_deviations(const Device& given,
                                                     const GivenTolerance& tolerance,
                                                     const BundleDevice& found);
/// A K that the data pull this far is contradicted, deviations of its tolerance.
inline constexpr double kContradictsDeviations = 3;

/// How unlikely it is that given K are off by this much all together, in deviations of a normal
/// distribution: the larger one of focal lengths and of principal points. A common error moves each
/// K by less than what contradicts it alone. `counts`: per device, the K that are asked about.
[[nodiscard]] double common_pull(const CalibrationInput& input, const std::vector<char>& counts,
                                 const GivenTolerance& tolerance, const BundleProblem& problem);

/// Whether any given K moved by more than that, or all of them together.
[[nodiscard]] bool is_any_pulled(const CalibrationInput& input, const GivenTolerance& tolerance,
                                 const BundleProblem& problem);

/// Per device: its given focal lengths are those that the data find, as far as these know them (to
/// four deviations) and as far as the tolerance goes (to `tolerances` of it). The scatter alone
/// would not tell: in a ring a common error of all hides in the poses.
[[nodiscard]] std::vector<char> given_agrees(const CalibrationInput& input,
                                             const GivenTolerance& tolerance, double tolerances,
                                             const BundleProblem& problem,
                                             const Uncertainty& sigma);

}  // namespace pencilscan
