#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "pencilscan/core/error.h"
#include "pencilscan/core/lower_case.h"
#include "pencilscan/geometry/as_floats.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/little_endian.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/io/mesh_unit.h"
#include "pencilscan/io/srgb.h"

namespace pencilscan {
namespace {

std::string obj_text(const TriangleMesh& mesh, bool unit_known) {
  std::string text = obj_unit(unit_known);
  char line[128];
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Vec3& v = mesh.vertices[i];
    // Nine digits tell floats apart, whatever the unit is.
    std::snprintf(line, sizeof line, "v %.9g %.9g %.9g", v[0], v[1], v[2]);
    text += line;
    if (!mesh.color.empty()) {
      const auto& c = mesh.color[i];
      std::snprintf(line, sizeof line, " %.4f %.4f %.4f", to_srgb(c[0]), to_srgb(c[1]),
                    to_srgb(c[2]));
      text += line;
    }
    text += '\n';
  }
  for (const auto& f : mesh.faces) {
    std::snprintf(line, sizeof line, "f %d %d %d\n", f[0] + 1, f[1] + 1, f[2] + 1);
    text += line;
  }
  return text;
}

void append_vector(std::string& bytes, const Vec3& v) {
  for (int axis = 0; axis < 3; ++axis) append_little_endian(bytes, static_cast<float>(v[axis]));
}

std::string stl_bytes(const TriangleMesh& mesh, bool unit_known) {
  std::string bytes = stl_unit(unit_known);
  bytes.resize(80, ' ');
  append_little_endian(bytes, static_cast<std::uint32_t>(mesh.faces.size()));
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    append_vector(bytes, face_normal(mesh, f));
    for (const int v : mesh.faces[f])
      append_vector(bytes, mesh.vertices[static_cast<std::size_t>(v)]);
    append_little_endian(bytes, std::uint16_t{0});
  }
  return bytes;
}

/// World z up in mm -> glTF's y up in m: (x, z, -y) / 1000. Numbers without a unit stay.
Vec3 gltf_position(const Vec3& v, bool unit_known) {
  return Vec3(v[0], v[2], -v[1]) / (unit_known ? 1000 : 1);
}

std::uint16_t unorm16(float value) {
  return static_cast<std::uint16_t>(std::lround(65535 * std::clamp(value, 0.F, 1.F)));
}

/// The binary data of a glTF mesh, and where its parts begin.
struct GltfData {
  std::string bytes;
  Vec3 low = Vec3::Constant(1e30);  ///< smallest and largest coordinates
  Vec3 high = -low;
  std::size_t normals = 0;
  std::size_t colors = 0;
  std::size_t indices = 0;
};

GltfData gltf_data(const TriangleMesh& mesh, bool unit_known) {
  GltfData data;
  for (const Vec3& v : mesh.vertices) {
    const Vec3 p = as_floats(gltf_position(v, unit_known));
    data.low = data.low.cwiseMin(p);
    data.high = data.high.cwiseMax(p);
    append_vector(data.bytes, p);
  }
  data.normals = data.bytes.size();
  const std::vector<Vec3> normals = vertex_normals(mesh);
  for (const Vec3& n : normals) {
    // Validators want unit normals, also of a vertex without area.
    const Vec3 up(n[0], n[2], -n[1]);
    append_vector(data.bytes, up.squaredNorm() > 0.5 ? up : Vec3::UnitY());
  }
  // glTF wants linear colours; 16 bits keep dark ones apart. Four channels, as rows align to four
  // bytes.
  data.colors = data.bytes.size();
  for (const auto& color : mesh.color) {
    for (const float c : color) append_little_endian(data.bytes, unorm16(c));
    append_little_endian(data.bytes, unorm16(1));
  }
  data.indices = data.bytes.size();
  for (const auto& f : mesh.faces) {
    for (const int v : f) append_little_endian(data.bytes, static_cast<std::uint32_t>(v));
  }
  return data;
}

using nlohmann::json;

