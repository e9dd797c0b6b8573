#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pencilscan/labeling/measured_point.h"
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

}  // namespace pencilscan
