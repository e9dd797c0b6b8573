#include "pencilscan/calibration/given_values.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pencilscan/bundle/bundle_device.h"

namespace pencilscan {
double normal_deviation(double sum, double count) {
  if (count == 0) return 0;
  const double variance = 2 / (9 * count);
  return (std::cbrt(sum / count) - (1 - variance)) / std::sqrt(variance);
}

std::array<double, 4> moved_deviations(const Device& given, const GivenTolerance& tolerance,
                                       const BundleDevice& found) {
  const BundleDevice before = bundle_device(given);
  std::array<double, 4> moved{};
  for (std::size_t i = kFx; i <= kCy; ++i) {
    const double by = std::abs(found.inner[i] - before.inner[i]);
    const double sigma = i <= kFy ? tolerance.focal * before.inner[i] : tolerance.center_px;
    if (by > 0) moved[i] = sigma > 0 ? by / sigma : std::numeric_limits<double>::infinity();
  }
  return moved;
}

double common_pull(const CalibrationInput& input, const std::vector<char>& counts,
                   const GivenTolerance& tolerance, const BundleProblem& problem) {
  double focal = 0;
  double center = 0;
  double count = 0;
  for (std::size_t d = 0; d < counts.size(); ++d) {
    if (counts[d] == 0 || !input.known[d].K || !problem.devices[d].present) continue;
    const auto moved = moved_deviations(device_at(input.rig, d), tolerance, problem.devices[d]);
    // fx and fy of a lens are wrong alike: one number.
    focal += (moved[kFx] * moved[kFx] + moved[kFy] * moved[kFy]) / 2;
    center += moved[kCx] * moved[kCx] + moved[kCy] * moved[kCy];
    ++count;
  }
  return std::max(normal_deviation(focal, count), normal_deviation(center, 2 * count));
}

bool is_any_pulled(const CalibrationInput& input, const GivenTolerance& tolerance,
                   const BundleProblem& problem) {
  const std::vector<char> all(input.known.size(), 1);
  if (common_pull(input, all, tolerance, problem) > kContradictsDeviations) return true;
  for (std::size_t d = 0; d < input.known.size(); ++d) {
    if (!input.known[d].K || !problem.devices[d].present) continue;
    const auto moved = moved_deviations(device_at(input.rig, d), tolerance, problem.devices[d]);
    if (*std::max_element(moved.begin(), moved.end()) > kContradictsDeviations) return true;
  }
  return false;
}

std::vector<char> given_agrees(const CalibrationInput& input, const GivenTolerance& tolerance,
                               double tolerances, const BundleProblem& problem,
                               const Uncertainty& sigma) {
  constexpr double kDeviations = 4;
  std::vector<char> agrees(input.known.size(), 0);
  for (std::size_t d = 0; d < agrees.size(); ++d) {
    if (!input.known[d].K) continue;
    const BundleDevice& found = problem.devices[d];
    const Mat3& K = device_at(input.rig, d).K;
    const auto is_near = [&](Intrinsic i, double given) {
      const double slack =
          std::max(kDeviations * sigma.devices[d].inner[i], tolerances * tolerance.focal * given);
      return !found.present || std::abs(found.inner[i] - given) <= slack;
    };
    agrees[d] = is_near(kFx, K(0, 0)) && is_near(kFy, K(1, 1)) ? 1 : 0;
  }
  return agrees;
}

}  // namespace pencilscan
