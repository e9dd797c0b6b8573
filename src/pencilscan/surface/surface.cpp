#include "pencilscan/surface/surface.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/core/check.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/surface/filter.h"
#include "pencilscan/surface/local_fit.h"
#include "pencilscan/surface/mesh_parts.h"
#include "pencilscan/surface/poisson.h"
#include "pencilscan/surface/sample.h"

namespace pencilscan {
namespace {

constexpr std::size_t kLeastSamples = 30;  // fewer give no surface worth the name
constexpr double kFitRadius = 1.6;         // spacings, neighbourhood of a local surface
constexpr double kClusterGap = 2;          // spacings; one missing line does not split an object
constexpr double kLeastCluster = 0.01;     // of the largest cluster's samples
constexpr std::size_t kChunk = 256;

std::vector<Vec3> positions_of(std::span<const CurveSample> samples) {
  std::vector<Vec3> positions;
  positions.reserve(samples.size());
  for (const CurveSample& s : samples) positions.push_back(s.position);
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
        "hardly any point is supported by another curve: all points are used");
    keep.assign(keep.size(), 1);
    return keep;
  }
  drop_small_clusters(set.samples, kClusterGap * set.spacing, kLeastCluster, keep);
  return keep;
}

int octree_depth(const SurfaceOptions& options, std::span<const CurveSample> samples,
                 double spacing, double scale) {
  Vec3 low = samples[0].position;
  Vec3 high = low;
  for (const CurveSample& s : samples) {
    low = low.cwiseMin(s.position);
    high = high.cwiseMax(s.position);
  }
  const double extent = scale * (high - low).maxCoeff();
  const double cells = extent / (options.cell_spacings * spacing);
  return std::clamp(static_cast<int>(std::ceil(std::log2(std::max(cells, 1.0)) - 0.25)), 5,
                    options.max_depth);
}

/// Declares invented those fringe vertices that connect to an invented one through the fringe. Gaps
/// between lines have a fringe too, but nothing invented inside: they stay measured.
void cut_fringe(std::span<const char> fringe, TriangleMesh& mesh) {
  std::vector<std::vector<int>> neighbors(mesh.vertices.size());
  for (const auto& face : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      neighbors[static_cast<std::size_t>(face[k])].push_back(face[(k + 1) % 3]);
    }
  }
  std::vector<std::size_t> open;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (!(mesh.confidence[v] > 0)) open.push_back(v);
  }
  while (!open.empty()) {
    const std::size_t v = open.back();
    open.pop_back();
    for (const int next : neighbors[v]) {
      const auto n = static_cast<std::size_t>(next);
      if (!fringe[n] || !(mesh.confidence[n] > 0)) continue;
      mesh.confidence[n] = 0;
      open.push_back(n);
    }
  }
}

