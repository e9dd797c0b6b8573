#include "pencilscan/surface/surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "pencilscan/core/check.h"
#include "pencilscan/core/chunks.h"
#include "pencilscan/core/median.h"
#include "pencilscan/depth/consistency.h"
#include "pencilscan/surface/attributes.h"
#include "pencilscan/surface/closing.h"
#include "pencilscan/surface/filter.h"
#include "pencilscan/surface/local_fit.h"
#include "pencilscan/surface/manifold.h"
#include "pencilscan/surface/mesh_parts.h"
#include "pencilscan/surface/node_samples.h"
#include "pencilscan/surface/node_surface.h"
#include "pencilscan/surface/sample.h"
#include "pencilscan/surface/untangle.h"

namespace pencilscan {
namespace {

constexpr std::size_t kLeastSamples = 30;  // fewer give no surface worth the name
constexpr double kFitRadius = 1.6;         // spacings, neighbourhood of a local surface
constexpr double kClusterGap = 2;          // spacings; one missing line does not split an object
constexpr double kLeastCluster = 0.01;     // of the largest cluster's samples

/// Both kinds of options have these in common.
ClosingOptions closing_of(const auto& options, double spacing_mm, const Rig& rig) {
  ClosingOptions closing;
  closing.spacing_mm = spacing_mm;
  closing.cell_mm = options.cell_spacings * spacing_mm;
  closing.max_depth = options.max_depth;
  closing.reach_spacings = options.reach_spacings;
  closing.min_component_share = options.min_component_share;
  closing.floor = rig.floor;
  return closing;
}

std::vector<Vec3> positions_of(std::span<const SurfaceSample> samples) {
  std::vector<Vec3> positions;
  positions.reserve(samples.size());
  for (const SurfaceSample& s : samples) positions.push_back(s.position);
  return positions;
}

/// Gives samples their normals and says which of them survive the votes.
std::vector<char> judge_samples(const Rig& rig, const SurfaceOptions& options, SampleSet& set,
                                SurfaceReport& report) {
  const std::vector<Vec3> positions = positions_of(set.samples);
  const PointGrid grid(positions, kFitRadius * set.spacing);
  const std::vector<Vec3> normals = initial_normals(set.samples, grid, kFitRadius * set.spacing);
  for (std::size_t i = 0; i < normals.size(); ++i) set.samples[i].normal = normals[i];
  std::vector<char> keep(set.samples.size(), 1);
  if (!options.filter) return keep;
  const std::vector<double> belief = vote(rig, set.samples, grid, set.spacing);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < keep.size(); ++i) {
    keep[i] = belief[i] >= kBeliefThreshold;
    kept += static_cast<std::size_t>(keep[i]);
  }
  if (kept < kLeastSamples && keep.size() >= kLeastSamples) {
    report.warnings.push_back(
        {WarningCode::kUnsupported,
         "hardly any point is supported by another curve: all points are used"});
    keep.assign(keep.size(), 1);
    return keep;
  }
  drop_small_clusters(set.samples, kClusterGap * set.spacing, kLeastCluster, keep);
  return keep;
}

/// Points that the depth of their own pixel bears out.
std::vector<char> points_on_maps(const Rig& rig, std::span<const MeasuredPoint> points,
                                 std::span<const DepthMap> maps, double tolerance) {
  std::vector<char> used(points.size(), 0);
  parallel_chunks(points.size(), [&](std::size_t i) {
    const MeasuredPoint& p = points[i];
    for (const DepthMap& map : maps) {
      if (map.camera != p.camera) continue;
      const int column = static_cast<int>(std::lround(p.u / static_cast<float>(map.stride)));
      const int row = static_cast<int>(std::lround(p.v / static_cast<float>(map.stride)));
      if (row < 0 || column < 0 || row >= map.rows || column >= map.columns) continue;
      const std::size_t k = map.index(row, column);
      if (!map.nodes[k].measured()) continue;
      const Vec3 d = position_of(p) - node_point(rig, map, k);
      used[i] = std::abs(d.dot(node_normal(rig, map, k))) < tolerance ? 1 : 0;
    }
  });
  return used;
}

void note_quality(SurfaceResult& result) {
  SurfaceReport& report = result.report;
  report.edges = count_edges(result.mesh);
  report.vertices = result.mesh.vertices.size();
  report.faces = result.mesh.faces.size();
  if (result.mesh.faces.empty() || report.edges.boundary > 0 || report.edges.non_manifold > 0) {
    report.status = SurfaceStatus::kNotClosed;
    report.warnings.push_back(
        {WarningCode::kNotClosed,
         "the surface is not closed: " + std::to_string(report.edges.boundary) + " boundary and " +
             std::to_string(report.edges.non_manifold) + " non-manifold edges",
         {},
         {{"boundary", static_cast<double>(report.edges.boundary)},
          {"non_manifold", static_cast<double>(report.edges.non_manifold)}}});
  }
  if (report.measured_share < 0.5) {
    report.warnings.push_back({WarningCode::kLittleMeasured,
                               "less than half of the closed surface was measured",
                               {},
                               {{"share", report.measured_share}}});
  }
}

/// Share of the area whose faces were measured: that of kMeasured in HoleReport::area_mm2.
double measured_share(const TriangleMesh& mesh) {
  const std::vector<char> measured = measured_faces(mesh);
  double area = 0, of_measured = 0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    area += face_area(mesh, f);
    if (measured[f] != 0) of_measured += face_area(mesh, f);
  }
  return area > 0 ? of_measured / area : 0;
}

