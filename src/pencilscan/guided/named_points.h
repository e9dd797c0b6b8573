#pragma once

#include <map>
#include <optional>
#include <utility>

#include "pencilscan/detection/curve.h"
#include "pencilscan/guided/guided_matching.h"
#include "pencilscan/view/places.h"

namespace pencilscan {

/// Points of one camera's curves that have a name, by place.
class NamedPoints {
 public:
  NamedPoints(const Camera& camera, const GuidedMatchingOptions& options);

  /// Adds the points of a run of the curve.
  void add(const Curve& curve, const LabeledRun& run);
  /// How many points were added.
  [[nodiscard]] std::size_t count() const { return names_.size(); }
  /// True where a point within 1.5 px has the name of a predicted one. The first `known` points are
  /// known not to.
  [[nodiscard]] bool show(const PredictedPoint& p, std::size_t known = 0) const;
  /// visit(name) for each point within `reach` px, of a pixel or two.
  template <class Visit>
  void names_around(const Eigen::Vector2f& place, float reach, Visit visit) const {
    names_.around(place, reach, [&](const NamedPlace& n) {
      if ((n.position - place).squaredNorm() < reach * reach) visit(n.name);
    });
  }
  /// Median amplitude around a place of the lines of the name's pattern that are `nearest` to
  /// `farthest` lines from it, within `farthest` times the reach of the options' support; nothing
  /// where fewer points are known than that asks for. `spacing_px`: of the lines, in the picture.
  [[nodiscard]] std::optional<float> amplitude_around(const Eigen::Vector2f& place,
                                                      const LineName& name, float spacing_px,
                                                      int nearest, int farthest) const;

 private:
  struct NamedPlace {
    Eigen::Vector2f position;
    LineName name;
  };
  struct LineLight {
    Eigen::Vector2f position;
    int line;
    float amplitude;
  };

  const GuidedMatchingOptions& options_;
  cv::Size size_;
  Places<NamedPlace> names_;  ///< looked for within a pixel or two
  /// The same points by projector and pattern, looked for within some line spacings.
  std::map<std::pair<int, int>, Places<LineLight>> lights_;
};

}  // namespace pencilscan
