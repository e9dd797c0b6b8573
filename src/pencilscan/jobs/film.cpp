#include "pencilscan/jobs/film.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/io/partial_folder.h"
#include "pencilscan/io/zarr_array.h"
#include "pencilscan/pipeline/run_folder.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

constexpr std::array<float, 3> kWhite = {1, 1, 1};
constexpr const char* kFilmFormat = "surface/1";      ///< of the group's attribute `format`
constexpr const char* kDevicesFile = "devices.json";  ///< the rig in use, beside the frames

template <class Number>
void write_column(const fs::path& folder, const std::vector<Number>& values, std::int64_t width) {
  ZarrArray array;
  array.shape = {static_cast<std::int64_t>(values.size()) / width};
  if (width > 1) array.shape.push_back(width);
  array.chunks = array.shape;
  array.chunks[0] = std::max<std::int64_t>(1, array.chunks[0]);
  array.type = zarr_type<Number>();
  array.compression = ZarrCompression::kZstd;
  if (values.empty()) return write_zarr_array(folder, array, Durability::kProcess);
  write_zarr_bytes(
      folder, array,
      {reinterpret_cast<const std::uint8_t*>(values.data()), values.size() * sizeof(Number)},
      Durability::kProcess);
}

void write_group(const fs::path& folder, const TriangleMesh& mesh) {
  std::vector<float> vertices;
  for (const Vec3& v : mesh.vertices) {
    for (const double x : {v.x(), v.y(), v.z()}) vertices.push_back(static_cast<float>(x));
  }
  std::vector<std::int32_t> faces;
  for (const auto& face : mesh.faces) faces.insert(faces.end(), face.begin(), face.end());
  std::vector<float> sigma = mesh.sigma;
  sigma.resize(mesh.vertices.size(), 0);
  // Confidence is 0 where a vertex closes the surface and nobody measured it.
  std::vector<std::uint8_t> measured;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
    measured.push_back(mesh.confidence.empty() || mesh.confidence[i] > 0 ? 1 : 0);
  write_zarr_group(folder, {});
  write_column(folder / "vertices", vertices, 3);
  write_column(folder / "faces", faces, 3);
  write_column(folder / "sigma", sigma, 1);
  write_column(folder / "measured", measured, 1);
}

/// Writes "k: [values of the k-th mesh]" for every frame of one attribute.
class TimeSamples {
 public:
  TimeSamples(const Film& film, std::ostream& stream, const Progress& progress)
      : film_(film), stream_(stream), progress_(progress) {}

  /// `write` puts the values of one mesh, with commas between.
  template <class Write>
  void attribute(const std::string& name, const std::string& metadata, const Write& write) {
    // Of an attribute with time samples, metadata stand with its declaration.
    if (!metadata.empty()) stream_ << "    " << name << " (\n        " << metadata << "\n    )\n";
    stream_ << "    " << name << ".timeSamples = {\n";
    for (std::size_t k = 0; k < film_.frames.size(); ++k) {
      stream_ << "        " << k << ": [";
      if (film_.has_mesh[k] != 0) write(read_mesh(film_.mesh_file(k)));
      stream_ << "],\n";
      if (progress_)
        progress_("film: " + name,
                  static_cast<double>(k + 1) / static_cast<double>(film_.frames.size()));
    }
    stream_ << "    }\n";
  }
  void comma(bool is_first) { stream_ << (is_first ? "" : ", "); }
  void triple(double x, double y, double z) {
    char text[96];
    std::snprintf(text, sizeof text, "(%.7g, %.7g, %.7g)", x, y, z);
    stream_ << text;
  }
  void point(const Vec3& v) { triple(v.x(), v.y(), v.z()); }
  std::ostream& stream() { return stream_; }

 private:
  const Film& film_;
  std::ostream& stream_;
  const Progress& progress_;
};

