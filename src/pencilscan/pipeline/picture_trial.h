#pragma once

#include <vector>

#include "pencilscan/pipeline/line_naming.h"

namespace pencilscan {

/// Right pictures have .58 and more named (an object on a lit floor between walls), wrong ones .21
/// and less.
constexpr double kFewNamed = 0.4;

/// Measured points of every seventh pixel of the labelled curves.
[[nodiscard]] std::vector<MeasuredPoint> some_points(const Rig& rig, const PointResult& found);

/// Names the curves of single pictures, which come as linear light of three colours.
class PictureTrial {
 public:
  PictureTrial(const Rig& rig, const PointOptions& options);

  /// Of `light` where camera c stands.
  [[nodiscard]] TellingPoints telling_points(std::size_t c, const cv::Mat& light) const;

  /// What `light` measures where camera c stands.
  [[nodiscard]] std::vector<MeasuredPoint> points(std::size_t c, const cv::Mat& light) const;

 private:
  [[nodiscard]] PointResult solved(std::size_t c, const cv::Mat& light) const;

  Rig rig_;
  PointOptions options_;
};

}  // namespace pencilscan
