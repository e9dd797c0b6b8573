#include "pencilscan/io/mesh_file.h"

#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <cstdlib>
#include <map>
#include <new>
#include <span>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>

#include "pencilscan/core/byte_order_mark.h"
#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/lower_case.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/little_endian.h"
#include "pencilscan/io/mesh_unit.h"
#include "pencilscan/io/ply.h"
#include "pencilscan/io/polygon_mesh.h"
#include "pencilscan/io/srgb.h"

namespace pencilscan {
namespace {

std::vector<float> optional_column(const PlyElement& vertices, const char* name) {
  const PlyColumn* column = vertices.find(name);
  if (column == nullptr || column->is_list) return {};
  std::vector<float> values(column->values.size());
  std::transform(column->values.begin(), column->values.end(), values.begin(),
                 [](double value) { return static_cast<float>(value); });
  return values;
}

/// Of a property of type uchar; empty when there is none.
std::vector<std::uint8_t> optional_bytes(const PlyElement& vertices, const char* name) {
  const PlyColumn* column = vertices.find(name);
  if (column == nullptr || column->is_list || !column->is_byte) return {};
  std::vector<std::uint8_t> values(column->values.size());
  std::transform(column->values.begin(), column->values.end(), values.begin(),
                 [](double value) { return static_cast<std::uint8_t>(value); });
  return values;
}

/// Linear light from red, green and blue as bytes.
std::vector<std::array<float, 3>> optional_colors(const PlyElement& vertices) {
  const std::array<std::vector<std::uint8_t>, 3> shown = {optional_bytes(vertices, "red"),
                                                          optional_bytes(vertices, "green"),
                                                          optional_bytes(vertices, "blue")};
  if (shown[0].empty() || shown[1].empty() || shown[2].empty()) return {};
  std::array<float, 256> linear{};
  for (std::size_t i = 0; i < linear.size(); ++i)
    linear[i] = static_cast<float>(from_srgb(static_cast<double>(i) / 255));
  std::vector<std::array<float, 3>> colors(vertices.count);
  for (std::size_t i = 0; i < colors.size(); ++i)
    colors[i] = {linear[shown[0][i]], linear[shown[1][i]], linear[shown[2][i]]};
  return colors;
}

void check_finite(const std::filesystem::path& path, const TriangleMesh& mesh) {
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!mesh.vertices[i].allFinite()) {
      throw InputError(path.string(), "vertex[" + std::to_string(i) + "]", "",
                       "coordinates must be finite");
    }
  }
}

/// Joins vertices of equal position, in order of first use, whose properties count. STL has one
/// vertex per corner, and Assimp makes one per corner of an OBJ. InputError where one is not
/// finite.
TriangleMesh with_joined_vertices(const std::filesystem::path& path, const TriangleMesh& mesh) {
  check_finite(path, mesh);
  TriangleMesh joined;
  std::map<std::array<double, 3>, int> index_of;
  std::vector<int> new_index(mesh.vertices.size());
  const auto keep = [](const auto& of_mesh, std::size_t i, auto& of_joined) {
    if (!of_mesh.empty()) of_joined.push_back(of_mesh[i]);
  };
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Vec3& x = mesh.vertices[i];
    // + 0.0 makes -0 and 0 one key.
    const auto [at, is_new] = index_of.try_emplace({x[0] + 0.0, x[1] + 0.0, x[2] + 0.0},
                                                   static_cast<int>(joined.vertices.size()));
    if (is_new) {
      joined.vertices.push_back(x);
      keep(mesh.sigma, i, joined.sigma);
      keep(mesh.confidence, i, joined.confidence);
      keep(mesh.hole, i, joined.hole);
      keep(mesh.color, i, joined.color);
    }
    new_index[i] = at->second;
  }
  for (const auto& face : mesh.faces) {
    std::array<int, 3> corner{};
    for (std::size_t k = 0; k < 3; ++k) corner[k] = new_index[static_cast<std::size_t>(face[k])];
    if (corner[0] != corner[1] && corner[1] != corner[2] && corner[2] != corner[0]) {
      joined.faces.push_back(corner);
    }
  }
  return joined;
}

