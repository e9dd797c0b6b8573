#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/core/progress.h"
#include "pencilscan/core/warning.h"
#include "pencilscan/depth/depth_map.h"
#include "pencilscan/geometry/mesh.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/surface/node_surface.h"
#include "pencilscan/surface/sample.h"
#include "pencilscan/surface/silhouette.h"
#include "pencilscan/uncertainty/error_model.h"

namespace pencilscan {

/// From measured curve pixels to one closed surface.
///
/// 1. Points of one curve within a short piece of it become one sample (sample.h): positions are
///    averaged with weights 1 / sigma^2, and the curves' dense sampling along themselves no longer
///    outweighs the sparse one across them.
/// 2. Samples vote on each other (filter.h): samples of other curves on the same local surface
///    support, samples whose sight or light line passes through one contradict it.
/// 3. A local quadric per sample gives its normal and its place across the surface (local_fit.h).
/// 4. A field says what is inside: signed distances near the samples, smooth between them
///    (inside_field.h); marching cubes gives its closed surface.
/// 5. Each vertex learns from the samples near it whether it was measured, and how well.
///
/// Lengths are in footprints (rig/rig.h): a rig in another unit is scaled before.
/// The bytes are the same for any thread count.
struct SurfaceOptions {
  bool filter = true;            ///< votes on; off takes every point as it is
  int max_depth = 9;             ///< log2 of the cells along a cube around the object, in [5, 10]
  double cell_spacings = 0.25;   ///< side of a cell in line spacings, > 0
  double sample_spacings = 0.3;  ///< length of curve per sample in line spacings, > 0
  double reach_spacings = 1.0;   ///< a vertex farther from all samples was not measured, > 0
  double min_component_share = 0.05;  ///< of the largest component's measured area, in [0, 1]
};

enum class SurfaceStatus {
  kDone,
  kTooFewPoints,  ///< meshes are empty
  kNotClosed,     ///< mesh.ply has boundary or non-manifold edges (see warnings)
};

struct SurfaceReport {
  SurfaceStatus status = SurfaceStatus::kDone;
  std::size_t points =
      0;  ///< input points with finite coordinates (and nearer than 1e7 footprints)
  std::size_t points_used = 0;  ///< of them, those whose sample survived the votes
  double spacing_mm = 0;        ///< median distance of neighbouring light sheets at the object
  int depth = 0;                ///< log2 of the cells along the cube
  std::size_t vertices = 0;
  std::size_t faces = 0;
  EdgeCounts edges;                    ///< of the closed mesh; all zero when it is watertight
  std::size_t self_intersections = 0;  ///< faces that cut another one (dense depth)
  double measured_share = 0;  ///< area of `mesh` that was measured, islands and all / its area
  std::vector<Warning> warnings;
};

struct SurfaceResult {
  TriangleMesh mesh;       ///< closed; confidence 0 = invented
  TriangleMesh measured;   ///< the same faces without those that touch an invented vertex
  std::vector<char> used;  ///< per input point: 1 when the surface rests on it
  /// Per vertex of `mesh`, footprints: what its sigma rests on. Empty without dense depth.
  std::vector<SurfaceEvidence> evidence;
  /// Between close_depth() and follow_depth(): nodes of the depth maps on their local surfaces.
  std::vector<SurfaceSample> samples;
  SurfaceReport report;
};

/// InputError when a point names a camera, projector or pattern that the rig does not have.
[[nodiscard]] SurfaceResult reconstruct_surface(const Rig& rig,
                                                std::span<const MeasuredPoint> points,
                                                const SurfaceOptions& options = {},
                                                const Progress& progress = {});

/// From dense depth to one closed surface.
struct FusionOptions {
  int max_depth = 9;           ///< log2 of the cells along a cube around the object, in [5, 10]
  double cell_spacings = 1.0;  ///< side of a cell in node spacings, > 0
  double fit_spacings = 1.5;   ///< radius of local quadrics in node spacings, > 0
  int subdivisions = 1;        ///< of the cells' triangles, before they follow the depth
  CarvingOptions carving;      ///< of what was invented, by the silhouettes
  FollowOptions follow;        ///< how vertices follow the depth
  double reach_spacings = 2;   ///< a vertex farther from all nodes was not measured, > 0
  double min_component_share = 0.05;   ///< of the largest component's measured area, in [0, 1]
  double least_island_spacings2 = 16;  ///< area of a measured island that is kept, spacings^2
};

/// The nodes of all depth maps, each weighted by its variance, move onto local quadrics through the
/// nodes of all cameras (local_fit.h); a field of what is inside closes them (inside_field.h);
/// silhouettes carve what was invented. The mesh is as coarse as the field.
[[nodiscard]] SurfaceResult close_depth(const Rig& rig, std::span<const DepthMap> maps,
                                        const FusionOptions& options = {},
                                        std::span<const Silhouette> silhouettes = {});

/// The triangles of a closed surface are cut finer and follow the nodes' quadrics where there is
/// depth (node_surface.h). Nothing to do where the status is kTooFewPoints.
void follow_depth(const Rig& rig, std::span<const DepthMap> maps, const FusionOptions& options,
                  SurfaceResult& result);

/// Which `points` the depth maps bear out; none where the status is kTooFewPoints.
void note_points_used(const Rig& rig, std::span<const MeasuredPoint> points,
                      std::span<const DepthMap> maps, SurfaceResult& result);

/// The measured part of a surface whose attributes are known, and what the surface is worth. None
/// of it where the status is kTooFewPoints.
void finish_surface(const FusionOptions& options, SurfaceResult& result);

[[nodiscard]] std::string to_string(SurfaceStatus status);

}  // namespace pencilscan
