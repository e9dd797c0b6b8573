#pragma once

#include <span>
#include <vector>

#include "pencilscan/rig/rig.h"
#include "pencilscan/surface/point_grid.h"
#include "pencilscan/surface/sample.h"

namespace pencilscan {

/// How much the other samples believe each sample, in [0, 1].
///
/// A sample of belief w votes with weight w, so the votes are iterated (a fixed number of Jacobi
/// rounds from w = 1): w = S / (S + C + prior), both sums averaged along the curve over one
/// spacing, because labels are wrong by pieces of curves.
///
/// S, support: the best sample of each other curve nearby that lies on this sample's tangent plane.
/// Curves of the same camera and projector count less: one wrong labelling shifts them together.
/// C, contradiction: a sample's camera ray and light ray pass through empty space. Whoever lies on
/// such a segment, more than a margin before its end, contradicts its owner and is contradicted.
/// (Cf. the stability of Merrell et al., "Real-time visibility-based fusion of depth maps", 2007.)
[[nodiscard]] std::vector<double> vote(const Rig& rig, std::span<const SurfaceSample> samples,
                                       const PointGrid& grid, double spacing);

/// Clears keep[i] of samples in small clusters. A cluster is a chain of kept samples with gaps up
/// to `gap_mm`; it is small if it has less than min_share of the largest cluster's samples.
/// Clusters far away would stretch the cube, and with it every cell.
void drop_small_clusters(std::span<const SurfaceSample> samples, double gap_mm, double min_share,
                         std::vector<char>& keep);

/// Samples believed less than this are wrong more often than right.
inline constexpr double kBeliefThreshold = 0.65;

}  // namespace pencilscan
