#include "pencilscan/surface/holes.h"

#include <algorithm>
#include <bitset>

#include "pencilscan/core/chunks.h"
#include "pencilscan/depth/pattern_view.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/surface/mesh_parts.h"
#include "pencilscan/surface/sight.h"

namespace pencilscan {
namespace {

using LitProjectors = std::bitset<256>;  // a rig has no more: rig_reading.cpp

/// What a camera could have measured at a place of the closed mesh.
class Visibility {
 public:
  Visibility(const Rig& rig, const RayScene& surface, const HoleOptions& options)
      : rig_(rig), scene_(surface), options_(options) {
    for (const Camera& camera : rig.cameras) {
      std::vector<PatternView> views;
      for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
        for (std::size_t k = 0; k < rig.projectors[p].patterns.size(); ++k)
          views.emplace_back(rig, camera, static_cast<int>(p), static_cast<int>(k));
      }
      views_.push_back(std::move(views));
    }
  }

  [[nodiscard]] const RayScene& scene() const { return scene_; }

  /// Bit per projector that lights the place.
  [[nodiscard]] LitProjectors lighting(const Vec3& x, const Vec3& normal) const {
    LitProjectors lit;
    for (std::size_t p = 0; p < rig_.projectors.size(); ++p) {
      const auto pixel = rig_.projectors[p].project(x);
      if (!pixel || !rig_.projectors[p].contains(*pixel)) continue;
      if (sees(scene_, rig_.projectors[p].center(), x, normal, options_.least_cosine)) lit.set(p);
    }
    return lit;
  }

  /// Reason from geometry alone for a place that camera c sees.
  [[nodiscard]] HoleReason reason(std::size_t c, const Vec3& x, const Vec3& normal,
                                  const LitProjectors& lit) const {
    if (lit.none()) return HoleReason::kNoProjector;
    const Camera& camera = rig_.cameras[c];
    if ((camera.center() - x).normalized().dot(normal) < options_.least_cosine)
      return HoleReason::kTooCompressed;
    const TangentView at(camera, x, normal);
    LitProjectors resolved;
    for (const PatternView& view : views_[c]) {
      if (!lit[static_cast<std::size_t>(view.projector())]) continue;
      bool ok = false;
      const WindowLines lines = view.lines(at.normalized, at.jacobian, at.w, ok);
      if (!ok) continue;
      const auto gradient = lines.gradient(static_cast<float>(at.w), at.slope[0], at.slope[1]);
      if (static_cast<double>(gradient.norm()) * options_.least_spacing_px < 1)
        resolved.set(static_cast<std::size_t>(view.projector()));
    }
    if (resolved.none()) return HoleReason::kTooCompressed;
    return resolved.count() == 1 ? HoleReason::kOneProjector : HoleReason::kAmbiguous;
  }

