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

/// How often labels are wrong, by what margins say of it.
struct WrongShare {
  double shared, factor, power;

  [[nodiscard]] float confidence(float of_margin) const {
    const double said = std::clamp(1 - static_cast<double>(of_margin), 0.0, 1.0);
    return static_cast<float>(1 - std::min(1.0, shared + factor * std::pow(said, power)));
  }
};
constexpr WrongShare kLabelsByLines{0.000724, 0.467, 0.634};
constexpr WrongShare kLabelsOnSurface{0.000065, 0.053, 0.626};
constexpr WrongShare kLabelsOffSurface{0.121, 0, 1};

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

float confidence_on_lines(float of_margin) { return kLabelsByLines.confidence(of_margin); }

float confidence_on_surface(const PointEvidence& evidence) {
  return (evidence.settled ? kLabelsOnSurface : kLabelsOffSurface).confidence(evidence.confidence);
}

}  // namespace pencilscan
