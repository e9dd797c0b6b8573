#pragma once

#include <functional>
#include <vector>

namespace pencilscan {

struct PairwiseEnergy;

/// Another way to minimise the energy: approximate min-marginals, laid out as `unary` (min_sum.h).
using Inference = std::function<std::vector<float>(const PairwiseEnergy&)>;

struct JointOptions {
  Inference inference;    ///< empty: min-sum messages
  int piece_length = 24;  ///< points labelled as one; >= 4
  int max_labels = 24;    ///< kept per piece before messages are passed; >= 2; more where
                          ///< many patterns share a colour or nothing crosses
  /// Most that a kept label may cost above the best of its piece, as far as crossings, and then
  /// other cameras, tell. Costs are negative log-likelihoods. Measured (docs/performance.md): at
  /// 10, accuracy is that of no limit; at 7, half a thousandth of the points change.
  double max_behind = 10;
  double projection_sigma_px = 0.3;  ///< error of a plane, projector px; > 0
  double crossing_outliers = 0.05;   ///< share of crossings that are none
  double max_color_cost = 4;         ///< log-likelihood ratio that a piece's colour can give
  double change_cost = 4;            ///< of a curve that jumps from one line to another
  int passes = 2;                    ///< message passing, then what the cameras say of each other
  int rounds = 4;                    ///< of messages in a pass
  double damping = 0.3;              ///< share of the old message kept, [0, 1)
  double min_confidence = 0.955;     ///< pieces below stay undecided
  /// The same where nothing crosses: that a few curves are wrong together is always possible there,
  /// and few lines were named else.
  double min_uncrossed_confidence = 0.9;

  /// Cost of a crossing whose planes do not meet.
  [[nodiscard]] float disagreement_cost() const;
};

}  // namespace pencilscan