/// The measured part without islands below an area, and what the surface is worth.
void finish(double least_island, SurfaceResult& result) {
  const auto find_measured = [&] {
    result.measured = measured_part(result.mesh, least_island);
    result.measured.hole.clear();  // it has none
  };
  const auto judge = [&] {
    result.report.measured_share = measured_share(result.mesh);
    note_quality(result);
  };
  parallel_for(2, [&](std::size_t part) { part == 0 ? find_measured() : judge(); });
}

/// Vertices with depth go out by the bows around, so that the faces between lie as much outside of
/// the surface as inside.
void lift_over_bows(std::span<const double> bows, std::span<const char> has_depth,
                    TriangleMesh& mesh) {
  const std::vector<Vec3> normals = vertex_normals(mesh);
  for (std::size_t v = 0; v < bows.size(); ++v) {
    if (has_depth[v] != 0) mesh.vertices[v] += bows[v] * normals[v];
  }
}

void take(ClosedSurface closed, SurfaceResult& result) {
  result.mesh = std::move(closed.mesh);
  result.report.depth = closed.depth;
}

}  // namespace

SurfaceResult reconstruct_surface(const Rig& rig, std::span<const MeasuredPoint> points,
                                  const SurfaceOptions& options, const Progress& progress) {
  PENCILSCAN_CHECK(options.max_depth >= 5 && options.max_depth <= 10);
  PENCILSCAN_CHECK(options.cell_spacings > 0 && options.sample_spacings > 0);
  const auto tell = [&](double fraction) {
    if (progress) progress("surface", fraction);
  };
  SurfaceResult result;
  SurfaceReport& report = result.report;
  result.used.assign(points.size(), 0);
  SampleSet set = sample_curves(rig, points, options.sample_spacings);
  report.spacing_mm = set.spacing;
  for (const std::int32_t s : set.sample_of_point) report.points += s >= 0 ? 1 : 0;
  if (report.points < points.size()) {
    report.warnings.push_back({WarningCode::kPointsLeftOut,
                               std::to_string(points.size() - report.points) +
                                   " points with non-finite or absurd coordinates are left out"});
  }

  std::vector<char> keep;
  std::vector<SurfaceSample> kept;
  if (set.samples.size() >= kLeastSamples) {
    keep = judge_samples(rig, options, set, report);
    for (std::size_t i = 0; i < keep.size(); ++i) {
      if (keep[i]) kept.push_back(set.samples[i]);
    }
  }
  if (kept.size() < kLeastSamples) {
    report.status = SurfaceStatus::kTooFewPoints;
    report.warnings.push_back({WarningCode::kTooFewPoints,
                               "too few points for a surface: " + std::to_string(report.points)});
    return result;
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::int32_t s = set.sample_of_point[i];
    result.used[i] = s >= 0 && keep[static_cast<std::size_t>(s)];
    report.points_used += static_cast<std::size_t>(result.used[i]);
  }
  tell(0.3);

  fit_local_surfaces(kept, kFitRadius * set.spacing);
  tell(0.4);
  take(closed_surface(kept, closing_of(options, set.spacing, rig)), result);
  finish(4 * set.spacing * set.spacing, result);
  tell(1);
  return result;
}

