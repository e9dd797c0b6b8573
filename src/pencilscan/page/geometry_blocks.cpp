#include "pencilscan/page/geometry_blocks.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "pencilscan/core/parallel.h"
#include "pencilscan/io/little_endian.h"
#include "pencilscan/io/srgb.h"

namespace pencilscan {
namespace {

constexpr float kNoDistance = std::numeric_limits<float>::quiet_NaN();

/// 0..1 in 255 steps.
std::uint8_t share_byte(float share) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(share, 0.0F, 1.0F)));
}

/// One array of floats from a member or a function of the items.
template <class Items, class Get>
std::vector<float> column(const Items& items, Get get) {
  std::vector<float> values;
  values.reserve(items.size());
  for (const auto& item : items) values.push_back(get(item));
  return values;
}

template <class T, class Items, class Get>
std::vector<T> integers(const Items& items, Get get) {
  std::vector<T> values;
  values.reserve(items.size());
  for (const auto& item : items) values.push_back(static_cast<T>(get(item)));
  return values;
}

}  // namespace

PointErrors point_errors(const Rig& rig, std::span<const MeasuredPoint> points,
                         const RayScene& truth) {
  PointErrors errors;
  errors.distance_mm.assign(points.size(), kNoDistance);
  errors.along_ray_mm.assign(points.size(), kNoDistance);
  parallel_for(points.size(), [&](std::size_t i) {
    const MeasuredPoint& p = points[i];
    const Vec3 x(p.x, p.y, p.z);
    if (const auto closest = truth.closest_point(x))
      errors.distance_mm[i] = static_cast<float>(closest->distance);
    if (p.camera >= rig.cameras.size()) return;
    const Ray ray = rig.cameras[p.camera].ray({p.u, p.v});
    if (const auto hit = truth.first_hit(ray)) {
      errors.along_ray_mm[i] =
          static_cast<float>(std::abs((x - ray.origin).dot(ray.direction) - hit->distance));
    }
  });
  return errors;
}

Block points_block(std::span<const MeasuredPoint> all, std::span<const float> distance_mm,
                   std::size_t stride) {
  std::vector<MeasuredPoint> points;
  std::vector<float> distances;
  for (std::size_t i = 0; i < all.size(); i += stride) {
    points.push_back(all[i]);
    if (!distance_mm.empty()) distances.push_back(distance_mm[i]);
  }
  using P = MeasuredPoint;
  Block block;
  block.put("stride", stride);
  block.put("total", all.size());
  block.add_floats("x", column(points, [](const P& p) { return p.x; }));
  block.add_floats("y", column(points, [](const P& p) { return p.y; }));
  block.add_floats("z", column(points, [](const P& p) { return p.z; }));
  block.add_floats("u", column(points, [](const P& p) { return p.u; }));
  block.add_floats("v", column(points, [](const P& p) { return p.v; }));
  block.add_bytes("camera", integers<std::uint8_t>(points, [](const P& p) { return p.camera; }));
  block.add_bytes("projector",
                  integers<std::uint8_t>(points, [](const P& p) { return p.projector; }));
  block.add_bytes("pattern", integers<std::uint8_t>(points, [](const P& p) { return p.pattern; }));
  block.add_integers("line", integers<std::uint16_t>(points, [](const P& p) { return p.line; }));
  block.add_floats("sigma", column(points, [](const P& p) { return p.sigma; }),
                   Steps::kLogarithmic);
  block.add_bytes("confidence", integers<std::uint8_t>(
                                    points, [](const P& p) { return share_byte(p.confidence); }));
  if (!distances.empty()) block.add_floats("distance", distances, Steps::kLogarithmic);
  return block;
}

