#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/guided/predicted_lines.h"
#include "pencilscan/guided/run_places.h"

namespace pencilscan {

/// Lines of like colours that run side by side within their widths show one curve, which lies
/// between them and has one name. Where a surface lets expect two, the light that the curve took
/// is given back; the amplitudes of both lines are fitted together at their predicted places; and
/// without the line that has the name, the light shows the other one by itself.
class MergedLines {
 public:
  /// Of one camera. `runs`: the names of `curves`. `subtracted`: per curve, whether `unexplained`,
  /// the light of each colour family, is without it; others hold no light of their own.
  /// `predicted`: points of lines that have a name. What is passed has to stay.
  MergedLines(const Camera& camera, std::span<const Curve> curves, std::span<const LabeledRun> runs,
              const std::vector<char>& subtracted, std::span<const PredictedPoint> predicted,
              std::span<const cv::Mat> unexplained);

  struct Fit {
    std::vector<Curve> pieces;
    std::size_t beside = 0;  ///< points of the guess with a named curve beside them
  };
  /// Fits a line that has no curve: `guess`, with its predicted places and widths.
  [[nodiscard]] Fit fit(const Curve& guess, const LineName& name) const;

 private:
  /// A stretch of a named curve beside the guess.
  struct Neighbour {
    Curve fitted;    ///< as it is
    Curve expected;  ///< as the surface lets expect its line
  };

  [[nodiscard]] std::vector<Neighbour> neighbours_of(const Curve& guess, const LineName& name,
                                                     float reach, std::size_t& beside) const;
  [[nodiscard]] const PredictedPoint* expected_at(const CurvePoint& p, const LineName& name) const;

  std::span<const Curve> curves_;
  std::span<const LabeledRun> runs_;
  std::span<const cv::Mat> unexplained_;
  Places<RunPoint> named_;
  Places<PredictedPoint> predicted_;
};

}  // namespace pencilscan