SurfaceResult close_depth(const Rig& rig, std::span<const DepthMap> maps,
                          const FusionOptions& options, std::span<const Silhouette> silhouettes) {
  PENCILSCAN_CHECK(options.max_depth >= 5 && options.max_depth <= 10);
  PENCILSCAN_CHECK(options.cell_spacings > 0 && options.fit_spacings > 0);
  SurfaceResult result;
  SurfaceReport& report = result.report;
  std::vector<SurfaceSample> samples = node_samples(rig, maps, report.spacing_mm);
  if (samples.size() < kLeastSamples) {
    report.status = SurfaceStatus::kTooFewPoints;
    report.warnings.push_back({WarningCode::kTooFewPoints,
                               "too few depths for a surface: " + std::to_string(samples.size())});
    return result;
  }
  fit_local_surfaces(samples, options.fit_spacings * report.spacing_mm);
  take(closed_surface(samples, closing_of(options, report.spacing_mm, rig)), result);
  const std::vector<Vec3> closed = result.mesh.vertices;
  carve(rig, silhouettes, options.carving, result.mesh);
  untangle(closed, result.mesh);
  result.samples = std::move(samples);
  return result;
}

void follow_depth(const Rig& rig, std::span<const DepthMap> maps, const FusionOptions& options,
                  SurfaceResult& result) {
  SurfaceReport& report = result.report;
  if (report.status == SurfaceStatus::kTooFewPoints || result.mesh.faces.empty()) return;
  std::vector<SurfaceSample> samples = std::exchange(result.samples, {});
  const std::size_t fitted = samples.size();
  add_node_samples(rig, maps, samples);
  fit_local_surfaces(samples, options.fit_spacings * report.spacing_mm, fitted);
  std::vector<Vec3> closed = result.mesh.vertices;
  FollowOptions once = options.follow;  // normals have settled on the coarse mesh
  once.rounds = 1;
  std::vector<char> has_depth = follow_nodes(rig, maps, options.follow, result.mesh);
  std::vector<double> bows = mean_bows(result.mesh);
  std::vector<std::array<int, 2>> middles;
  for (int i = 0; i < options.subdivisions; ++i) {
    result.mesh = subdivided(result.mesh, &middles);
    for (double& bow : bows) bow /= 4;  // sides half as long
    for (const auto& [first, second] : middles) {
      const auto a = static_cast<std::size_t>(first);
      const auto b = static_cast<std::size_t>(second);
      closed.push_back(0.5 * (closed[a] + closed[b]));
      bows.push_back(0.5 * (bows[a] + bows[b]));
    }
    has_depth = follow_nodes(rig, maps, once, result.mesh);
  }
  lift_over_bows(bows, has_depth, result.mesh);
  report.self_intersections = untangle(closed, result.mesh);
  result.evidence =
      attribute_vertices(samples, options.reach_spacings, report.spacing_mm, result.mesh, middles);
}

void note_points_used(const Rig& rig, std::span<const MeasuredPoint> points,
                      std::span<const DepthMap> maps, SurfaceResult& result) {
  SurfaceReport& report = result.report;
  report.points = points.size();
  result.used.assign(points.size(), 0);
  if (report.status == SurfaceStatus::kTooFewPoints) return;
  result.used = points_on_maps(rig, points, maps, report.spacing_mm);
  for (const char used : result.used) report.points_used += static_cast<std::size_t>(used);
}

void finish_surface(const FusionOptions& options, SurfaceResult& result) {
  if (result.report.status == SurfaceStatus::kTooFewPoints) return;
  const double spacing = result.report.spacing_mm;
  finish(options.least_island_spacings2 * spacing * spacing, result);
}

std::string to_string(SurfaceStatus status) {
  switch (status) {
    case SurfaceStatus::kDone:
      return "done";
    case SurfaceStatus::kTooFewPoints:
      return "too few points";
    case SurfaceStatus::kNotClosed:
      return "not closed";
  }
  return "unknown";
}

}  // namespace pencilscan
