#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pencilscan/rig/rig.h"
#include "pencilscan/surface/lattice.h"
#include "pencilscan/surface/sample.h"

namespace pencilscan {

/// What is inside of a surface of which oriented samples are known: > 0 inside, < 0 outside.
struct InsideField {
  Lattice lattice;            ///< around the surface
  std::vector<float> values;  ///< per node, in [-1/2, 1/2]
  Vec3 origin;                ///< of node (0, 0, 0)
  double cell = 0;            ///< side of a cell
};

/// Near a sample, the field is the signed distance t to it in widths of the step from -1/2 to 1/2;
/// of several samples the mean, weighted by closeness. Elsewhere it is what is smoothest. With chi
/// the field, least are the squares
///   sum over edges (a, b) of (chi_b - chi_a - min(c_a, c_b) (t_b - t_a))^2
///   + 4 * sum over nodes of c (chi - t)^2,
/// where c in [0, 1] says how many samples are near and how much they agree; 0 where there is none.
/// This is screened Poisson (Kazhdan and Hoppe 2013) with the gradient of local distances in place
/// of smeared normals; gaps are bridged as by volumetric diffusion (Davis et al. 2002). The field
/// is -1/2 on the faces of the cube, so that the surface closes within it.
///
/// It is solved from coarse to fine lattices by conjugate gradients: the coarsest fills the cube,
/// each finer one has the cells around samples and around the surface that the coarser one shows,
/// and keeps the coarser one's values at its rim.
///
/// The cube has cells^3 cells; cells: 32 times a power of two, at most Lattice::kMaxCells. A sample
/// reaches as far as its `spacing` demands. What is below a floor is outside: where nothing is
/// known of an object's base, it ends there. The bytes are the same for any thread count.
[[nodiscard]] InsideField inside_field(std::span<const SurfaceSample> samples, const Vec3& origin,
                                       double cell, int cells,
                                       const std::optional<Floor>& floor = std::nullopt);

}  // namespace pencilscan