/// Sets sigma and confidence of every vertex from the samples near it. A vertex is measured when a
/// sample of its own side lies within the reach, which grows where the sheets graze the surface,
/// and samples surround it; beyond the last line only a part of the reach counts.
void attribute_vertices(std::span<const CurveSample> samples, const SurfaceOptions& options,
                        double spacing, TriangleMesh& mesh) {
  constexpr double kMaxStretch = 2.5;      // of the spacing on a grazed surface
  constexpr double kInterpolation = 0.02;  // mm of error per mm away from the nearest sample
  constexpr double kOutsideReach = 0.4;    // of the reach, beyond the last line
  const double radius = options.reach_spacings * kMaxStretch * spacing;
  const PointGrid grid(positions_of(samples), radius);
  const std::vector<Vec3> normals = vertex_normals(mesh);
  std::vector<char> fringe(mesh.vertices.size(), 0);
  mesh.sigma.assign(mesh.vertices.size(), 0.0F);
  mesh.confidence.assign(mesh.vertices.size(), 0.0F);
  const std::size_t chunks = (mesh.vertices.size() + kChunk - 1) / kChunk;
  parallel_for(chunks, [&](std::size_t chunk) {
    const std::size_t end = std::min(mesh.vertices.size(), (chunk + 1) * kChunk);
    for (std::size_t v = chunk * kChunk; v < end; ++v) {
      double nearest = radius;  // mm, to any sample of this side
      double best = 1;          // distance / reach of the best sample
      double weight_sum = 0;
      double variance_sum = 0;
      double confidence_sum = 0;
      Vec3 pull =
          Vec3::Zero();  // sum of the offsets: cancels out where samples surround the vertex
      double pull_length = 0;
      std::array<bool, 256> seen{};
      int cameras = 0;
      grid.for_each_within(mesh.vertices[v], radius, [&](std::size_t i, double d2) {
        const CurveSample& s = samples[i];
        const Vec3 d = s.position - mesh.vertices[v];
        if (s.normal.dot(normals[v]) < 0.5) return;
        if (std::abs(d.dot(normals[v])) > 0.5 * spacing) return;
        const double distance = std::sqrt(d2);
        nearest = std::min(nearest, distance);
        const double tilt = s.sheet_normal.dot(s.normal);
        const double stretch = 1 / std::sqrt(std::max(1 - tilt * tilt, 1e-6));
        const double reach = options.reach_spacings * s.spacing * std::min(stretch, kMaxStretch);
        if (distance > reach) return;
        best = std::min(best, distance / reach);
        pull += d;
        pull_length += distance;
        const double across = s.sigma * std::max(std::abs(s.to_camera.dot(s.normal)), 0.2);
        const double w = std::exp(-2 * d2 / (spacing * spacing));
        weight_sum += w;
        variance_sum += w * (across * across + s.residual * s.residual);
        confidence_sum += w * s.confidence;
        if (!seen[s.camera]) ++cameras;
        seen[s.camera] = true;
      });
      double variance = kInterpolation * kInterpolation * nearest * nearest;
      // Samples that fill a half plane pull with 2 / pi of their summed distance.
      fringe[v] = pull.norm() > 0.55 * pull_length && best > kOutsideReach;
      if (weight_sum > 0) {
        // Samples of one camera share their errors; cameras are independent.
        variance += variance_sum / weight_sum / std::max(cameras, 1);
        const double certainty = confidence_sum / weight_sum * (1 - 0.5 * best * best);
        mesh.confidence[v] = static_cast<float>(std::clamp(certainty, 0.01, 1.0));
      } else {
        variance = nearest * nearest;  // a guess: at least as far off as the nearest sample is away
      }
      mesh.sigma[v] = static_cast<float>(std::sqrt(variance));
    }
  });
  cut_fringe(fringe, mesh);
}

std::vector<char> measured_faces(const TriangleMesh& mesh) {
  std::vector<char> keep(mesh.faces.size(), 1);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (const int v : mesh.faces[f]) {
      if (!(mesh.confidence[static_cast<std::size_t>(v)] > 0)) keep[f] = 0;
    }
  }
  return keep;
}

/// Keeps the component with the largest measured area and those with a fair share of it.
TriangleMesh without_floaters(const TriangleMesh& mesh, double min_share, std::size_t& removed) {
  const std::vector<int> component = face_components(mesh);
  const std::vector<char> measured = measured_faces(mesh);
  std::vector<double> area;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto c = static_cast<std::size_t>(component[f]);
    if (c >= area.size()) area.resize(c + 1, 0.0);
    if (measured[f]) area[c] += face_area(mesh, f);
  }
  if (area.size() <= 1) return mesh;
  const auto largest = std::max_element(area.begin(), area.end());
  std::vector<char> keep_component(area.size());
  for (std::size_t c = 0; c < area.size(); ++c) {
    keep_component[c] = c == static_cast<std::size_t>(largest - area.begin()) ||
                        (area[c] > 0 && area[c] >= min_share * *largest);
    removed += keep_component[c] ? 0 : 1;
  }
  std::vector<char> keep(mesh.faces.size());
  for (std::size_t f = 0; f < keep.size(); ++f) {
    keep[f] = keep_component[static_cast<std::size_t>(component[f])];
  }
  return submesh(mesh, keep);
}

