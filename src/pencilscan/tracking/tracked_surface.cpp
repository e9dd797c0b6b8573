#include "pencilscan/tracking/tracked_surface.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"

namespace pencilscan {
namespace {

static_assert(std::endian::native == std::endian::little, "files hold arrays as memory does");

using nlohmann::json;

template <class T>
json packed(const std::vector<T>& values) {
  std::vector<std::uint8_t> bytes(values.size() * sizeof(T));
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return json::binary(std::move(bytes));
}

template <class T>
std::vector<T> unpacked(const json& value) {
  const auto& bytes = value.get_binary();
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}

bool has_faces_of(const std::vector<std::array<int, 3>>& faces, std::size_t vertices) {
  return std::all_of(faces.begin(), faces.end(), [&](const std::array<int, 3>& face) {
    return std::all_of(face.begin(), face.end(),
                       [&](int v) { return v >= 0 && static_cast<std::size_t>(v) < vertices; });
  });
}

bool is_whole(const TrackedSurface& surface) {
  const std::size_t n = surface.mesh.vertices.size();
  return surface.mesh.confidence.size() == n && surface.mesh.sigma.size() == n &&
         surface.variance.size() == n && has_faces_of(surface.mesh.faces, n) &&
         has_faces_of(surface.coarse_faces, n);
}

}  // namespace

TriangleMesh TrackedSurface::coarse() const {
  int last = -1;
  for (const auto& face : coarse_faces) last = std::max({last, face[0], face[1], face[2]});
  const auto count = static_cast<std::size_t>(last + 1);
  TriangleMesh result;
  result.vertices.assign(mesh.vertices.begin(),
                         mesh.vertices.begin() + static_cast<std::ptrdiff_t>(count));
  result.faces = coarse_faces;
  return result;
}

void write_tracked_surface(const std::filesystem::path& path, const TrackedSurface& surface,
                           const std::string& key) {
  std::vector<float> coordinates;
  coordinates.reserve(3 * surface.mesh.vertices.size());
  for (const Vec3& x : surface.mesh.vertices) {
    for (const double value : x) coordinates.push_back(static_cast<float>(value));
  }
  const Mat3& R = surface.motion.rotation;
  const Vec3& t = surface.motion.translation;
  json file;
  file["key"] = key;
  file["vertices"] = packed(coordinates);
  file["faces"] = packed(surface.mesh.faces);
  file["coarse_faces"] = packed(surface.coarse_faces);
  file["sigma"] = packed(surface.mesh.sigma);
  file["confidence"] = packed(surface.mesh.confidence);
  file["variance"] = packed(surface.variance);
  file["rotation"] = std::vector<double>(R.data(), R.data() + R.size());
  file["translation"] = std::vector<double>(t.data(), t.data() + t.size());
  const std::vector<std::uint8_t> bytes = json::to_cbor(file);
  write_atomically(
      path,
      [&](std::ostream& out) {
        out.write(reinterpret_cast<const char*>(bytes.data()),
                  static_cast<std::streamsize>(bytes.size()));
      },
      Durability::kProcess);
}

std::optional<TrackedSurface> read_tracked_surface(const std::filesystem::path& path,
                                                   const std::string& key) {
  try {
    const json file = json::from_cbor(read_file(path));
    if (file.at("key").get<std::string>() != key) return std::nullopt;
    TrackedSurface surface;
    const auto coordinates = unpacked<float>(file.at("vertices"));
    for (std::size_t i = 0; i + 2 < coordinates.size(); i += 3)
      surface.mesh.vertices.emplace_back(coordinates[i], coordinates[i + 1], coordinates[i + 2]);
    surface.mesh.faces = unpacked<std::array<int, 3>>(file.at("faces"));
    surface.mesh.sigma = unpacked<float>(file.at("sigma"));
    surface.mesh.confidence = unpacked<float>(file.at("confidence"));
    surface.coarse_faces = unpacked<std::array<int, 3>>(file.at("coarse_faces"));
    surface.variance = unpacked<float>(file.at("variance"));
    const auto R = file.at("rotation").get<std::array<double, 9>>();
    const auto t = file.at("translation").get<std::array<double, 3>>();
    surface.motion = {Eigen::Map<const Mat3>(R.data()), Eigen::Map<const Vec3>(t.data())};
    return is_whole(surface) ? std::optional(std::move(surface)) : std::nullopt;
  } catch (const json::exception&) {
    return std::nullopt;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace pencilscan
