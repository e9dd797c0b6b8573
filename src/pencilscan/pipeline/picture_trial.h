#pragma once

#include <vector>

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// Right pictures have .58 and more named (an object on a lit floor between walls), wrong ones .21
/// and less.
constexpr double kFewNamed = 0.4;
constexpr std::size_t kLeastCurvePoints = 500;  ///< of a picture that can be judged

/// Share of a camera's curve points that have a name, of those that a right picture could have
/// named: what nothing crosses, or lies outside the volume (walls, people), says nothing.
[[nodiscard]] double named_share(const Labeling& labeling, std::size_t c);

/// Measured points of every seventh pixel of the curves.
[[nodiscard]] std::vector<MeasuredPoint> some_points(const Rig& rig,
                                                     const std::vector<GridGraph>& graphs,
                                                     const Labeling& labeling);

/// Names the curves of single pictures, which come as linear light of three colours.
class PictureTrial {
 public:
  PictureTrial(const Rig& rig, const PointOptions& options);

  /// How many points of `light` have a name where camera c stands, and named_share() there.
  struct Named {
    double points = 0;
    double share = 0;
  };
  [[nodiscard]] Named named(std::size_t c, const cv::Mat& light) const;

  /// What `light` measures where camera c stands.
  [[nodiscard]] std::vector<MeasuredPoint> points(std::size_t c, const cv::Mat& light) const;

 private:
  [[nodiscard]] PointResult solved(std::size_t c, const cv::Mat& light) const;

  Rig rig_;
  PointOptions options_;
};

}  // namespace pencilscan