/// Drops islands of measured faces smaller than a square of two spacings.
TriangleMesh measured_part(const TriangleMesh& mesh, double spacing) {
  TriangleMesh part = submesh(mesh, measured_faces(mesh));
  const std::vector<int> component = face_components(part);
  std::vector<double> area;
  for (std::size_t f = 0; f < part.faces.size(); ++f) {
    const auto c = static_cast<std::size_t>(component[f]);
    if (c >= area.size()) area.resize(c + 1, 0.0);
    area[c] += face_area(part, f);
  }
  std::vector<char> keep(part.faces.size());
  for (std::size_t f = 0; f < keep.size(); ++f) {
    keep[f] = area[static_cast<std::size_t>(component[f])] >= 4 * spacing * spacing;
  }
  return submesh(part, keep);
}

/// Poisson in a growing cube until the surface closes inside it.
TriangleMesh closed_surface(std::span<const CurveSample> samples, const SurfaceOptions& options,
                            double spacing, SurfaceReport& report) {
  constexpr int kProbeDepth = 6;  // half a second, against several at the full depth
  TriangleMesh mesh;
  for (const double scale : {1.5, 2.0, 3.0}) {
    report.scale = scale;
    report.depth = octree_depth(options, samples, spacing, scale);
    if (report.depth > kProbeDepth && scale < 3) {
      const EdgeCounts probe = count_edges(poisson_surface(samples, kProbeDepth, scale));
      if (probe.boundary > 0) continue;  // a coarse surface leaves the cube where a fine one does
    }
    mesh = poisson_surface(samples, report.depth, scale);
    if (mesh.faces.empty()) continue;
    attribute_vertices(samples, options, spacing, mesh);
    report.components_removed = 0;
    mesh = without_floaters(mesh, options.min_component_share, report.components_removed);
    report.edges = count_edges(mesh);
    if (report.edges.boundary == 0 && report.edges.non_manifold == 0) break;
  }
  return mesh;
}

}  // namespace

SurfaceResult reconstruct_surface(const Rig& rig, std::span<const MeasuredPoint> points,
                                  const SurfaceOptions& options, const Progress& progress) {
  PENCILSCAN_CHECK(options.max_depth >= 5 && options.max_depth <= 10);
  PENCILSCAN_CHECK(options.cell_spacings > 0 && options.sample_spacings > 0);
  const auto tell = [&](double fraction) {
    if (progress) progress("surface", fraction);
  };
  const Stopwatch watch;
  SurfaceResult result;
  SurfaceReport& report = result.report;
  result.used.assign(points.size(), 0);
  SampleSet set = sample_curves(rig, points, options.sample_spacings);
  report.spacing_mm = set.spacing;
  report.samples = set.samples.size();
  for (const std::int32_t s : set.sample_of_point) report.points += s >= 0 ? 1 : 0;
  if (report.points < points.size()) {
    report.warnings.push_back(std::to_string(points.size() - report.points) +
                              " points with non-finite or absurd coordinates are left out");
  }

  std::vector<char> keep;
  std::vector<CurveSample> kept;
  if (set.samples.size() >= kLeastSamples) {
    keep = judge_samples(rig, options, set, report);
    for (std::size_t i = 0; i < keep.size(); ++i) {
      if (keep[i]) kept.push_back(set.samples[i]);
    }
  }
  report.samples_used = kept.size();
  report.seconds_filter = watch.seconds();
  if (kept.size() < kLeastSamples) {
    report.status = SurfaceStatus::kTooFewPoints;
    report.warnings.push_back("too few points for a surface: " + std::to_string(report.points));
    report.seconds = watch.seconds();
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
  const Stopwatch poisson_watch;
  result.mesh = closed_surface(kept, options, set.spacing, report);
  report.seconds_poisson = poisson_watch.seconds();
  result.measured = measured_part(result.mesh, set.spacing);
  report.vertices = result.mesh.vertices.size();
  report.faces = result.mesh.faces.size();
  const double area = surface_area(result.mesh);
  report.measured_share = area > 0 ? surface_area(result.measured) / area : 0;
  if (result.mesh.faces.empty() || report.edges.boundary > 0 || report.edges.non_manifold > 0) {
    report.status = SurfaceStatus::kNotClosed;
    report.warnings.push_back(
        "the surface is not closed: " + std::to_string(report.edges.boundary) + " boundary and " +
        std::to_string(report.edges.non_manifold) + " non-manifold edges");
  }
  if (report.measured_share < 0.5) {
    report.warnings.push_back("less than half of the closed surface was measured");
  }
  report.seconds = watch.seconds();
  tell(1);
  return result;
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