/// True where every vertex is the corner of one polygon at most.
bool has_no_shared_vertices(const PlyColumn& corners, std::size_t vertices) {
  std::vector<char> used(vertices, 0);
  return std::all_of(corners.values.begin(), corners.values.end(), [&](double corner) {
    if (!(corner >= 0 && corner < static_cast<double>(vertices))) return false;
    return std::exchange(used[static_cast<std::size_t>(corner)], 1) == 0;
  });
}

/// PLY is read here rather than by Assimp to keep shared vertices, doubles, sigma and confidence.
/// Exporters that share none write every face with vertices of its own: those are joined, as STL's.
TriangleMesh read_ply_mesh(const std::filesystem::path& path) {
  const PlyFile file = read_ply(path);
  const PlyElement* vertices = file.find("vertex");
  if (vertices == nullptr) throw InputError(path.string(), "", "", "must have an element `vertex`");
  TriangleMesh mesh;
  mesh.vertices.resize(vertices->count);
  const char* names[] = {"x", "y", "z"};
  for (int axis = 0; axis < 3; ++axis) {
    const PlyColumn* column = vertices->find(names[axis]);
    if (column == nullptr || column->is_list) {
      throw InputError(path.string(), names[axis], "", "the vertices must have this property");
    }
    for (std::size_t i = 0; i < vertices->count; ++i) mesh.vertices[i](axis) = column->values[i];
  }
  mesh.sigma = optional_column(*vertices, "sigma");
  mesh.confidence = optional_column(*vertices, "confidence");
  mesh.hole = optional_bytes(*vertices, "hole");
  mesh.color = optional_colors(*vertices);
  const PlyElement* faces = file.find("face");
  if (faces == nullptr) return mesh;
  const PlyColumn* corners = faces->find("vertex_indices");
  if (corners == nullptr) corners = faces->find("vertex_index");
  if (corners == nullptr || !corners->is_list) return mesh;
  const std::span<const double> all(corners->values);
  mesh.faces.reserve(faces->count);
  for (std::size_t f = 0; f < faces->count; ++f) {
    const std::size_t begin = corners->begin[f];
    append_polygon(
        path, [&] { return "face[" + std::to_string(f) + "]"; },
        all.subspan(begin, corners->begin[f + 1] - begin), mesh);
  }
  if (has_no_shared_vertices(*corners, vertices->count)) return with_joined_vertices(path, mesh);
  return mesh;
}

/// Reads a line of an OBJ with those that it goes on in, which a backslash at its end says; false
/// at the end of the file. A comment ends with its line. `number` counts the lines of the file.
bool read_obj_line(std::istream& lines, std::string& line, int& number) {
  line.clear();
  for (std::string part; std::getline(lines, part);) {
    ++number;
    part.erase(part.find_last_not_of(" \t\r") + 1);
    const bool goes_on = part.ends_with('\\');
    if (goes_on) part.back() = ' ';
    line += part;
    if (!goes_on || line.find('#') != std::string::npos) return true;
  }
  return !line.empty();
}

/// True for an OBJ's line of this kind: "v" or "f".
bool is_obj_line(const std::string& line, char kind) {
  return line.size() > 1 && line[0] == kind && (line[1] == ' ' || line[1] == '\t');
}

/// The line of a vertex as Assimp understands it: see assimp_obj().
std::string vertex_line(const std::filesystem::path& path, const std::string& line, int number) {
  std::istringstream stream(line.substr(1, line.find('#') - 1));
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  if (words.size() < 3)
    throw InputError(path.string(), "line " + std::to_string(number), line.substr(0, 40),
                     "must be a vertex: v x y z");
  // Four numbers are x y z w; more of them hold colours.
  if (words.size() > 4) words.resize(3);
  std::string text = "v";
  for (std::string word : words) {
    char* end = nullptr;
    if (!std::isfinite(std::strtod(word.c_str(), &end)) || *end != '\0')
      throw InputError(path.string(), "line " + std::to_string(number), word,
                       "must be a finite number");
    const std::size_t first = word.find_first_not_of("+-");
    if (word[first] == '.') word.insert(first, "0");
    text += " " + word;
  }
  return text;
}

