#pragma once

#include <cstddef>
#include <vector>

#include "pencilscan/bundle/bundle.h"
#include "pencilscan/bundle/triangulation.h"

namespace pencilscan {

/// Errors of all views of a track but the hub at the point that fits them best.
[[nodiscard]] std::vector<double> track_errors(const BundleProblem& problem, const Track& track,
                                               const Vec3& point);

/// Robust standard deviation of one coordinate's error, px. A track of n measured views has 2 n - 1
/// degrees of freedom left, since they choose the depth on the hub's ray.
[[nodiscard]] double error_scale(const BundleProblem& problem);

/// From which error on a view is no measurement, px. Below a third of a pixel errors of lenses and
/// of codes between panel pixels are alike; dropping these would only make the rest look better.
[[nodiscard]] double outlier_limit(const BundleProblem& problem, double deviations);

/// From which distance to an epipolar line on two devices contradict each other, px, where usual
/// errors are so large: no error of a lens or a code is as large.
[[nodiscard]] double contradiction_limit(double usual_px);

/// Of what the views say of themselves, px.
[[nodiscard]] double median_sigma(const BundleProblem& problem);

/// Drops views beyond `limit` pixels, and tracks that are left with one view. Returns how many
/// views.
std::size_t drop_outliers(BundleProblem& problem, double limit);

}  // namespace pencilscan
