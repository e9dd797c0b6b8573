#pragma once

#include <span>
#include <vector>

#include "pencilscan/surface/point_grid.h"
#include "pencilscan/surface/sample.h"

namespace pencilscan {

/// Plane fit to the samples that the same camera saw within `radius`, reweighted against outliers
/// (three rounds of Cauchy weights), oriented towards the camera. One camera sees one side only, so
/// a thin part does not mix its two faces. A curve without neighbours takes the direction to the
/// camera made perpendicular to the curve.
[[nodiscard]] std::vector<Vec3> initial_normals(std::span<const SurfaceSample> samples,
                                                const PointGrid& grid, double radius);

/// Moving least squares (Levin, "The approximation power of moving least-squares", 1998): a quadric
/// z = c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2 over the tangent plane of each sample, weighted
/// by distance and 1 / sigma^2 across the surface, from the samples of all cameras whose normals
/// lie within 60 degrees. Sets normal, residual and moves the sample along its normal onto the
/// quadric, by no more than a quarter of the radius. Samples before `first` are on theirs already.
void fit_local_surfaces(std::vector<SurfaceSample>& samples, double radius, std::size_t first = 0);

}  // namespace pencilscan