/// An OBJ as Assimp understands it. It passes over coordinates that begin with a point (".5",
/// "-.5") or are no numbers, and takes those that follow for them; it does not expect comments
/// behind faces, more than three numbers of a colour, lines that are indented, nor the mark that
/// editors of Windows put before the first one.
std::string assimp_obj(const std::filesystem::path& path, const std::string& obj) {
  std::string text;
  std::istringstream lines(without_byte_order_mark(obj));
  std::string line;
  for (int number = 0; read_obj_line(lines, line, number);) {
    line.erase(0, line.find_first_not_of(" \t"));
    if (is_obj_line(line, 'v')) line = vertex_line(path, line, number);
    if (is_obj_line(line, 'f')) line = line.substr(0, line.find('#'));
    text += line + "\n";
  }
  return text;
}

/// An STL as Assimp understands it. It knows binary files by their very size, and text by its words
/// in small letters. InputError where a binary file is of another size than its header says.
std::string assimp_stl(const std::filesystem::path& path, std::string stl) {
  constexpr std::size_t kHead = 84;   // the last four bytes are the number of facets
  constexpr std::size_t kFacet = 50;  // bytes
  const std::size_t first = std::min(stl.find_first_not_of(" \t\r\n"), stl.size());
  const bool may_be_text = lower_case(stl.substr(first, 5)) == "solid";
  std::uint32_t facets = 0;
  for (std::size_t k = 4; k-- > 0 && stl.size() >= kHead;)
    facets = facets << 8U | static_cast<std::uint8_t>(stl[kHead - 4 + k]);
  const std::size_t whole = kHead + kFacet * facets;
  if (stl.size() == whole) return stl;
  if (may_be_text) return stl.compare(first, 5, "solid") == 0 ? stl : lower_case(stl);
  if (stl.size() < kHead)
    throw InputError(path.string(), "", "", "must be STL: text, or a binary file with a header");
  if (stl.size() < whole || stl.size() - whole >= kFacet)
    throw InputError(path.string(), "number of facets", std::to_string(facets),
                     "must be what the file holds, " +
                         std::to_string((stl.size() - kHead) / kFacet) + ": it may be truncated");
  stl.resize(whole);  // some programs put a few bytes behind the last facet
  return stl;
}

/// What Assimp is to read of a file.
std::string assimp_bytes(const std::filesystem::path& path, const std::string& ending) {
  std::string stored = read_file(path);
  return ending == ".obj" ? assimp_obj(path, stored) : assimp_stl(path, std::move(stored));
}

/// What Assimp complains of. It calls a file that it reads from memory by a name of its own.
std::string assimp_reason(std::string reason) {
  std::replace(reason.begin(), reason.end(), '\n', ' ');
  constexpr std::string_view kOwnName = "$$$___magic___$$$";
  if (const auto at = reason.find(kOwnName); at != std::string::npos)
    reason.replace(at, kOwnName.size(), "the file");
  return reason;
}

