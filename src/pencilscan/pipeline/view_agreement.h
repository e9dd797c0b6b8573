#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/points/local_surface.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

// Whether cameras see one object. In a ring that repeats itself, the picture of another camera fits
// the projectors as well as its own would: nothing but the other cameras contradicts it.

/// What two cameras say of each other's points.
struct PairAgreement {
  std::size_t same = 0;   ///< points that the other one measured too, within .3 line spacings
  std::size_t apart = 0;  ///< points in front of all that the other one measured there

  [[nodiscard]] double share() const {
    return same + apart > 0 ? static_cast<double>(same) / static_cast<double>(same + apart) : 1.0;
  }
  /// They have enough to say, and most of it is against each other.
  [[nodiscard]] bool is_doubtful() const;
};

/// Of every pair of cameras.
class ViewAgreement {
 public:
  /// `points[c]`: of camera c.
  ViewAgreement(const Rig& rig, std::span<const std::vector<MeasuredPoint>> points);

  [[nodiscard]] const PairAgreement& of(std::size_t a, std::size_t b) const {
    return pairs_[a < b ? b * count_ + a : a * count_ + b];
  }
  /// Of a camera with all others together.
  [[nodiscard]] PairAgreement with_others(std::size_t camera) const;
  [[nodiscard]] std::size_t doubtful_pairs() const;
  /// Cameras in doubtful pairs, in order.
  [[nodiscard]] std::vector<std::size_t> doubtful_cameras() const;

 private:
  std::size_t count_;
  std::vector<PairAgreement> pairs_;
};

/// Views that are farther apart are not those of one object: rendered scenes have .4 to 1.0, two
/// cameras exchanged before a ball 11 and more.
inline constexpr double kMostApart = 3;

/// By how much more depths of different cameras lie apart than their deviations explain (1.48 times
/// the median of the normalised differences); nothing where they hardly overlap.
struct ViewsApart {
  std::optional<double> all;
  std::vector<std::optional<double>> with;     ///< of each camera, against all others
  std::vector<std::optional<double>> without;  ///< of all others, among each other

  /// The one camera that lies apart from others that agree: its picture is of another moment, or
  /// it stands elsewhere.
  [[nodiscard]] std::optional<std::size_t> single() const;
};
/// `surfaces`: what each camera's points show. What lies farther apart than half a line spacing is
/// another surface.
[[nodiscard]] ViewsApart views_apart(const Rig& rig, std::span<const MeasuredPoint> points,
                                     std::span<const LocalSurface> surfaces);

}  // namespace pencilscan
