#include "pencilscan/guided/named_points.h"

#include <algorithm>
#include <cstdlib>
#include <span>
#include <vector>

#include "pencilscan/core/median.h"

namespace pencilscan {

NamedPoints::NamedPoints(const Camera& camera, const GuidedMatchingOptions& options)
    : options_(options),
      size_(camera.width, camera.height),
      names_(camera.width, camera.height, 3) {}

void NamedPoints::add(const Curve& curve, const LabeledRun& run) {
  constexpr int kLightCellPx = 8;
  const LineName name{run.label.pattern, run.label.line};
  auto& lights = lights_
                     .try_emplace({name.pattern.projector, name.pattern.pattern}, size_.width,
                                  size_.height, kLightCellPx)
                     .first->second;
  for (int i = run.begin; i < run.end; ++i) {
    const CurvePoint& p = curve.points[static_cast<std::size_t>(i)];
    names_.add(p.position, {p.position, name});
    lights.add(p.position, {p.position, name.line, p.amplitude});
  }
}

bool NamedPoints::show(const PredictedPoint& p, std::size_t known) const {
  constexpr float kSame = 1.5F;  // px
  const LineName name = name_of(p);
  return names_.any_around(p.position, kSame, known, [&](const NamedPlace& n) {
    return n.name == name && (n.position - p.position).squaredNorm() < kSame * kSame;
  });
}

std::optional<float> NamedPoints::amplitude_around(const Eigen::Vector2f& place,
                                                   const LineName& name, float spacing_px,
                                                   int nearest, int farthest) const {
  const float reach = static_cast<float>(farthest) *
                      std::max(static_cast<float>(options_.support_px),
                               static_cast<float>(options_.support_lines) * spacing_px);
  const auto lights = lights_.find({name.pattern.projector, name.pattern.pattern});
  thread_local std::vector<float> amplitudes;
  amplitudes.clear();
  if (lights != lights_.end()) {
    lights->second.around(place, reach, [&](const LineLight& light) {
      const int lines = std::abs(light.line - name.line);
      if (lines >= nearest && lines <= farthest &&
          (light.position - place).squaredNorm() < reach * reach)
        amplitudes.push_back(light.amplitude);
    });
  }
  if (static_cast<int>(amplitudes.size()) < options_.min_support) return std::nullopt;
  return upper_median_in_place(std::span(amplitudes));
}

}  // namespace pencilscan
