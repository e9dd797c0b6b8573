#pragma once

#include <span>
#include <vector>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/tracking/tracked_surface.h"

namespace pencilscan {

/// How many moments the mean of a resting surface goes back. As many come before the first moment
/// of a chunk, so that the mean is the same on both sides of its border.
constexpr int kMemoryMoments = 4;

/// Where a surface rests, its noise is not its motion. Each measured vertex moves along its normal
/// towards where the moment before has the surface: a Kalman filter with one state, its place
/// (R. Kalman, A new approach to linear filtering and prediction problems, 1960). Its process noise
/// is how far the vertex has come, along the surface too (`traveled`, of the first vertices; those
/// between them as far as these), and how far the vertices around it moved together beyond their
/// noise. What moves is left alone. Returns the variance of each vertex's place (0: not measured)
/// for the next moment.
[[nodiscard]] std::vector<float> steady_surface(const TrackedSurface& before,
                                                std::span<const float> traveled,
                                                TriangleMesh& mesh);

/// The variances of a surface without a moment before.
[[nodiscard]] std::vector<float> first_variance(const TriangleMesh& mesh);

}  // namespace pencilscan
