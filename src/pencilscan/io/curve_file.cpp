#include "pencilscan/io/curve_file.h"

#include <cmath>
#include <limits>
#include <string>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/little_endian.h"
#include "pencilscan/io/ply.h"

namespace pencilscan {
namespace {

// No uint and no ushort, which Open3D does not read into tensors.
constexpr const char* kVertexHeader =
    "property float x\nproperty float y\nproperty float z\nproperty float u\nproperty float "
    "v\nproperty float sigma_px\nproperty float amplitude\n"
    "property uchar camera\nproperty int curve\nproperty uchar family\nproperty uchar color\n"
    "property float color_lead\nproperty uchar state\nproperty uchar projector\n"
    "property uchar pattern\nproperty int line\nproperty float confidence\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\n";
constexpr const char* kEdgeHeader = "property int vertex1\nproperty int vertex2\n";
constexpr const char* kCrossingHeader =
    "property float u\nproperty float v\nproperty uchar camera\nproperty int curve_a\n"
    "property int curve_b\n";

void append(std::string& bytes, const CurveSample& s) {
  for (const float value : {s.x, s.y, s.z, s.u, s.v, s.sigma_px, s.amplitude})
    append_little_endian(bytes, value);
  append_little_endian(bytes, s.camera);
  append_little_endian(bytes, s.curve);
  append_little_endian(bytes, s.family);
  append_little_endian(bytes, s.color);
  append_little_endian(bytes, s.color_lead);
  append_little_endian(bytes, static_cast<std::uint8_t>(s.state));
  append_little_endian(bytes, s.projector);
  append_little_endian(bytes, s.pattern);
  append_little_endian(bytes, static_cast<std::int32_t>(s.line));
  append_little_endian(bytes, s.confidence);
  for (const auto value : {s.red, s.green, s.blue}) append_little_endian(bytes, value);
}

/// From a sample to the next one of its curve; places in the file.
struct CurveEdge {
  std::int32_t vertex1 = 0;
  std::int32_t vertex2 = 0;
};

void append(std::string& bytes, const CurveEdge& edge) {
  append_little_endian(bytes, edge.vertex1);
  append_little_endian(bytes, edge.vertex2);
}

std::vector<CurveEdge> edges_of(const std::vector<CurveSample>& samples) {
  std::vector<CurveEdge> edges;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const CurveSample& before = samples[i - 1];
    if (samples[i].camera == before.camera && samples[i].curve == before.curve)
      edges.push_back({static_cast<std::int32_t>(i - 1), static_cast<std::int32_t>(i)});
  }
  return edges;
}

void append(std::string& bytes, const CurveCrossing& crossing) {
  append_little_endian(bytes, crossing.u);
  append_little_endian(bytes, crossing.v);
  append_little_endian(bytes, crossing.camera);
  append_little_endian(bytes, crossing.curve_a);
  append_little_endian(bytes, crossing.curve_b);
}

template <class Item>
void write_items(std::ostream& stream, const std::vector<Item>& items) {
  std::string bytes;
  for (const Item& item : items) {
    append(bytes, item);
    if (bytes.size() > (std::size_t{1} << 16)) {
      stream << bytes;
      bytes.clear();
    }
  }
  stream << bytes;
}

/// The scalar properties of one element, checked as they are read.
class Fields {
 public:
  Fields(std::string path, const PlyElement& element) : path_(std::move(path)), element_(element) {}

  /// Property `name` of all items into `member` of each.
  template <class Item, class T>
  void into(std::vector<Item>& items, const char* name, T Item::*member, double highest) const {
    const PlyColumn* column = element_.find(name);
    if (column == nullptr || column->is_list) {
      throw InputError(path_, name, "", "must be a property of " + element_.name);
    }
    for (std::size_t i = 0; i < items.size(); ++i) {
      const double value = column->values[i];
      constexpr bool kInteger = !std::is_floating_point_v<T>;
      if (!std::isfinite(value) || (kInteger && !(value >= 0 && value <= highest))) {
        throw InputError(path_, element_.name + "[" + std::to_string(i) + "]." + name,
                         std::to_string(value), "must be finite and in range");
      }
      items[i].*member = static_cast<T>(value);
    }
  }

