#pragma once

#include <span>
#include <vector>

#include "pencilscan/guided/predicted_lines.h"
#include "pencilscan/guided/run_places.h"

namespace pencilscan {

/// A line where no curve shows it, with the curves that show it before and after.
struct ContinuedLine {
  Curve curve;              ///< points of the curve before, of the guess, of the curve after
  std::vector<Curve> ends;  ///< those of curves, as they are

  /// True where a point of the line, fitted, shows what a curve shows already.
  [[nodiscard]] bool is_of_end(const CurvePoint& p) const;
  /// The least of those farthest within the ends; 0: there are none.
  [[nodiscard]] float amplitude_within() const;
};

/// Where named curves end. A line goes on there: a fit to a gap averages over its ends as it does
/// over the rest of a curve, so it may be as short as it is.
class NamedEnds {
 public:
  /// Of one camera. `runs`: the names of `curves`. `subtracted`: per curve, whether it has light of
  /// its own; ends of others continue nothing. What is passed has to stay.
  NamedEnds(const Camera& camera, std::span<const Curve> curves, std::span<const LabeledRun> runs,
            const std::vector<char>& subtracted);

  /// A guess with up to `most` points of curves of its line to either side, moved across by what
  /// the line lies aside of it there.
  [[nodiscard]] ContinuedLine continued(Curve guess, const LineName& name, int most) const;

 private:
  [[nodiscard]] std::vector<CurvePoint> beyond(const CurvePoint& end,
                                               const Eigen::Vector2f& outward, const LineName& name,
                                               int most) const;

  std::span<const Curve> curves_;
  std::span<const LabeledRun> runs_;
  Places<RunPoint> named_;
};

}  // namespace pencilscan