TriangleMesh decimated(const TriangleMesh& mesh, std::size_t max_faces) {
  if (mesh.faces.size() <= max_faces) return mesh;
  std::vector<float> positions;
  positions.reserve(3 * mesh.vertices.size());
  for (const Vec3& v : mesh.vertices) {
    for (Eigen::Index k = 0; k < 3; ++k) positions.push_back(static_cast<float>(v[k]));
  }
  std::vector<unsigned int> indices;
  indices.reserve(3 * mesh.faces.size());
  for (const auto& face : mesh.faces) {
    for (const int vertex : face) indices.push_back(static_cast<unsigned int>(vertex));
  }
  constexpr float kAnyError = 1;         // the number of faces decides
  constexpr std::size_t kManyTimes = 5;  // so many faces per face wanted show no cluster any more
  if (mesh.faces.size() > 2 * kManyTimes * max_faces) {
    std::vector<unsigned int> clustered(indices.size());
    clustered.resize(meshopt_simplifySloppy(
        clustered.data(), indices.data(), indices.size(), positions.data(), mesh.vertices.size(),
        3 * sizeof(float), 3 * kManyTimes * max_faces, kAnyError));
    indices = std::move(clustered);
  }
  const std::size_t left =
      meshopt_simplify(indices.data(), indices.data(), indices.size(), positions.data(),
                       mesh.vertices.size(), 3 * sizeof(float), 3 * max_faces, kAnyError);
  indices.resize(left);
  meshopt_optimizeVertexCache(indices.data(), indices.data(), left, mesh.vertices.size());
  std::vector<unsigned int> remap(mesh.vertices.size());
  const std::size_t vertices =
      meshopt_optimizeVertexFetchRemap(remap.data(), indices.data(), left, mesh.vertices.size());
  TriangleMesh result;
  result.vertices.resize(vertices);
  if (!mesh.sigma.empty()) result.sigma.resize(vertices);
  if (!mesh.confidence.empty()) result.confidence.resize(vertices);
  if (!mesh.color.empty()) result.color.resize(vertices);
  if (!mesh.hole.empty()) result.hole.resize(vertices);
  for (std::size_t i = 0; i < remap.size(); ++i) {
    const std::size_t to = remap[i];
    if (to >= vertices) continue;  // not used by any face
    result.vertices[to] = mesh.vertices[i];
    if (!mesh.sigma.empty()) result.sigma[to] = mesh.sigma[i];
    if (!mesh.confidence.empty()) result.confidence[to] = mesh.confidence[i];
    if (!mesh.color.empty()) result.color[to] = mesh.color[i];
    if (!mesh.hole.empty()) result.hole[to] = mesh.hole[i];
  }
  for (std::size_t i = 0; i + 2 < left; i += 3) {
    result.faces.push_back({static_cast<int>(remap[indices[i]]),
                            static_cast<int>(remap[indices[i + 1]]),
                            static_cast<int>(remap[indices[i + 2]])});
  }
  return result;
}

std::vector<float> vertex_distances(const TriangleMesh& mesh, const RayScene& truth) {
  std::vector<float> distances(mesh.vertices.size(), kNoDistance);
  parallel_for(distances.size(), [&](std::size_t i) {
    if (const auto closest = truth.closest_point(mesh.vertices[i]))
      distances[i] = static_cast<float>(closest->distance);
  });
  return distances;
}

Block mesh_block(const TriangleMesh& mesh, std::span<const float> distance_mm,
                 MeshPrecision precision) {
  const bool fine = precision == MeshPrecision::kFine;
  const int place_bits = fine ? 16 : 12;  // of 300 mm: 0.005 mm or 0.07 mm
  const int value_bits = fine ? 16 : 8;
  Block block;
  const auto coordinate = [&](Eigen::Index k) {
    return column(mesh.vertices, [k](const Vec3& v) { return static_cast<float>(v[k]); });
  };
  block.add_floats("x", coordinate(0), Steps::kLinear, place_bits);
  block.add_floats("y", coordinate(1), Steps::kLinear, place_bits);
  block.add_floats("z", coordinate(2), Steps::kLinear, place_bits);
  std::vector<std::uint32_t> indices;
  indices.reserve(3 * mesh.faces.size());
  for (const auto& face : mesh.faces) {
    for (const int vertex : face) indices.push_back(static_cast<std::uint32_t>(vertex));
  }
  block.add_integers("index", indices);
  if (!mesh.sigma.empty()) block.add_floats("sigma", mesh.sigma, Steps::kLogarithmic, value_bits);
  if (!mesh.confidence.empty())
    block.add_bytes("confidence", integers<std::uint8_t>(mesh.confidence, share_byte));
  if (!mesh.hole.empty()) block.add_bytes("hole", mesh.hole);
  if (!distance_mm.empty())
    block.add_floats("distance", distance_mm, Steps::kLogarithmic, value_bits);
  if (!mesh.color.empty() && fine) {
    const auto channel = [&](std::size_t k) {
      return integers<std::uint8_t>(mesh.color, [k](const std::array<float, 3>& linear) {
        return to_srgb_byte(static_cast<double>(linear[k]));
      });
    };
    block.add_bytes("red", channel(0));
    block.add_bytes("green", channel(1));
    block.add_bytes("blue", channel(2));
  }
  return block;
}

