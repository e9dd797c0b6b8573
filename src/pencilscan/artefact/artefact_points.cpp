#include "pencilscan/artefact/artefact_points.h"

#include <algorithm>

#include "pencilscan/core/error.h"
#include "pencilscan/io/curve_file.h"
#include "pencilscan/io/frame_failure.h"
#include "pencilscan/io/ply.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

const std::vector<double>* scalar(const PlyElement& vertices, const char* name) {
  const PlyColumn* column = vertices.find(name);
  return column != nullptr && !column->is_list ? &column->values : nullptr;
}

const std::vector<double>& coordinate(const fs::path& path, const PlyElement& vertices,
                                      const char* name) {
  const auto* values = scalar(vertices, name);
  if (values == nullptr)
    throw InputError(path.string(), name, "", "the vertices must have this property");
  return *values;
}

/// The columns of points.ply that say where a point comes from, or none.
struct OriginColumns {
  explicit OriginColumns(const PlyElement& vertices)
      : u(scalar(vertices, "u")),
        v(scalar(vertices, "v")),
        camera(scalar(vertices, "camera")),
        projector(scalar(vertices, "projector")),
        line(scalar(vertices, "line")),
        confidence(scalar(vertices, "confidence")) {}
  [[nodiscard]] bool complete() const {
    return u != nullptr && v != nullptr && camera != nullptr && projector != nullptr &&
           line != nullptr && confidence != nullptr;
  }
  [[nodiscard]] PointOrigin at(std::size_t i) const {
    // Foreign files may hold anything under these names.
    const auto whole = [](double x) { return x >= 0 && x <= 1e9 ? static_cast<int>(x) : -1; };
    return {static_cast<float>((*u)[i]), static_cast<float>((*v)[i]),
            whole((*camera)[i]),         whole((*projector)[i]),
            whole((*line)[i]),           static_cast<float>((*confidence)[i])};
  }

  const std::vector<double>*u, *v, *camera, *projector, *line, *confidence;
};

/// 1 for each of `count` vertices that a face has; all where there are no faces.
std::vector<std::uint8_t> vertices_of_faces(const PlyElement* faces, std::size_t count) {
  const PlyColumn* corners = faces != nullptr ? faces->find("vertex_indices") : nullptr;
  if (faces != nullptr && corners == nullptr) corners = faces->find("vertex_index");
  if (corners == nullptr || !corners->is_list || corners->values.empty())
    return std::vector<std::uint8_t>(count, 1);
  std::vector<std::uint8_t> has_face(count, 0);
  for (const double corner : corners->values)
    if (corner >= 0 && corner < static_cast<double>(count))
      has_face[static_cast<std::size_t>(corner)] = 1;
  return has_face;
}

}  // namespace

ArtefactPoints ArtefactPoints::subset(const std::vector<std::size_t>& indices) const {
  ArtefactPoints part;
  part.source = source;
  part.is_mesh = is_mesh;
  part.unit_known = unit_known;
  part.not_finite = not_finite;
  part.without_face = without_face;
  part.outside_region = outside_region;
  for (const std::size_t i : indices) {
    part.points.push_back(points[i]);
    if (!sigma.empty()) part.sigma.push_back(sigma[i]);
    if (!origins.empty()) part.origins.push_back(origins[i]);
  }
  return part;
}

ArtefactFiles artefact_files(const fs::path& path, FrameSurface surface) {
  const std::string name = surface == FrameSurface::kMesh ? "mesh_measured.ply" : "points.ply";
  if (!fs::exists(path)) throw InputError(path.string(), "", "", "no such file or folder");
  if (!fs::is_directory(path)) return {{path}, {}};
  ArtefactFiles found;
  bool has_failure = false;
  const auto visit = [&](const fs::path& folder) {
    if (fs::exists(folder / name)) {
      found.files.push_back(folder / name);
    } else if (const auto failure = read_failure(folder)) {
      found.lacking.push_back({folder, failure->reason});
      has_failure = true;
    } else if (fs::exists(folder / "input.json")) {
      found.lacking.push_back({folder, "it holds no " + name});
    } else {
      return false;
    }
    return true;
  };
  if (!visit(path)) {
    std::vector<fs::path> folders;
    for (const auto& entry : fs::directory_iterator(path)) folders.push_back(entry.path());
    std::sort(folders.begin(), folders.end());
    for (const fs::path& folder : folders) visit(folder);
  }
  if (found.files.empty() && !has_failure) {
    throw InputError(path.string(), "", "",
                     "must be a PLY file, or hold " + name + " or frames with it");
  }
  return found;
}

ArtefactPoints read_artefact_points(const fs::path& path) {
  const PlyFile file = read_ply(path);
  const PlyElement* vertices = file.find("vertex");
  if (vertices == nullptr) throw InputError(path.string(), "", "", "must have an element `vertex`");
  refuse_curves(path, *vertices);
  const auto& x = coordinate(path, *vertices, "x");
  const auto& y = coordinate(path, *vertices, "y");
  const auto& z = coordinate(path, *vertices, "z");
  const auto* sigma = scalar(*vertices, "sigma");
  const OriginColumns origins(*vertices);
  const PlyElement* faces = file.find("face");
  ArtefactPoints result;
  result.source = path.string();
  result.is_mesh = faces != nullptr && faces->count > 0;
  const std::vector<std::uint8_t> has_face = vertices_of_faces(faces, vertices->count);
  for (std::size_t i = 0; i < vertices->count; ++i) {
    const Vec3 point(x[i], y[i], z[i]);
    if (has_face[i] == 0) {
      ++result.without_face;
      continue;
    }
    if (!point.allFinite()) {
      ++result.not_finite;
      continue;
    }
    result.points.push_back(point);
    if (sigma != nullptr) result.sigma.push_back(static_cast<float>((*sigma)[i]));
    if (origins.complete()) result.origins.push_back(origins.at(i));
  }
  if (result.points.empty())
    throw InputError(path.string(), "vertex", "0", "must hold points with finite positions");
  return result;
}

ArtefactPoints within(const ArtefactPoints& points, const Sphere& region) {
  std::vector<std::size_t> inside;
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    if ((points.points[i] - region.center).norm() <= region.radius) inside.push_back(i);
  }
  ArtefactPoints part = points.subset(inside);
  part.outside_region += points.points.size() - inside.size();
  return part;
}

}  // namespace pencilscan
