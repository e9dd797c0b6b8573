#pragma once

#include <span>
#include <vector>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/tracking/tracked_surface.h"

namespace pencilscan {

/// How many moments the mean of a resting surface goes back. As many come before the first moment
/// of a chunk, so that the mean is the same on both sides of its border.
constexpr int kMemoryMoments = 4;

/// Removes the flicker of a surface that rests: there, noise differs from moment to moment while
/// the surface does not. Each measured vertex moves along its normal towards the surface of the
/// moment before, by a Kalman filter whose one state is its place (R. Kalman, A new approach to
/// linear filtering and prediction problems, 1960). The process noise has two parts: how far the
/// vertex has come, along the surface too (`traveled`, of the first vertices; those between them
/// have come as far as these), and how far the vertices around it moved together beyond their
/// noise. Parts that move stay as measured. Returns, for the next moment, the variance of each
/// vertex's place (0: not measured).
[[nodiscard]] std::vector<float> steady_surface(const TrackedSurface& before,
                                                std::span<const float> traveled,
                                                TriangleMesh& mesh);

/// The variances of a surface without a moment before.
[[nodiscard]] std::vector<float> first_variance(const TriangleMesh& mesh);

}  // namespace pencilscan