std::string unpacked_mesh(const TriangleMesh& mesh) {
  std::string data;
  nlohmann::ordered_json arrays = nlohmann::ordered_json::object();
  const auto begin = [&](const char* name, std::size_t count) {
    data.resize((data.size() + 3) / 4 * 4);
    arrays[name] = {{"at", data.size()}, {"count", count}};
  };
  const auto add_bytes = [&](const char* name, const std::vector<std::uint8_t>& values) {
    begin(name, values.size());
    data.append(values.begin(), values.end());
  };
  data.reserve(21 * mesh.vertices.size() + 12 * mesh.faces.size());
  begin("position", 3 * mesh.vertices.size());
  for (const Vec3& v : mesh.vertices) {
    for (Eigen::Index k = 0; k < 3; ++k) append_little_endian(data, static_cast<float>(v[k]));
  }
  begin("index", 3 * mesh.faces.size());
  for (const auto& face : mesh.faces) {
    for (const int vertex : face) append_little_endian(data, static_cast<std::uint32_t>(vertex));
  }
  if (!mesh.sigma.empty()) {
    begin("sigma", mesh.sigma.size());
    for (const float sigma : mesh.sigma) append_little_endian(data, sigma);
  }
  if (!mesh.confidence.empty())
    add_bytes("confidence", integers<std::uint8_t>(mesh.confidence, share_byte));
  if (!mesh.hole.empty()) add_bytes("hole", mesh.hole);
  std::string header = nlohmann::ordered_json{{"arrays", arrays}}.dump();
  header.resize((header.size() + 3) / 4 * 4, ' ');
  std::string whole;
  append_little_endian(whole, static_cast<std::uint32_t>(header.size()));
  return whole + header + data;
}

Block curves_block(const Rig& rig, const CurveFile& curves) {
  using S = CurveSample;
  const auto& samples = curves.samples;
  Block block;
  block.add_floats("u", column(samples, [](const S& s) { return s.u; }));
  block.add_floats("v", column(samples, [](const S& s) { return s.v; }));
  block.add_bytes("camera", integers<std::uint8_t>(samples, [](const S& s) { return s.camera; }));
  block.add_integers("curve", integers<std::uint32_t>(samples, [](const S& s) { return s.curve; }));
  block.add_bytes("family", integers<std::uint8_t>(samples, [](const S& s) { return s.family; }));
  block.add_bytes("color", integers<std::uint8_t>(samples, [](const S& s) { return s.color; }));
  // Tenths of a nat, and 1/500 of a pixel: enough to read, and few bits to store.
  block.add_bytes("lead", integers<std::uint8_t>(samples, [](const S& s) {
                    return std::lround(10 * std::clamp(s.color_lead, 0.0F, 25.5F));
                  }));
  block.add_bytes("sigma_px", integers<std::uint8_t>(samples, [](const S& s) {
                    return std::lround(500 * std::clamp(s.sigma_px, 0.0F, 0.51F));
                  }));
  block.add_bytes("state", integers<std::uint8_t>(samples, [](const S& s) { return s.state; }));
  block.add_bytes("projector",
                  integers<std::uint8_t>(samples, [](const S& s) { return s.projector; }));
  block.add_bytes("pattern", integers<std::uint8_t>(samples, [](const S& s) { return s.pattern; }));
  block.add_integers("line", integers<std::uint16_t>(samples, [](const S& s) { return s.line; }));
  block.add_bytes("confidence", integers<std::uint8_t>(
                                    samples, [](const S& s) { return share_byte(s.confidence); }));
  block.add_bytes("local_id", integers<std::uint8_t>(samples, [&](const S& s) {
                    if (s.state != CurveState::kLabelled || s.projector >= rig.projectors.size())
                      return 255;
                    const auto& patterns = rig.projectors[s.projector].patterns;
                    return s.pattern < patterns.size() ? patterns[s.pattern].local_id(s.line) % 255
                                                       : 255;
                  }));
  using C = CurveCrossing;
  const auto& crossings = curves.crossings;
  block.add_floats("crossing_u", column(crossings, [](const C& c) { return c.u; }));
  block.add_floats("crossing_v", column(crossings, [](const C& c) { return c.v; }));
  block.add_bytes("crossing_camera",
                  integers<std::uint8_t>(crossings, [](const C& c) { return c.camera; }));
  return block;
}

}  // namespace pencilscan
