#include "pencilscan/guided/shared_curves.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/stretches.h"

namespace pencilscan {
namespace {

/// What the curves of one camera show of lines that have no name there.
class SharedLight {
 public:
  SharedLight(const Camera& camera, const std::vector<ColorFamily>& families,
              std::span<const Curve> curves, const NamedPoints& named,
              const PredictedPlaces& predicted, const GuidedMatchingOptions& options)
      : families_(families),
        named_(named),
        predicted_(predicted),
        options_(options),
        shown_(camera.width, camera.height, 3) {
    for (const Curve& curve : curves) {
      for (const CurvePoint& p : curve.points) shown_.add(p.position, {&p, curve.family});
    }
  }

  /// The nearest point of a curve of the family on a predicted line; nullptr: none.
  [[nodiscard]] const CurvePoint* shown_at(const PredictedPoint& p, int family) const;
  /// True where a point of a curve, which lines of other patterns explain as well, is as bright as
  /// if a predicted line lay there too.
  [[nodiscard]] bool is_lit_too(const CurvePoint& point, int family, const PredictedPoint& p) const;

 private:
  struct ShownPoint {
    const CurvePoint* point;
    int family;
  };

  [[nodiscard]] std::optional<float> amplitude_of(const LineName& name, const CurvePoint& point,
                                                  float spacing_px) const {
    constexpr int kNearest = 1;
    constexpr int kFarthest = 2;  // lines to either side
    return named_.amplitude_around(point.position, name, spacing_px, kNearest, kFarthest);
  }
  [[nodiscard]] std::vector<LineName> others_at(const CurvePoint& point, int family,
                                                const LineName& name) const;

  const std::vector<ColorFamily>& families_;
  const NamedPoints& named_;
  const PredictedPlaces& predicted_;
  const GuidedMatchingOptions& options_;
  Places<ShownPoint> shown_;
};

const CurvePoint* SharedLight::shown_at(const PredictedPoint& p, int family) const {
  const auto reach = static_cast<float>(options_.max_offset_px);
  float best = reach * reach;
  const CurvePoint* nearest = nullptr;
  shown_.around(p.position, reach, [&](const ShownPoint& s) {
    const float apart2 = (s.point->position - p.position).squaredNorm();
    if (s.family != family || apart2 >= best || !predicted_.is_near(std::sqrt(apart2), p) ||
        s.point->sigma_px > options_.max_sigma_px ||
        !PredictedPlaces::have_same_direction(s.point->normal, p.normal))
      return;
    best = apart2;
    nearest = s.point;
  });
  return nearest;
}

/// Lines of other patterns of the family at a point of a curve, named or predicted.
std::vector<LineName> SharedLight::others_at(const CurvePoint& point, int family,
                                             const LineName& name) const {
  std::vector<LineName> others;
  const auto add = [&](const LineName& other) {
    if (other.pattern != name.pattern && family_of(families_, other.pattern) == family &&
        std::find(others.begin(), others.end(), other) == others.end())
      others.push_back(other);
  };
  named_.names_around(point.position, static_cast<float>(options_.max_offset_px), add);
  predicted_.aligned(point, [&](const PredictedPoint& p, float across) {
    if (predicted_.is_near(across, p)) add(name_of(p));
  });
  return others;
}

bool SharedLight::is_lit_too(const CurvePoint& point, int family, const PredictedPoint& p) const {
  // Share of its light that must be there. A half would weigh both answers alike; but nine in ten
  // predicted lines are there, and lines differ from those beside them by a third: 1/2 - ln 9 /
  // 3^2.
  constexpr float kLeastOwn = 0.25F;
  const auto own = amplitude_of(name_of(p), point, p.spacing_px);
  if (!own) return false;
  const std::vector<LineName> others = others_at(point, family, name_of(p));
  float rest = point.amplitude;
  for (const LineName& other : others) {
    const auto of_other = amplitude_of(other, point, p.spacing_px);
    if (!of_other) return false;
    rest -= *of_other;
  }
  return !others.empty() && rest > kLeastOwn * *own;
}

}  // namespace

std::vector<SharedCurve> find_shared(const Camera& camera, const std::vector<ColorFamily>& families,
                                     std::span<const Curve> curves,
                                     std::span<const LineChain> missing, const NamedPoints& named,
                                     const PredictedPlaces& predicted,
                                     const GuidedMatchingOptions& options) {
  const SharedLight light(camera, families, curves, named, predicted, options);
  std::vector<SharedCurve> shared;
  for (const LineChain& chain : missing) {
    const LineName name = name_of(chain.front());
    const int family = family_of(families, name.pattern);
    std::vector<CurvePoint> points(chain.size());
    std::vector<char> is_lit(chain.size(), 0);
    for (std::size_t i = 0; i < chain.size(); ++i) {
      const CurvePoint* point = light.shown_at(chain[i], family);
      if (point == nullptr || !light.is_lit_too(*point, family, chain[i])) continue;
      is_lit[i] = 1;
      points[i] = *point;
      points[i].sigma_px =
          std::hypot(point->sigma_px, (point->position - chain[i].position).norm());
    }
    for_each_stretch(is_lit, [&](int begin, int end) {
      if (is_lit[static_cast<std::size_t>(begin)] == 0 || end - begin < options.min_points) return;
      SharedCurve& of_stretch = shared.emplace_back(SharedCurve{{}, name});
      of_stretch.curve.family = family;
      of_stretch.curve.points.assign(points.begin() + begin, points.begin() + end);
    });
  }
  return shared;
}

}  // namespace pencilscan
