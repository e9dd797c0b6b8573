#include "pencilscan/detection/fitted_points.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace pencilscan {

ProfileFit fit_of(const ProfileFits& fits, int lane) {
  return {fits.amplitude[lane], fits.offset[lane],      fits.width[lane],
          fits.residual2[lane], fits.offset_gain[lane], fits.good[lane] != 0};
}

void take_fits(std::span<const ProfileFit> fits, std::span<CurvePoint> points) {
  constexpr std::size_t kAround = 6;
  // Sums of the residual variances of good fits, and their number, before each point.
  std::vector<double> level_before(fits.size() + 1, 0.0);
  std::vector<int> good_before(fits.size() + 1, 0);
  for (std::size_t i = 0; i < fits.size(); ++i) {
    level_before[i + 1] = level_before[i] + (fits[i].good ? double{fits[i].residual2} : 0.0);
    good_before[i + 1] = good_before[i] + (fits[i].good ? 1 : 0);
  }
  for (std::size_t i = 0; i < fits.size(); ++i) {
    const ProfileFit& fit = fits[i];
    if (!fit.good) continue;
    const std::size_t low = i - std::min(i, kAround);
    const std::size_t high = std::min(fits.size(), i + kAround + 1);
    const double level = (level_before[high] - level_before[low]) /
                         static_cast<double>(good_before[high] - good_before[low]);
    CurvePoint& p = points[i];
    p.position += fit.offset * p.normal;
    p.amplitude = fit.amplitude;
    p.width_px = fit.width;
    p.sigma_px = std::sqrt(static_cast<float>(std::max(0.0, level)) * fit.offset_gain);
  }
}

}  // namespace pencilscan
