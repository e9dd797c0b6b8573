// Frames in the Python package: pictures, results, and the stages between them.

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "module.h"

namespace pencilscan::python {
namespace {

// ---- a frame and its result ---------------------------------------------------------------------

/// A dictionary of arrays as pictures; the arrays are kept as long as this.
struct Pictures {
  Pictures(const py::dict& arrays, const std::string& argument) {
    for (const auto& [key, array] : arrays) {
      const auto name = key.cast<std::string>();
      images.emplace(name, picture(argument, name, array, kept));
    }
  }
  Images images;
  std::vector<py::array> kept;
};

using ResultPtr = std::shared_ptr<Reconstruction>;

/// Arrays over the elements of a result's vector, by the names of the properties in the file.
template <class Element>
class Fields {
 public:
  Fields(const std::vector<Element>& values, const py::object& owner)
      : values_(values), owner_(owner) {}

  template <class T>
  void add(const char* name, T Element::*field, py::ssize_t columns = 0) {
    const Element example{};
    const auto offset = static_cast<std::size_t>(reinterpret_cast<const char*>(&(example.*field)) -
                                                 reinterpret_cast<const char*>(&example));
    using Stored = typename std::conditional_t<std::is_enum_v<T>, std::underlying_type<T>,
                                               std::type_identity<T>>::type;
    arrays_[name] = field_view<Element, Stored>(values_, offset, columns, owner_);
  }
  [[nodiscard]] py::dict arrays() const { return arrays_; }