void write_attributes(TimeSamples& samples, bool has_color) {
  std::ostream& stream = samples.stream();
  samples.attribute("float3[] extent", "", [&](const TriangleMesh& mesh) {
    const BoundingBox box = bounding_box(mesh);
    samples.point(box.low);
    samples.comma(false);
    samples.point(box.high);
  });
  samples.attribute("int[] faceVertexCounts", "", [&](const TriangleMesh& mesh) {
    for (std::size_t i = 0; i < mesh.faces.size(); ++i) stream << (i == 0 ? "3" : ", 3");
  });
  samples.attribute("int[] faceVertexIndices", "", [&](const TriangleMesh& mesh) {
    bool is_first = true;
    for (const auto& face : mesh.faces) {
      for (const int vertex : face) {
        samples.comma(std::exchange(is_first, false));
        stream << vertex;
      }
    }
  });
  samples.attribute("point3f[] points", "", [&](const TriangleMesh& mesh) {
    bool is_first = true;
    for (const Vec3& vertex : mesh.vertices) {
      samples.comma(std::exchange(is_first, false));
      samples.point(vertex);
    }
  });
  samples.attribute("float[] primvars:sigma", "interpolation = \"vertex\"",
                    [&](const TriangleMesh& mesh) {
                      for (std::size_t i = 0; i < mesh.sigma.size(); ++i) {
                        samples.comma(i == 0);
                        stream << mesh.sigma[i];
                      }
                    });
  if (!has_color) return;
  samples.attribute("color3f[] primvars:displayColor", "interpolation = \"vertex\"",
                    [&](const TriangleMesh& mesh) {
                      for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
                        const std::array<float, 3> c = mesh.color.empty() ? kWhite : mesh.color[i];
                        samples.comma(i == 0);
                        samples.triple(static_cast<double>(c[0]), static_cast<double>(c[1]),
                                       static_cast<double>(c[2]));
                      }
                    });
}

std::size_t first_mesh(const Film& film) {
  return static_cast<std::size_t>(std::find(film.has_mesh.begin(), film.has_mesh.end(), 1) -
                                  film.has_mesh.begin());
}

/// Whether any mesh has colours; reads up to the first that has.
bool has_colors(const Film& film) {
  for (std::size_t k = 0; k < film.frames.size(); ++k)
    if (film.has_mesh[k] != 0 && !read_mesh(film.mesh_file(k)).color.empty()) return true;
  return false;
}

/// What the numbers are. USD takes those that say nothing for centimetres.
const char* unit_metadata(const Film& film) {
  if (film.unit_known) return "    metersPerUnit = 0.001\n";
  return "    metersPerUnit = 1\n    customLayerData = {\n        string unit = \"unknown\"\n"
         "    }\n";
}

}  // namespace

fs::path Film::mesh_file(std::size_t frame) const {
  return out / frames[frame] / (measured_only ? "mesh_measured.ply" : "mesh.ply");
}

Film find_film(const fs::path& out, bool measured_only) {
  if (!has_run_inputs(out))
    throw InputError("--result", "", out.string(),
                     "must be an output folder of reconstruct (with inputs.json)");
  Film film{out, read_run_inputs(out).frames, {}, true, measured_only};
  std::error_code ignored;
  if (fs::exists(out / kDevicesFile, ignored))
    film.unit_known = read_rig(out / kDevicesFile).unit_known;
  for (std::size_t k = 0; k < film.frames.size(); ++k)
    film.has_mesh.push_back(fs::exists(film.mesh_file(k), ignored) ? 1 : 0);
  if (first_mesh(film) == film.frames.size())
    throw InputError("--result", "", out.string(), "must hold at least one frame with a mesh");
  return film;
}

void write_film_zarr(const Film& film, const fs::path& folder, const Progress& progress) {
  if (fs::exists(folder) && !(fs::is_directory(folder) && fs::is_empty(folder))) {
    if (!is_zarr_group(folder) || read_zarr_group(folder).value("format", "") != kFilmFormat)
      throw InputError(folder.string(), "", "", "must be new, empty or an earlier film");
  }
  ReplacingFolder making(folder);
  const fs::path partial = making.path();
  write_zarr_group(partial, {{"format", kFilmFormat}, {"frames", film.frames}});
  const auto at_once = static_cast<std::size_t>(thread_count());
  for (std::size_t first = 0; first < film.frames.size(); first += at_once) {
    const std::size_t count = std::min(at_once, film.frames.size() - first);
    parallel_for(count, [&](std::size_t i) {
      const std::size_t k = first + i;
      if (film.has_mesh[k] != 0)
        write_group(partial / film.frames[k], read_mesh(film.mesh_file(k)));
    });
    if (progress)
      progress("film",
               static_cast<double>(first + count) / static_cast<double>(film.frames.size()));
  }
  making.publish();
}

void write_film_usd(const Film& film, double frames_per_second, const fs::path& file,
                    const Progress& progress) {
  write_atomically(file, [&](std::ostream& stream) {
    stream << "#usda 1.0\n(\n    defaultPrim = \"Shape\"\n    upAxis = \"Z\"\n"
           << unit_metadata(film)
           << "    startTimeCode = 0\n    endTimeCode = " << film.frames.size() - 1
           << "\n    timeCodesPerSecond = " << frames_per_second
           << "\n    framesPerSecond = " << frames_per_second << "\n)\n\ndef Mesh \"Shape\"\n{\n"
           << "    uniform token subdivisionScheme = \"none\"\n";
    TimeSamples samples(film, stream, progress);
    write_attributes(samples, has_colors(film));
    stream << "}\n";
  });
}

}  // namespace pencilscan
