#include "pencilscan/uncertainty/error_model.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {
namespace {

// Of experiments/error_model.py, printed under "fitted".
constexpr double kScale = 0.929;
constexpr double kOneSided = 1.698;
constexpr double kBend = 0.417;
constexpr double kOnLines = 0.876;
constexpr double kDifference = 0.167;
constexpr double kOwnOff = 1.86;
constexpr double kDifferenceOff = 0.97;
constexpr double kSharedErrors = 0.00014;

/// Footprints. No mean of depths was ever seen to be better; keeps exact data from saying 0.
constexpr double kLeast = 0.01;

}  // namespace

double surface_sigma(const SurfaceEvidence& evidence) {
  const double cameras = std::max(1.0, static_cast<double>(evidence.cameras));
  const double predicted =
      std::max(static_cast<double>(evidence.predicted) / std::sqrt(cameras), kLeast);
  const double scatter = std::max(static_cast<double>(evidence.scatter), kLeast);
  const double beyond = kOneSided * static_cast<double>(evidence.one_sidedness);
  return std::hypot(kScale * std::sqrt(predicted * scatter * (1 + beyond * beyond)),
                    kBend * static_cast<double>(evidence.bend));
}

double point_sigma(const PointEvidence& evidence) {
  const auto own = static_cast<double>(evidence.own);
  const auto difference = static_cast<double>(evidence.difference);
  if (evidence.settled)
    return std::hypot(kOnLines * static_cast<double>(evidence.surface), kDifference * difference);
  return std::hypot(kOwnOff * own, kDifferenceOff * difference);
}

float reported_confidence(float confidence) {
  return std::max(0.F, confidence - static_cast<float>(kSharedErrors));
}

}  // namespace pencilscan