 private:
  const Rig& rig_;
  const RayScene& scene_;
  HoleOptions options_;
  std::vector<std::vector<PatternView>> views_;  ///< per camera
};

bool found_by_depth(HoleReason reason) {
  return reason == HoleReason::kContradicted || reason == HoleReason::kSaturated;
}

void explain_nodes(const Rig& rig, const Visibility& visibility,
                   const std::vector<Vec3>& face_normals, DepthMap& map) {
  const auto c = static_cast<std::size_t>(map.camera);
  parallel_chunks(map.nodes.size(), [&](std::size_t i) {
    DepthNode& node = map.nodes[i];
    if (node.measured() || found_by_depth(node.reason)) return;
    const auto hit = visibility.scene().first_hit(rig.cameras[c].ray(map.pixel(i)));
    if (!hit) {
      node.reason = HoleReason::kBackground;
      return;
    }
    const Vec3& normal = face_normals[hit->face];
    const LitProjectors lit = visibility.lighting(hit->point, normal);
    if (node.reason == HoleReason::kOneProjector && lit.any()) return;  // the depth stage knows
    node.reason = visibility.reason(c, hit->point, normal, lit);
  });
}

/// Later is more hopeful.
int rank(HoleReason reason) {
  switch (reason) {
    case HoleReason::kNoProjector:
      return 1;
    case HoleReason::kTooCompressed:
      return 2;
    case HoleReason::kOneProjector:
      return 3;
    case HoleReason::kAmbiguous:
      return 4;
    case HoleReason::kSaturated:
      return 5;
    case HoleReason::kContradicted:
      return 6;
    default:
      return 0;
  }
}

HoleReason explain_vertex(const Rig& rig, const Visibility& visibility,
                          std::span<const DepthMap> maps, const Vec3& x, const Vec3& normal) {
  HoleReason best = HoleReason::kNotSeen;
  const LitProjectors lit = visibility.lighting(x, normal);
  for (const DepthMap& map : maps) {
    const auto c = static_cast<std::size_t>(map.camera);
    const auto pixel = rig.cameras[c].project(x);
    if (!pixel || !rig.cameras[c].contains(*pixel)) continue;
    if (!sees(visibility.scene(), rig.cameras[c].center(), x, normal, kLeastSightCosine)) continue;
    HoleReason reason = visibility.reason(c, x, normal, lit);
    const int column = static_cast<int>(std::lround((*pixel)[0] / map.stride));
    const int row = static_cast<int>(std::lround((*pixel)[1] / map.stride));
    if (row >= 0 && column >= 0 && row < map.rows && column < map.columns) {
      const HoleReason known = map.nodes[map.index(row, column)].reason;
      if (found_by_depth(known)) reason = known;
    }
    if (rank(reason) > rank(best)) best = reason;
  }
  return best;
}

/// A face belongs to the reason of its first invented vertex.
void sum_areas(const TriangleMesh& mesh, HoleReport& report) {
  report.area_mm2.fill(0);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    HoleReason reason = HoleReason::kMeasured;
    for (const int v : mesh.faces[f]) {
      const HoleReason of_vertex = report.vertices[static_cast<std::size_t>(v)];
      if (reason == HoleReason::kMeasured) reason = of_vertex;
    }
    report.area_mm2[static_cast<std::size_t>(reason)] += face_area(mesh, f);
  }
}

}  // namespace

HoleReport explain_holes(const Rig& rig, const RayScene& surface, std::span<DepthMap> maps,
                         const HoleOptions& options) {
  HoleReport report;
  report.nodes.resize(maps.size());
  const TriangleMesh& mesh = surface.mesh();
  if (mesh.faces.empty()) return report;
  const Visibility visibility(rig, surface, options);
  std::vector<Vec3> face_normals(mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) face_normals[f] = face_normal(mesh, f);
  for (std::size_t m = 0; m < maps.size(); ++m) {
    explain_nodes(rig, visibility, face_normals, maps[m]);
    for (const DepthNode& node : maps[m].nodes)
      ++report.nodes[m][static_cast<std::size_t>(node.reason)];
  }
  const std::vector<Vec3> normals = vertex_normals(mesh);
  report.vertices.assign(mesh.vertices.size(), HoleReason::kMeasured);
  parallel_chunks(mesh.vertices.size(), [&](std::size_t v) {
    if (mesh.confidence.empty() || mesh.confidence[v] > 0) return;
    report.vertices[v] = explain_vertex(rig, visibility, maps, mesh.vertices[v], normals[v]);
  });
  sum_areas(mesh, report);
  return report;
}

void give_reason(const TriangleMesh& mesh, std::span<const char> which, HoleReason reason,
                 HoleReport& report) {
  for (std::size_t v = 0; v < which.size(); ++v)
    if (which[v] != 0) report.vertices[v] = reason;
  sum_areas(mesh, report);
}

const char* to_string(HoleReason reason) {
  switch (reason) {
    case HoleReason::kBackground:
      return "background";
    case HoleReason::kMeasured:
      return "measured";
    case HoleReason::kNoProjector:
      return "no_projector";
    case HoleReason::kOneProjector:
      return "one_projector";
    case HoleReason::kTooCompressed:
      return "too_compressed";
    case HoleReason::kAmbiguous:
      return "ambiguous";
    case HoleReason::kContradicted:
      return "contradicted";
    case HoleReason::kSaturated:
      return "saturated";
    case HoleReason::kNotSeen:
      return "not_seen";
  }
  return "unknown";
}

}  // namespace pencilscan
