#include "pencilscan/labeling/point_file.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/io/curve_file.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/little_endian.h"
#include "pencilscan/io/ply.h"

namespace pencilscan {
namespace {

/// What is known of some point.
struct KnownProperties {
  bool normals = false;
  bool colors = false;
};

KnownProperties known_of(const std::vector<MeasuredPoint>& points) {
  const auto any = [&](auto has) { return std::any_of(points.begin(), points.end(), has); };
  return {any([](const MeasuredPoint& p) { return p.nx != 0 || p.ny != 0 || p.nz != 0; }),
          any([](const MeasuredPoint& p) { return p.red != 0 || p.green != 0 || p.blue != 0; })};
}

void append_point(std::string& bytes, const MeasuredPoint& point, const KnownProperties& known) {
  for (const float value : {point.x, point.y, point.z, point.u, point.v}) {
    append_little_endian(bytes, value);
  }
  append_little_endian(bytes, point.camera);
  append_little_endian(bytes, point.projector);
  append_little_endian(bytes, point.pattern);
  append_little_endian(bytes, static_cast<std::int32_t>(point.line));
  for (const float value : {point.sigma, point.confidence, point.plane}) {
    append_little_endian(bytes, value);
  }
  if (known.normals)
    for (const float value : {point.nx, point.ny, point.nz}) append_little_endian(bytes, value);
  if (known.colors)
    for (const auto value : {point.red, point.green, point.blue})
      append_little_endian(bytes, value);
}

/// Access to the scalar properties of one vertex element, with the errors of a user's file.
class Columns {
 public:
  Columns(std::string path, const PlyElement& vertices)
      : path_(std::move(path)), vertices_(vertices) {}

  [[nodiscard]] const std::vector<double>& required(const char* name) const {
    const auto* values = optional(name);
    if (values == nullptr)
      throw InputError(path_, name, "",
                       "the vertices must have this property, as those of points.ply: points of "
                       "another program do not say which line they are of");
    return *values;
  }
  [[nodiscard]] const std::vector<double>* optional(const char* name) const {
    const PlyColumn* column = vertices_.find(name);
    return column != nullptr && !column->is_list ? &column->values : nullptr;
  }
  template <class T>
  [[nodiscard]] T index(const char* name, const std::vector<double>& values, std::size_t i) const {
    const double value = values[i];
    if (!(value >= 0) || value > std::numeric_limits<T>::max() || value != std::floor(value)) {
      throw InputError(
          path_, field(name, i), std::to_string(value),
          "must be an integer from 0 to " + std::to_string(std::numeric_limits<T>::max()));
    }
    return static_cast<T>(value);
  }
  [[nodiscard]] float finite(const char* name, const std::vector<double>& values,
                             std::size_t i) const {
    if (!std::isfinite(values[i])) {
      throw InputError(path_, field(name, i), std::to_string(values[i]), "must be finite");
    }
    return static_cast<float>(values[i]);
  }
  /// Of a number of 0 to `most`.
  [[nodiscard]] float within(const char* name, const std::vector<double>& values, std::size_t i,
                             double most) const {
    if (!(values[i] >= 0 && values[i] <= most)) {
      throw InputError(path_, field(name, i), std::to_string(values[i]),
                       std::isfinite(most) ? "must be from 0 to " + formatted(most)
                                           : std::string("must be at least 0"));
    }
    return static_cast<float>(values[i]);
  }

 private:
  static std::string field(const char* name, std::size_t i) {
    return "vertex[" + std::to_string(i) + "]." + name;
  }
  std::string path_;
  const PlyElement& vertices_;
};

}  // namespace

void write_points(const std::filesystem::path& path, const std::vector<MeasuredPoint>& points,
                  bool unit_known) {
  const KnownProperties known = known_of(points);
  write_atomically(path, [&](std::ostream& stream) {
    stream << "ply\nformat binary_little_endian 1.0\ncomment unit "
           << (unit_known ? "mm" : "unknown") << ", world frame of rig.json\nelement vertex "
           << points.size() << "\n";
    for (const char* name : {"x", "y", "z", "u", "v"}) stream << "property float " << name << "\n";
    for (const char* name : {"camera", "projector", "pattern"}) {
      stream << "property uchar " << name << "\n";
    }
    stream << "property int line\n";  // Open3D reads no ushort into tensors
    for (const char* name : {"sigma", "confidence", "plane"}) {
      stream << "property float " << name << "\n";
    }
    if (known.normals) stream << "property float nx\nproperty float ny\nproperty float nz\n";
    if (known.colors) stream << "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    stream << "end_header\n";
    std::string bytes;
    for (const MeasuredPoint& point : points) {
      append_point(bytes, point, known);
      if (bytes.size() > (std::size_t{1} << 16)) {
        stream << bytes;
        bytes.clear();
      }
    }
    stream << bytes;
  });
}

std::vector<MeasuredPoint> read_points(const std::filesystem::path& path) {
  const PlyFile file = read_ply(path);
  const PlyElement* vertices = file.find("vertex");
  if (vertices == nullptr) throw InputError(path.string(), "", "", "must have an element `vertex`");
  refuse_curves(path, *vertices);
  const Columns columns(path.string(), *vertices);
  const auto& x = columns.required("x");
  const auto& y = columns.required("y");
  const auto& z = columns.required("z");
  const auto& u = columns.required("u");
  const auto& v = columns.required("v");
  const auto& camera = columns.required("camera");
  const auto& projector = columns.required("projector");
  const auto& line = columns.required("line");
  const auto* pattern = columns.optional("pattern");
  const auto* sigma = columns.optional("sigma");
  const auto* confidence = columns.optional("confidence");
  const auto* plane = columns.optional("plane");
  constexpr double kAnySize = std::numeric_limits<double>::infinity();
  std::vector<MeasuredPoint> points(vertices->count);
  for (std::size_t i = 0; i < points.size(); ++i) {
    MeasuredPoint& point = points[i];
    point.x = columns.finite("x", x, i);
    point.y = columns.finite("y", y, i);
    point.z = columns.finite("z", z, i);
    point.u = columns.finite("u", u, i);
    point.v = columns.finite("v", v, i);
    point.camera = columns.index<std::uint8_t>("camera", camera, i);
    point.projector = columns.index<std::uint8_t>("projector", projector, i);
    point.line = columns.index<std::uint16_t>("line", line, i);
    if (pattern != nullptr) point.pattern = columns.index<std::uint8_t>("pattern", *pattern, i);
    if (sigma != nullptr) point.sigma = columns.within("sigma", *sigma, i, kAnySize);
    point.confidence = confidence != nullptr ? columns.within("confidence", *confidence, i, 1) : 1;
    point.plane =
        plane != nullptr ? columns.finite("plane", *plane, i) : static_cast<float>(point.line);
  }
  return points;
}

}  // namespace pencilscan
