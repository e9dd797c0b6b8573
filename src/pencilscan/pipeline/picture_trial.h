#pragma once

#include <vector>

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// Right pictures have .58 and more named (an object on a lit floor between walls), wrong ones .21
/// and less.
constexpr double kFewNamed = 0.4;
constexpr std::size_t kLeastCurvePoints = 500;  ///< of a picture that can be judged

/// The curve points of a picture that a right one could have named: what nothing crosses, or lies
/// outside the volume (walls, people), says nothing.
struct TellingPoints {
  std::size_t named = 0;
  std::size_t unnamed = 0;

  [[nodiscard]] std::size_t all() const { return named + unnamed; }
  [[nodiscard]] bool are_enough() const { return all() >= kLeastCurvePoints; }
  [[nodiscard]] double named_share() const {
    return named > 0 ? static_cast<double>(named) / static_cast<double>(all()) : 0;
  }
};
[[nodiscard]] TellingPoints telling_points(const Labeling& labeling, std::size_t c);

/// Measured points of every seventh pixel of the curves.
[[nodiscard]] std::vector<MeasuredPoint> some_points(const Rig& rig,
                                                     const std::vector<GridGraph>& graphs,
                                                     const Labeling& labeling);

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