 private:
  const std::vector<Element>& values_;
  py::object owner_;
  py::dict arrays_;
};

py::dict point_arrays(const ResultPtr& result) {
  using P = MeasuredPoint;
  Fields<P> fields(result->points, py::cast(result));
  static_assert(offsetof(P, y) == offsetof(P, x) + sizeof(float) &&
                offsetof(P, z) == offsetof(P, y) + sizeof(float) &&
                offsetof(P, v) == offsetof(P, u) + sizeof(float) &&
                offsetof(P, ny) == offsetof(P, nx) + sizeof(float) &&
                offsetof(P, nz) == offsetof(P, ny) + sizeof(float) &&
                offsetof(P, green) == offsetof(P, red) + 1 &&
                offsetof(P, blue) == offsetof(P, green) + 1);
  fields.add("xyz", &P::x, 3);
  fields.add("uv", &P::u, 2);
  fields.add("x", &P::x);
  fields.add("y", &P::y);
  fields.add("z", &P::z);
  fields.add("u", &P::u);
  fields.add("v", &P::v);
  fields.add("camera", &P::camera);
  fields.add("projector", &P::projector);
  fields.add("pattern", &P::pattern);
  fields.add("line", &P::line);
  fields.add("sigma", &P::sigma);
  fields.add("confidence", &P::confidence);
  fields.add("plane", &P::plane);
  fields.add("normal", &P::nx, 3);
  fields.add("nx", &P::nx);
  fields.add("ny", &P::ny);
  fields.add("nz", &P::nz);
  fields.add("color", &P::red, 3);
  fields.add("red", &P::red);
  fields.add("green", &P::green);
  fields.add("blue", &P::blue);
  return fields.arrays();
}

/// `owner` keeps the samples alive.
py::dict curve_arrays(const CurveFile& curves, const py::object& owner) {
  using C = CurveSample;
  Fields<C> fields(curves.samples, owner);
  static_assert(offsetof(C, y) == offsetof(C, x) + sizeof(float) &&
                offsetof(C, z) == offsetof(C, y) + sizeof(float) &&
                offsetof(C, v) == offsetof(C, u) + sizeof(float) &&
                offsetof(C, green) == offsetof(C, red) + 1 &&
                offsetof(C, blue) == offsetof(C, green) + 1);
  fields.add("xyz", &C::x, 3);
  fields.add("x", &C::x);
  fields.add("y", &C::y);
  fields.add("z", &C::z);
  fields.add("uv", &C::u, 2);
  fields.add("u", &C::u);
  fields.add("v", &C::v);
  fields.add("sigma_px", &C::sigma_px);
  fields.add("amplitude", &C::amplitude);
  fields.add("camera", &C::camera);
  fields.add("curve", &C::curve);
  fields.add("family", &C::family);
  fields.add("color", &C::color);
  fields.add("color_lead", &C::color_lead);
  fields.add("state", &C::state);
  fields.add("projector", &C::projector);
  fields.add("pattern", &C::pattern);
  fields.add("line", &C::line);
  fields.add("confidence", &C::confidence);
  fields.add("rgb", &C::red, 3);
  fields.add("red", &C::red);
  fields.add("green", &C::green);
  fields.add("blue", &C::blue);
  return fields.arrays();
}

py::dict crossing_arrays(const CurveFile& curves, const py::object& owner) {
  using C = CurveCrossing;
  Fields<C> fields(curves.crossings, owner);
  fields.add("uv", &C::u, 2);
  fields.add("u", &C::u);
  fields.add("v", &C::v);
  fields.add("camera", &C::camera);
  fields.add("curve_a", &C::curve_a);
  fields.add("curve_b", &C::curve_b);
  return fields.arrays();
}

py::dict depth_arrays(const ResultPtr& result) {
  py::dict arrays;
  for (const CameraDepth& camera : result->depth)
    arrays[camera.camera.c_str()] =
        py::make_tuple(matrix_view(camera.depth), matrix_view(camera.sigma));
  return arrays;
}

/// A part of a result, which stays alive with it; None where it is empty.
py::object part(const ResultPtr& result, TriangleMesh& mesh) {
  if (mesh.vertices.empty()) return py::none();
  return py::cast(MeshPtr(result, &mesh));
}

void add_results(py::module_& module) {
  py::class_<Pictures, std::shared_ptr<Pictures>>(module, "Pictures")
      .def(py::init<const py::dict&, const std::string&>(), py::arg("arrays"),
           py::arg("argument") = "images")
      .def("views", [](const std::shared_ptr<Pictures>& pictures) {
        py::dict views;
        for (const auto& [name, image] : pictures->images)
          views[name.c_str()] = matrix_view(image.stored(), py::cast(pictures));
        return views;
      });
  py::class_<Reconstruction, ResultPtr>(module, "Reconstruction")
      .def_property_readonly("points", &point_arrays)
      .def_property_readonly(
          "curves", [](const ResultPtr& r) { return curve_arrays(r->curves, py::cast(r)); })
      .def_property_readonly(
          "crossings", [](const ResultPtr& r) { return crossing_arrays(r->curves, py::cast(r)); })
      .def_property_readonly("depth", &depth_arrays)
      .def_readonly("unit_known", &Reconstruction::unit_known)
      .def_property_readonly("mesh", [](const ResultPtr& r) { return part(r, r->mesh); })
      .def_property_readonly("measured", [](const ResultPtr& r) { return part(r, r->measured); })
      .def_property_readonly("report", [](const Reconstruction& r) { return r.report; })
      .def("write", [](const Reconstruction& r, const std::string& folder) {
        const Unlocked unlocked;
        write_reconstruction(folder, r);
      });
  module.def("reconstruct", [](const Rig& rig, const Pictures& pictures, const Pictures& plain,
                               const std::string& method, const std::string& multiview_cost,
                               bool mesh, bool depth, bool depth_maps, const std::string& frame,
                               int threads, const py::object& progress) {
    ReconstructionOptions options;
    options.method = method;
    options.multiview_cost = multiview_cost;
    options.mesh = mesh;
    options.depth = depth;
    options.depth_maps = depth_maps;
    options.plain = plain.images;
    options.frame = frame;
    options.threads = threads;
    options.progress = listener(progress);
    const Unlocked unlocked;
    return std::make_shared<Reconstruction>(reconstruct(rig, pictures.images, options));
  });
}

// ---- a frame stage by stage ---------------------------------------------------------------------

using DetectedPtr = std::shared_ptr<DetectedFrame>;

/// The labels of all curve points.
struct Labels {
  std::vector<PointLabel> values;
};
using LabelsPtr = std::shared_ptr<Labels>;

template <class T>
using Column = py::array_t<T, py::array::c_style | py::array::forcecast>;

LabelsPtr labels_of_arrays(const Column<int>& projector, const Column<int>& pattern,
                           const Column<int>& line, const Column<float>& confidence,
                           const Column<double>& plane) {
  auto labels = std::make_shared<Labels>();
  const py::ssize_t count = projector.size();
  const auto check = [&](const py::array& column, const char* field) {
    if (column.ndim() != 1 || column.size() != count)
      throw InputError("labels", field, std::to_string(column.size()),
                       "must be " + std::to_string(count) + " values, one for each of projector");
  };
  check(projector, "projector");
  check(pattern, "pattern");
  check(line, "line");
  check(confidence, "confidence");
  check(plane, "plane");
  // What is too large is refused with the rig at hand.
  const auto narrow = [](int value, const char* field) {
    if (value < -1)
      throw InputError("labels", field, std::to_string(value), "must be an index, or -1: none");
    return static_cast<std::int16_t>(std::min(value, 32767));
  };
  for (py::ssize_t i = 0; i < count; ++i)
    labels->values.push_back({narrow(projector.at(i), "projector"),
                              narrow(pattern.at(i), "pattern"), line.at(i), confidence.at(i),
                              plane.at(i)});
  return labels;
}

py::dict label_arrays(const LabelsPtr& labels) {
  using L = PointLabel;
  Fields<L> fields(labels->values, py::cast(labels));
  fields.add("projector", &L::projector);
  fields.add("pattern", &L::pattern);
  fields.add("line", &L::line);
  fields.add("confidence", &L::confidence);
  fields.add("plane", &L::plane);
  return fields.arrays();
}

py::dict grid_arrays(const DetectedPtr& detected) {
  using G = GridCurve;
  Fields<G> fields(detected->grid(), py::cast(detected));
  fields.add("camera", &G::camera);
  fields.add("curve", &G::curve);
  fields.add("component", &G::component);
  fields.add("projector", &G::projector);
  fields.add("pattern", &G::pattern);
  fields.add("local_id", &G::local_id);
  fields.add("id_probability", &G::id_probability);
  return fields.arrays();
}

void add_stages(py::module_& module) {
  py::class_<Labels, LabelsPtr>(module, "Labels")
      .def(py::init(&labels_of_arrays))
      .def_property_readonly("arrays", &label_arrays);
  py::class_<DetectedFrame, DetectedPtr>(module, "DetectedFrame")
      .def_property_readonly(
          "curves", [](const DetectedPtr& d) { return curve_arrays(d->curves(), py::cast(d)); })
      .def_property_readonly(
          "crossings",
          [](const DetectedPtr& d) { return crossing_arrays(d->curves(), py::cast(d)); })
      .def_property_readonly("grid", &grid_arrays)
      .def_property_readonly("rig",
                             [](const DetectedPtr& d) { return std::make_shared<Rig>(d->rig()); });
  module.def("detect", [](const Rig& rig, const Pictures& pictures, const Pictures& plain,
                          const std::string& method, bool identities, const std::string& frame,
                          int threads, const py::object& progress) {
    ReconstructionOptions options;
    options.method = method;
    options.plain = plain.images;
    options.frame = frame;
    options.threads = threads;
    options.progress = listener(progress);
    const Unlocked unlocked;
    return std::make_shared<DetectedFrame>(detect(rig, pictures.images, options, identities));
  });
  module.def("label",
             [](const DetectedFrame& detected, const std::string& method,
                const std::string& multiview_cost, int threads, const py::object& progress) {
               ReconstructionOptions options;
               options.method = method;
               options.multiview_cost = multiview_cost;
               options.threads = threads;
               options.progress = listener(progress);
               const Unlocked unlocked;
               return std::make_shared<Labels>(Labels{label(detected, options)});
             });
  module.def("measure", [](const DetectedFrame& detected, const Labels& labels,
                           const std::string& method, bool mesh, bool depth, bool depth_maps,
                           int threads, const py::object& progress) {
    ReconstructionOptions options;
    options.method = method;
    options.mesh = mesh;
    options.depth = depth;
    options.depth_maps = depth_maps;
    options.threads = threads;
    options.progress = listener(progress);
    const Unlocked unlocked;
    return std::make_shared<Reconstruction>(reconstruct(detected, labels.values, options));
  });
}

}  // namespace

void add_frame(py::module_& module) {
  add_results(module);
  add_stages(module);
}

}  // namespace pencilscan::python
