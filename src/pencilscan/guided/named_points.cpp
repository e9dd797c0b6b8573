#include "pencilscan/guided/named_points.h"

#include <algorithm>
#include <cstdlib>
#include <utility>
#include <vector>

#include "pencilscan/core/median.h"

namespace pencilscan {

NamedPoints::NamedPoints(const Camera& camera, const GuidedMatchingOptions& options)
    : options_(options),
      names_(camera.width, camera.height, 3),
      lights_(camera.width, camera.height, 8) {}

void NamedPoints::add(const Curve& curve, const LabeledRun& run) {
  const LineName name{run.label.pattern, run.label.line};
  for (int i = run.begin; i < run.end; ++i) {
    const CurvePoint& p = curve.points[static_cast<std::size_t>(i)];
    names_.add(p.position, {p.position, name});
    lights_.add(p.position, {{p.position, name}, p.amplitude});
  }
}

bool NamedPoints::show(const PredictedPoint& p) const {
  constexpr float kSame = 1.5F;  // px
  bool found = false;
  names_around(p.position, kSame,
               [&](const LineName& name) { found = found || name == name_of(p); });
  return found;
}

std::optional<float> NamedPoints::amplitude_around(const Eigen::Vector2f& place,
                                                   const LineName& name, float spacing_px,
                                                   int nearest, int farthest) const {
  const float reach = static_cast<float>(farthest) *
                      std::max(static_cast<float>(options_.support_px),
                               static_cast<float>(options_.support_lines) * spacing_px);
  std::vector<float> amplitudes;
  lights_.around(place, reach, [&](const NamedLight& light) {
    const auto& [position, other] = light.place;
    const int lines = std::abs(other.line - name.line);
    if (other.pattern == name.pattern && lines >= nearest && lines <= farthest &&
        (position - place).squaredNorm() < reach * reach)
      amplitudes.push_back(light.amplitude);
  });
  if (static_cast<int>(amplitudes.size()) < options_.min_support) return std::nullopt;
  return upper_median(std::move(amplitudes));
}

}  // namespace pencilscan
