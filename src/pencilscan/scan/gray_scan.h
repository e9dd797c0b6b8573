#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/gray/gray_decode.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/surface/sample.h"

namespace pencilscan {

struct GrayScanOptions {
  int step_px = 2;             ///< of the lattice of camera pixels, >= 1
  double worst_miss_px = 1.5;  ///< of the two rays, panel px: codes that fit no point are dropped
  double least_angle_rad = 0.05;  ///< between the rays
};

/// The surface that one camera and one projector measured.
struct GrayScan {
  std::vector<MeasuredPoint> points;   ///< line and plane: the panel column
  std::vector<SurfaceSample> samples;  ///< the same points with normals, for meshing
  std::size_t missed = 0;  ///< codes without a point: their rays do not meet, or narrowly
  std::size_t narrow = 0;  ///< of these, rays that meet at too small an angle
};

/// Triangulates every decoded pixel of a lattice: camera ray and panel ray, each panel coordinate
/// from a quadratic through its surroundings (gray/local_map.h). Normals come from the
/// slopes of that quadratic. sigma is along the camera ray: what the error of the panel coordinates
/// along the epipolar line makes there; across it the two rays miss each other, and depth stays.
[[nodiscard]] GrayScan gray_scan(const Rig& rig, std::size_t camera, std::size_t projector,
                                 const DecodedView& decoded, const GrayScanOptions& options = {});

/// What one camera and one projector gave, for `misfit_warning`.
struct PairYield {
  std::string name;  ///< proj0/cam0
  std::size_t points = 0;
  std::size_t missed = 0;  ///< codes whose rays do not meet
};

/// Names the pairs of which many codes fit no point: their captures are of another rig, or a device
/// moved.
[[nodiscard]] std::optional<std::string> misfit_warning(std::span<const PairYield> pairs);

/// Closed surface of all pairs' samples; empty when there are too few. `cell_mm` is the
/// wished size of its cells, > 0.
[[nodiscard]] TriangleMesh scan_mesh(std::span<const SurfaceSample> samples, double cell_mm);

}  // namespace pencilscan
