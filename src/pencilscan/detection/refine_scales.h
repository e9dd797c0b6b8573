#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/detection/curve.h"
#include "pencilscan/detection/profile_fit.h"

namespace pencilscan {

// Curves in images of half, quarter ... size: size k has 1 / 2^k of the full image's, its pixel
// (x, y) lies at (x, y) / 2^k of cv::pyrDown().

/// The widest profile whose fit holds it: 2.4 widths to either side, where a box of logistic edges
/// has ended.
constexpr float kWidestProfilePx = static_cast<float>(kMaxHalf) / 2.4F;

/// px of the size that the points are given at; 0 of no points.
[[nodiscard]] float median_width(std::span<const CurvePoint> points);

/// Size at which a curve that is given at `size` is fitted: the largest that holds a profile of its
/// median width.
[[nodiscard]] std::size_t size_of_curve(const Curve& curve, std::size_t size);

/// A curve from one size to another: points about 1 px of that size apart. Doubling puts points
/// between two on the cubic through both along their tangents.
[[nodiscard]] Curve resized(Curve curve, std::size_t from, std::size_t to);

/// An image at size `size`.
[[nodiscard]] cv::Mat resized_image(cv::Mat image, std::size_t size);

}  // namespace pencilscan