/// Bytes [begin, end) of the data.
json gltf_view(std::size_t begin, std::size_t end, int target) {
  return {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", end - begin}, {"target", target}};
}

/// What the data are.
json gltf_description(const TriangleMesh& mesh, const GltfData& data, bool unit_known) {
  json root;
  root["asset"] = {{"version", "2.0"}, {"generator", "pencilscan"}};
  if (!unit_known) root["asset"]["extras"]["unit"] = "unknown";
  root["scene"] = 0;
  root["scenes"] = json::array({{{"nodes", {0}}}});
  root["nodes"] = json::array({{{"mesh", 0}, {"name", "surface"}}});
  root["materials"] = json::array(
      {{{"pbrMetallicRoughness", {{"metallicFactor", 0.0}, {"roughnessFactor", 0.8}}}}});
  root["meshes"] =
      json::array({{{"primitives", json::array({{{"attributes", {{"POSITION", 0}, {"NORMAL", 1}}},
                                                 {"indices", 2},
                                                 {"material", 0}}})}}});
  root["buffers"] = json::array({{{"byteLength", data.bytes.size()}}});
  constexpr int kArrayBuffer = 34962;
  constexpr int kElementBuffer = 34963;
  root["bufferViews"] = json::array({gltf_view(0, data.normals, kArrayBuffer),
                                     gltf_view(data.normals, data.colors, kArrayBuffer),
                                     gltf_view(data.indices, data.bytes.size(), kElementBuffer)});
  constexpr int kFloat = 5126;
  constexpr int kUnsignedInt = 5125;
  root["accessors"] = json::array({{{"bufferView", 0},
                                    {"componentType", kFloat},
                                    {"count", mesh.vertices.size()},
                                    {"type", "VEC3"},
                                    {"min", {data.low[0], data.low[1], data.low[2]}},
                                    {"max", {data.high[0], data.high[1], data.high[2]}}},
                                   {{"bufferView", 1},
                                    {"componentType", kFloat},
                                    {"count", mesh.vertices.size()},
                                    {"type", "VEC3"}},
                                   {{"bufferView", 2},
                                    {"componentType", kUnsignedInt},
                                    {"count", 3 * mesh.faces.size()},
                                    {"type", "SCALAR"}}});
  if (mesh.color.empty()) return root;
  constexpr int kUnsignedShort = 5123;
  root["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = 3;
  root["bufferViews"].push_back(gltf_view(data.colors, data.indices, kArrayBuffer));
  root["accessors"].push_back({{"bufferView", 3},
                               {"componentType", kUnsignedShort},
                               {"normalized", true},
                               {"count", mesh.vertices.size()},
                               {"type", "VEC4"}});
  return root;
}

/// glTF 2.0, "GLB File Format Specification": a header, a chunk of JSON padded with spaces and one
/// of binary data padded with zeros, each to four bytes.
std::string glb_bytes(const TriangleMesh& mesh, bool unit_known) {
  GltfData data = gltf_data(mesh, unit_known);
  std::string text = gltf_description(mesh, data, unit_known).dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  data.bytes.resize((data.bytes.size() + 3) / 4 * 4, '\0');
  std::string bytes = "glTF";
  append_little_endian(bytes, std::uint32_t{2});
  append_little_endian(bytes,
                       static_cast<std::uint32_t>(12 + 8 + text.size() + 8 + data.bytes.size()));
  append_little_endian(bytes, static_cast<std::uint32_t>(text.size()));
  bytes += "JSON" + text;
  append_little_endian(bytes, static_cast<std::uint32_t>(data.bytes.size()));
  bytes.append("BIN\0", 4);
  return bytes + data.bytes;
}

}  // namespace

void export_mesh(const std::filesystem::path& path, const TriangleMesh& mesh, bool unit_known) {
  const std::string ending = lower_case(path.extension().string());
  std::string bytes;
  if (ending == ".obj") {
    bytes = obj_text(mesh, unit_known);
  } else if (ending == ".stl") {
    bytes = stl_bytes(mesh, unit_known);
  } else if (ending == ".glb") {
    bytes = glb_bytes(mesh, unit_known);
  } else {
    throw InputError(path.string(), "", ending, "a mesh is exported to .obj, .stl or .glb");
  }
  write_atomically(path, [&](std::ostream& stream) { stream << bytes; });
}

}  // namespace pencilscan
