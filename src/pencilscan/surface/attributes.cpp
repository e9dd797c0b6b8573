#include "pencilscan/surface/attributes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/core/chunks.h"
#include "pencilscan/depth/dense_depth.h"
#include "pencilscan/surface/mesh_parts.h"
#include "pencilscan/surface/point_grid.h"

namespace pencilscan {
namespace {

/// Declares invented those fringe vertices that connect to an invented one through the fringe. Gaps
/// between lines have a fringe too, but nothing invented inside: they stay measured.
void cut_fringe(std::span<const char> fringe, TriangleMesh& mesh) {
  // Ways into the fringe, by where they begin: few vertices have any.
  std::vector<std::array<int, 2>> ways;
  for (const auto& face : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto to = static_cast<std::size_t>(face[(k + 1) % 3]);
      if (fringe[to] && mesh.confidence[to] > 0) ways.push_back({face[k], face[(k + 1) % 3]});
    }
  }
  std::sort(ways.begin(), ways.end());
  std::vector<std::size_t> open;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (!(mesh.confidence[v] > 0)) open.push_back(v);
  }
  while (!open.empty()) {
    const std::size_t v = open.back();
    open.pop_back();
    const auto from = static_cast<int>(v);
    for (auto way = std::lower_bound(ways.begin(), ways.end(), std::array{from, -1});
         way != ways.end() && (*way)[0] == from; ++way) {
      const auto n = static_cast<std::size_t>((*way)[1]);
      if (!(mesh.confidence[n] > 0)) continue;
      mesh.confidence[n] = 0;
      open.push_back(n);
    }
  }
}

/// Weighted sums over the samples on a vertex's side that reach it.
struct Surroundings {
  double nearest = 0;  ///< mm, to any sample of this side
  double best = 1;     ///< distance / reach of the best sample
  double weight = 0;
  double information = 0;
  double confidence = 0;
  double bend = 0;
  double scatter2 = 0;
  Vec3 pull = Vec3::Zero();  ///< sum of the offsets: cancels out where samples surround the vertex
  double pull_length = 0;
  std::array<bool, 256> seen{};  ///< by which cameras
  int cameras = 0;
  double faced = -1;  ///< greatest cosine of the vertex's normal to a camera that sees it
};

SurfaceEvidence evidence_of(const Surroundings& a) {
  SurfaceEvidence evidence;
  evidence.predicted = static_cast<float>(std::sqrt(a.weight / a.information));
  evidence.scatter = static_cast<float>(std::sqrt(a.scatter2 / a.weight));
  evidence.bend = static_cast<float>(a.bend / a.weight);
  if (a.pull_length > 0) evidence.one_sidedness = static_cast<float>(a.pull.norm() / a.pull_length);
  evidence.cameras = static_cast<float>(a.cameras);
  return evidence;
}

SurfaceEvidence mean(const SurfaceEvidence& a, const SurfaceEvidence& b) {
  SurfaceEvidence evidence;
  evidence.predicted = 0.5F * (a.predicted + b.predicted);
  evidence.scatter = 0.5F * (a.scatter + b.scatter);
  evidence.bend = 0.5F * (a.bend + b.bend);
  evidence.one_sidedness = 0.5F * (a.one_sidedness + b.one_sidedness);
  evidence.cameras = 0.5F * (a.cameras + b.cameras);
  return evidence;
}

constexpr double kOutsideReach = 0.4;  ///< of the reach, beyond the last line

/// Samples around the vertices of a mesh.
class SamplesAround {
 public:
  SamplesAround(std::span<const SurfaceSample> samples, double reach_spacings, double spacing,
                const TriangleMesh& mesh)
      : samples_(samples),
        mesh_(mesh),
        normals_(vertex_normals(mesh)),
        spacing_(spacing),
        reach_(reach_of(samples, reach_spacings)),
        radius_(reach_spacings * kMaxStretch * spacing),
        near_radius_(std::min(
            radius_, samples.empty() ? radius_ : *std::max_element(reach_.begin(), reach_.end()))),
        weighty_radius_(
            std::min(std::max(kOutsideReach * near_radius_, 2 * spacing), near_radius_)),
        grid_(positions_of(samples), weighty_radius_) {}

  /// Farther samples weigh nothing to speak of, and matter only where none lies well within its
  /// reach.
  [[nodiscard]] Surroundings of(std::size_t v) const {
    Surroundings a = within(weighty_radius_, v);
    if (a.best > kOutsideReach) a = within(near_radius_, v);
    if (a.nearest == radius_) a = within(radius_, v);
    return a;
  }

 private:
  static constexpr double kMaxStretch = 2.5;  ///< of the spacing on a grazed surface

  static std::vector<double> reach_of(std::span<const SurfaceSample> samples,
                                      double reach_spacings) {
    std::vector<double> reach;
    reach.reserve(samples.size());
    for (const SurfaceSample& s : samples) {
      const double tilt = s.sheet_normal.dot(s.normal);
      const double stretch = 1 / std::sqrt(std::max(1 - tilt * tilt, 1e-6));
      reach.push_back(reach_spacings * s.spacing * std::min(stretch, kMaxStretch));
    }
    return reach;
  }
  static std::vector<Vec3> positions_of(std::span<const SurfaceSample> samples) {
    std::vector<Vec3> positions;
    positions.reserve(samples.size());
    for (const SurfaceSample& s : samples) positions.push_back(s.position);
    return positions;
  }