 private:
  std::string path_;
  const PlyElement& element_;
};

constexpr double kByte = std::numeric_limits<std::uint8_t>::max();
constexpr double kShort = std::numeric_limits<std::uint16_t>::max();
constexpr double kInt = std::numeric_limits<std::uint32_t>::max();
constexpr double kAnyFloat = 0;  // unused for floats

}  // namespace

void write_curves(const std::filesystem::path& path, const CurveFile& curves) {
  const std::vector<CurveEdge> edges = edges_of(curves.samples);
  write_atomically(path, [&](std::ostream& stream) {
    stream << "ply\nformat binary_little_endian 1.0\ncomment detected curves, camera pixels\n"
           << "element vertex " << curves.samples.size() << "\n"
           << kVertexHeader << "element edge " << edges.size() << "\n"
           << kEdgeHeader << "element crossing " << curves.crossings.size() << "\n"
           << kCrossingHeader << "end_header\n";
    write_items(stream, curves.samples);
    write_items(stream, edges);
    write_items(stream, curves.crossings);
  });
}

void refuse_curves(const std::filesystem::path& path, const PlyElement& vertices) {
  if (vertices.find("sigma_px") == nullptr || vertices.find("curve") == nullptr) return;
  throw InputError(
      path.string(), "", "",
      "must hold points of the object, as points.ply does: these are curves in pictures "
      "(curves.ply), which lie where a viewer shows the pictures");
}

CurveFile read_curves(const std::filesystem::path& path) {
  const PlyFile file = read_ply(path);
  CurveFile curves;
  const PlyElement* vertices = file.find("vertex");
  const PlyElement* crossings = file.find("crossing");
  if (vertices == nullptr || crossings == nullptr) {
    throw InputError(path.string(), "", "", "must have the elements `vertex` and `crossing`");
  }
  auto& samples = curves.samples;
  samples.resize(vertices->count);
  const Fields of_sample(path.string(), *vertices);
  of_sample.into(samples, "u", &CurveSample::u, kAnyFloat);
  of_sample.into(samples, "v", &CurveSample::v, kAnyFloat);
  of_sample.into(samples, "sigma_px", &CurveSample::sigma_px, kAnyFloat);
  of_sample.into(samples, "amplitude", &CurveSample::amplitude, kAnyFloat);
  of_sample.into(samples, "camera", &CurveSample::camera, kByte);
  of_sample.into(samples, "curve", &CurveSample::curve, kInt);
  of_sample.into(samples, "family", &CurveSample::family, kByte);
  of_sample.into(samples, "color", &CurveSample::color, kByte);
  of_sample.into(samples, "color_lead", &CurveSample::color_lead, kAnyFloat);
  of_sample.into(samples, "state", &CurveSample::state,
                 static_cast<double>(CurveState::kUndecided));
  of_sample.into(samples, "projector", &CurveSample::projector, kByte);
  of_sample.into(samples, "pattern", &CurveSample::pattern, kByte);
  of_sample.into(samples, "line", &CurveSample::line, kShort);
  of_sample.into(samples, "confidence", &CurveSample::confidence, kAnyFloat);
  curves.crossings.resize(crossings->count);
  const Fields of_crossing(path.string(), *crossings);
  of_crossing.into(curves.crossings, "u", &CurveCrossing::u, kAnyFloat);
  of_crossing.into(curves.crossings, "v", &CurveCrossing::v, kAnyFloat);
  of_crossing.into(curves.crossings, "camera", &CurveCrossing::camera, kByte);
  of_crossing.into(curves.crossings, "curve_a", &CurveCrossing::curve_a, kInt);
  of_crossing.into(curves.crossings, "curve_b", &CurveCrossing::curve_b, kInt);
  return curves;
}

}  // namespace pencilscan