TriangleMesh read_with_assimp(const std::filesystem::path& path, const std::string& ending) {
  const std::string bytes = assimp_bytes(path, ending);
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFileFromMemory(
      bytes.data(), bytes.size(), aiProcess_Triangulate | aiProcess_PreTransformVertices,
      ending.substr(1).c_str());
  if (scene == nullptr) {
    const std::string reason = assimp_reason(importer.GetErrorString());
    if (reason.find("bad_alloc") != std::string::npos) throw std::bad_alloc();
    throw InputError(path.string(), "", "", "cannot be read as a mesh: " + reason);
  }
  TriangleMesh mesh;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& part = *scene->mMeshes[m];
    const int first = static_cast<int>(mesh.vertices.size());
    for (unsigned i = 0; i < part.mNumVertices; ++i) {
      const aiVector3D& x = part.mVertices[i];
      mesh.vertices.emplace_back(x.x, x.y, x.z);
    }
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mNumIndices != 3) continue;  // points and lines
      mesh.faces.push_back({first + static_cast<int>(face.mIndices[0]),
                            first + static_cast<int>(face.mIndices[1]),
                            first + static_cast<int>(face.mIndices[2])});
    }
  }
  return with_joined_vertices(path, mesh);
}

void check_mesh(const std::filesystem::path& path, const TriangleMesh& mesh) {
  check_finite(path, mesh);
  if (mesh.faces.empty()) throw InputError(path.string(), "faces", "0", "the mesh must have faces");
}

}  // namespace

TriangleMesh read_mesh(const std::filesystem::path& path) {
  const std::string ending = lower_case(path.extension().string());
  TriangleMesh mesh;
  if (ending == ".ply") {
    mesh = read_ply_mesh(path);
  } else if (ending == ".off") {
    mesh = with_joined_vertices(path, read_off_mesh(path));
  } else if (ending == ".obj" || ending == ".stl") {
    mesh = read_with_assimp(path, ending);
  } else {
    throw InputError(path.string(), "", "", "a mesh file must end with .ply, .obj, .stl or .off");
  }
  check_mesh(path, mesh);
  return mesh;
}

void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh, bool unit_known) {
  const bool has_sigma = !mesh.sigma.empty();
  const bool has_confidence = !mesh.confidence.empty();
  PENCILSCAN_CHECK(!has_sigma || mesh.sigma.size() == mesh.vertices.size());
  PENCILSCAN_CHECK(!has_confidence || mesh.confidence.size() == mesh.vertices.size());
  const bool has_hole = !mesh.hole.empty();
  PENCILSCAN_CHECK(!has_hole || mesh.hole.size() == mesh.vertices.size());
  const bool has_color = !mesh.color.empty();
  PENCILSCAN_CHECK(!has_color || mesh.color.size() == mesh.vertices.size());
  std::string bytes;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      append_little_endian(bytes, static_cast<float>(mesh.vertices[i](axis)));
    }
    if (has_sigma) append_little_endian(bytes, mesh.sigma[i]);
    if (has_confidence) append_little_endian(bytes, mesh.confidence[i]);
    if (has_hole) append_little_endian(bytes, mesh.hole[i]);
    if (has_color) {
      for (const float linear : mesh.color[i]) append_little_endian(bytes, to_srgb_byte(linear));
    }
  }
  for (const auto& face : mesh.faces) {
    append_little_endian(bytes, std::uint8_t{3});
    for (const int corner : face) append_little_endian(bytes, static_cast<std::int32_t>(corner));
  }
  write_atomically(path, [&](std::ostream& stream) {
    stream << "ply\nformat binary_little_endian 1.0\n"
           << ply_unit(unit_known) << " world frame of rig.json\nelement vertex "
           << mesh.vertices.size() << "\nproperty float x\nproperty float y\nproperty float z\n";
    if (has_sigma) stream << "property float sigma\n";
    if (has_confidence) stream << "property float confidence\n";
    if (has_hole) stream << "property uchar hole\n";
    if (has_color) stream << "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    stream << "element face " << mesh.faces.size()
           << "\nproperty list uchar int vertex_indices\nend_header\n"
           << bytes;
  });
}

void remove_older_mesh(const std::filesystem::path& path) {
  std::error_code failure;
  std::filesystem::remove(path, failure);
  if (failure && failure != std::errc::not_a_directory)
    throw StageError(path.string() + ": cannot be removed: " + failure.message());
}

}  // namespace pencilscan