  [[nodiscard]] Surroundings within(double distance, std::size_t v) const {
    Surroundings a;
    a.nearest = radius_;
    grid_.for_each_within(mesh_.vertices[v], distance,
                          [&](std::size_t i, double d2) { add(i, d2, v, a); });
    return a;
  }

  void add(std::size_t i, double d2, std::size_t v, Surroundings& a) const {
    const SurfaceSample& s = samples_[i];
    const Vec3& normal = normals_[v];
    const Vec3 d = s.position - mesh_.vertices[v];
    const double cosine = s.normal.dot(normal);
    if (cosine < 0.5 || std::abs(d.dot(normal)) > 0.5 * spacing_) return;
    a.faced = std::max(a.faced, s.to_camera.dot(normal));
    const double distance = std::sqrt(d2);
    a.nearest = std::min(a.nearest, distance);
    if (distance > reach_[i]) return;
    a.best = std::min(a.best, distance / reach_[i]);
    a.pull += d;
    a.pull_length += distance;
    const double across = s.sigma * std::max(std::abs(s.to_camera.dot(s.normal)), 0.2);
    const double w = std::exp(-2 * d2 / (spacing_ * spacing_));
    a.weight += w;
    a.information += w / std::max(across * across, 1e-9);
    a.confidence += w * s.confidence;
    // 2 (1 - cos) is the angle squared. Of a quadric the chord is square to the mean normal.
    a.bend += w * 2 * (1 - cosine) * s.spacing;
    const double off = 0.5 * d.dot(s.normal + normal);
    a.scatter2 += w * off * off;
    if (!a.seen[s.camera]) ++a.cameras;
    a.seen[s.camera] = true;
  }

  std::span<const SurfaceSample> samples_;
  const TriangleMesh& mesh_;
  std::vector<Vec3> normals_;
  double spacing_;
  std::vector<double> reach_;  ///< per sample, mm
  double radius_;              ///< mm: as far as any sample may reach
  double near_radius_;         ///< as far as one of these does
  double weighty_radius_;
  PointGrid grid_;
};

}  // namespace

std::vector<SurfaceEvidence> attribute_vertices(std::span<const SurfaceSample> samples,
                                                double reach_spacings, double spacing,
                                                TriangleMesh& mesh,
                                                std::span<const std::array<int, 2>> middles) {
  // What turns away farther from all cameras around was only continued from beside it.
  const double least_faced = DepthOptions{}.min_cosine;
  const SamplesAround around(samples, reach_spacings, spacing, mesh);
  std::vector<char> fringe(mesh.vertices.size(), 0);
  mesh.sigma.assign(mesh.vertices.size(), 0.0F);
  mesh.confidence.assign(mesh.vertices.size(), 0.0F);
  std::vector<SurfaceEvidence> evidence(mesh.vertices.size());
  const auto look = [&](std::size_t v) {
    const Surroundings a = around.of(v);
    // Samples that fill a half plane pull with 2 / pi of their summed distance.
    fringe[v] = a.pull.norm() > 0.55 * a.pull_length && a.best > kOutsideReach;
    double sigma = a.nearest;  // a guess where no sample reaches: at least so far off
    if (a.weight > 0 && a.faced >= least_faced) {
      evidence[v] = evidence_of(a);
      sigma = surface_sigma(evidence[v]);
      const double certainty = a.confidence / a.weight * (1 - 0.5 * a.best * a.best);
      mesh.confidence[v] = static_cast<float>(std::clamp(certainty, 0.01, 1.0));
    }
    mesh.sigma[v] = static_cast<float>(sigma);
  };
  const std::size_t own = mesh.vertices.size() - middles.size();
  parallel_chunks(own, look);
  parallel_chunks(middles.size(), [&](std::size_t k) {
    const auto a = static_cast<std::size_t>(middles[k][0]);
    const auto b = static_cast<std::size_t>(middles[k][1]);
    const std::size_t v = own + k;
    const auto is_surrounded = [&](std::size_t end) {
      return mesh.confidence[end] > 0 && !fringe[end];
    };
    if (!is_surrounded(a) || !is_surrounded(b)) return look(v);
    evidence[v] = mean(evidence[a], evidence[b]);
    mesh.sigma[v] = static_cast<float>(surface_sigma(evidence[v]));
    mesh.confidence[v] = 0.5F * (mesh.confidence[a] + mesh.confidence[b]);
  });
  cut_fringe(fringe, mesh);
  return evidence;
}

std::vector<char> measured_faces(const TriangleMesh& mesh) {
  std::vector<char> keep(mesh.faces.size());
  for (std::size_t f = 0; f < keep.size(); ++f) keep[f] = is_measured(mesh, f) ? 1 : 0;
  return keep;
}

TriangleMesh measured_part(const TriangleMesh& mesh, double min_area_mm2) {
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
    keep[f] = area[static_cast<std::size_t>(component[f])] >= min_area_mm2;
  }
  return submesh(part, keep);
}

}  // namespace pencilscan
