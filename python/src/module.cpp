// The compiled part of the Python package: values of the library as arrays that share their memory.
// python/pencilscan/ gives it keyword arguments, defaults and documentation.

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "arrays.h"
#include "pencilscan/pencilscan.h"

namespace pencilscan::python {
namespace {

// ---- errors and listeners -----------------------------------------------------------------------

/// Raises `name` of pencilscan._errors with the given arguments.
template <class... Arguments>
void raise(const char* name, Arguments&&... arguments) {
  const py::object type = py::module_::import("pencilscan._errors").attr(name);
  PyErr_SetObject(type.ptr(), type(std::forward<Arguments>(arguments)...).ptr());
}

void translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const InputError& error) {
    raise("InputError", error.path, error.field, error.value, error.rule);
  } catch (const StageError& error) {
    raise("StageError", error.what());
  } catch (const Cancelled& error) {
    raise("Cancelled", error.what());
  }
}

/// Lets Ctrl-C through, and calls `progress(stage, done)` unless it is None: False ends the call.
StageListener listener(const py::object& progress) {
  return [progress = progress.ptr()](std::string_view stage, double done) {
    const py::gil_scoped_acquire lock;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (Py_IsNone(progress) != 0) return true;
    const py::object answer =
        py::reinterpret_borrow<py::object>(progress)(py::str(stage.data(), stage.size()), done);
    return !answer.is(py::bool_(false));
  };
}

// ---- values -------------------------------------------------------------------------------------

/// A dictionary of arrays as pictures; the arrays are kept as long as this.
struct Pictures {
  explicit Pictures(const py::dict& arrays) {
    for (const auto& [key, array] : arrays) {
      const auto name = key.cast<std::string>();
      images.emplace(name, picture(name, array, kept));
    }
  }
  Images images;
  std::vector<py::array> kept;
};

using MeshPtr = std::shared_ptr<TriangleMesh>;

template <class T>
py::object optional_view(const std::vector<T>& values, const py::object& owner) {
  if (values.empty()) return py::none();
  return field_view<T, T>(values, 0, 0, owner);
}

MeshPtr mesh_of_arrays(
    const py::array_t<double, py::array::c_style | py::array::forcecast>& vertices,
    const py::array_t<int, py::array::c_style | py::array::forcecast>& faces) {
  const auto check = [](const py::array& array, const char* field) {
    if (array.ndim() != 2 || array.shape(1) != 3)
      throw InputError("mesh", field, "", std::string("must have the shape (n, 3)"));
  };
  check(vertices, "vertices");
  check(faces, "faces");
  auto mesh = std::make_shared<TriangleMesh>();
  for (py::ssize_t i = 0; i < vertices.shape(0); ++i) {
    mesh->vertices.emplace_back(vertices.at(i, 0), vertices.at(i, 1), vertices.at(i, 2));
    if (!mesh->vertices.back().allFinite())
      throw InputError("mesh", "vertices[" + std::to_string(i) + "]", "", "must be finite");
  }
  for (py::ssize_t i = 0; i < faces.shape(0); ++i) {
    const std::array<int, 3> face{faces.at(i, 0), faces.at(i, 1), faces.at(i, 2)};
    for (const int corner : face) {
      if (corner < 0 || corner >= vertices.shape(0)) {
        throw InputError("mesh", "faces[" + std::to_string(i) + "]", std::to_string(corner),
                         "must be an index of a vertex");
      }
    }
    mesh->faces.push_back(face);
  }
  if (mesh->faces.empty()) throw InputError("mesh", "faces", "0", "the mesh must have faces");
  return mesh;
}

void add_mesh(py::module_& module) {
  const auto self_of = [](const MeshPtr& mesh) { return py::cast(mesh); };
  py::class_<TriangleMesh, MeshPtr>(module, "Mesh")
      .def(py::init(&mesh_of_arrays), py::arg("vertices"), py::arg("faces"))
      .def_property_readonly("vertices",
                             [=](const MeshPtr& mesh) {
                               return field_view<Vec3, double>(mesh->vertices, 0, 3, self_of(mesh));
                             })
      .def_property_readonly("faces",
                             [=](const MeshPtr& mesh) {
                               return field_view<std::array<int, 3>, int>(mesh->faces, 0, 3,
                                                                          self_of(mesh));
                             })
      .def_property_readonly(
          "sigma", [=](const MeshPtr& mesh) { return optional_view(mesh->sigma, self_of(mesh)); })
      .def_property_readonly(
          "confidence",
          [=](const MeshPtr& mesh) { return optional_view(mesh->confidence, self_of(mesh)); })
      .def_property_readonly(
          "hole", [=](const MeshPtr& mesh) { return optional_view(mesh->hole, self_of(mesh)); })
      .def_property_readonly("color",
                             [=](const MeshPtr& mesh) -> py::object {
                               if (mesh->color.empty()) return py::none();
                               return field_view<std::array<float, 3>, float>(mesh->color, 0, 3,
                                                                              self_of(mesh));
                             })
      .def_property_readonly("area_mm2", [](const TriangleMesh& m) { return surface_area(m); })
      .def_property_readonly("volume_mm3", [](const TriangleMesh& m) { return signed_volume(m); })
      .def(
          "normals",
          [](const TriangleMesh& mesh) {
            const auto normals = std::make_unique<std::vector<Vec3>>(vertex_normals(mesh));
            py::array_t<double> result({static_cast<py::ssize_t>(normals->size()), py::ssize_t{3}});
            std::copy_n(normals->empty() ? nullptr : normals->front().data(), 3 * normals->size(),
                        result.mutable_data());
            return result;
          })
      .def("write", [](const TriangleMesh& mesh, const std::string& path) {
        const py::gil_scoped_release unlocked;
        if (path.ends_with(".ply")) {
          write_mesh(path, mesh);
        } else {
          export_mesh(path, mesh);
        }
      });
  module.def("read_mesh", [](const std::string& path) {
    const py::gil_scoped_release unlocked;
    return std::make_shared<TriangleMesh>(read_mesh(path));
  });
  module.def("make_sphere", [](double radius_mm, int rings) {
    return std::make_shared<TriangleMesh>(make_sphere(radius_mm, rings));
  });
}

/// Colours of each projector's pattern: names, or linear light [r, g, b].
using StatedColor = std::variant<std::string, Rgb>;

PatternColor color_of(const StatedColor& stated) {
  if (const auto* name = std::get_if<std::string>(&stated)) {
    if (!color_from_name(*name))
      throw InputError("ring", "colors", *name,
                       "must be blue, cyan, red, yellow, green, magenta or white, or [r, g, b]");
    return PatternColor(*name);
  }
  const Rgb& light = std::get<Rgb>(stated);
  const bool inside =
      std::all_of(light.begin(), light.end(), [](double v) { return v >= 0 && v <= 1; });
  if (!inside || light == Rgb{})
    throw InputError("ring", "colors",
                     "[" + std::to_string(light[0]) + ", " + std::to_string(light[1]) + ", " +
                         std::to_string(light[2]) + "]",
                     "each must be in [0, 1], not all 0");
  return PatternColor(light);
}

void set_ring_colors(RingOptions& options, const std::vector<std::vector<StatedColor>>& stated) {
  options.colors.clear();
  for (const auto& colors : stated) {
    options.colors.emplace_back();
    for (const StatedColor& color : colors) options.colors.back().push_back(color_of(color));
  }
}

void add_rig(py::module_& module) {
  py::class_<Rig, std::shared_ptr<Rig>>(module, "Rig")
      .def(py::init([](const std::string& text, const std::string& name) {
        return std::make_shared<Rig>(rig_from_text(text, name));
      }))
      .def("text", &rig_text)
      .def("write", [](const Rig& rig, const std::string& path) { write_rig(rig, path); })
      .def("volume",
           [](const Rig& rig) {
             const Sphere volume = working_volume(rig);
             return std::tuple(volume.center.x(), volume.center.y(), volume.center.z(),
                               volume.radius);
           })
      .def_property_readonly("cameras",
                             [](const Rig& rig) {
                               std::vector<std::string> names;
                               for (const Camera& camera : rig.cameras)
                                 names.push_back(camera.name);
                               return names;
                             })
      .def_property_readonly("projectors", [](const Rig& rig) {
        std::vector<std::string> names;
        for (const Projector& projector : rig.projectors) names.push_back(projector.name);
        return names;
      });
  module.def("read_rig",
             [](const std::string& path) { return std::make_shared<Rig>(read_rig(path)); });
  py::class_<RingOptions>(module, "RingOptions")
      .def(py::init())
      .def_readwrite("cameras", &RingOptions::cameras)
      .def_readwrite("projectors", &RingOptions::projectors)
      .def_readwrite("distance_mm", &RingOptions::distance_mm)
      .def_readwrite("arc_rad", &RingOptions::arc_rad)
      .def_readwrite("camera_elevation_rad", &RingOptions::camera_elevation_rad)
      .def_readwrite("vertical_elevation_rad", &RingOptions::vertical_elevation_rad)
      .def_readwrite("horizontal_elevation_rad", &RingOptions::horizontal_elevation_rad)
      .def_readwrite("volume_radius_mm", &RingOptions::volume_radius_mm)
      .def_readwrite("camera_width", &RingOptions::camera_width)
      .def_readwrite("camera_height", &RingOptions::camera_height)
      .def_readwrite("camera_focal_px", &RingOptions::camera_focal_px)
      .def_readwrite("projector_width", &RingOptions::projector_width)
      .def_readwrite("projector_height", &RingOptions::projector_height)
      .def_readwrite("projector_focal_px", &RingOptions::projector_focal_px)
      .def_readwrite("pitch_px", &RingOptions::pitch_px)
      .def_readwrite("line_width_px", &RingOptions::line_width_px)
      .def_readwrite("offset_px", &RingOptions::offset_px)
      .def_readwrite("order", &RingOptions::order)
      .def_property("colors", nullptr, set_ring_colors);
  module.def("make_ring",
             [](const RingOptions& options) { return std::make_shared<Rig>(make_ring(options)); });
}

// ---- a frame and its result ---------------------------------------------------------------------

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

py::dict curve_arrays(const ResultPtr& result) {
  using C = CurveSample;
  Fields<C> fields(result->curves.samples, py::cast(result));
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
  return fields.arrays();
}

py::dict crossing_arrays(const ResultPtr& result) {
  using C = CurveCrossing;
  Fields<C> fields(result->curves.crossings, py::cast(result));
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

void add_frame(py::module_& module) {
  py::class_<Pictures, std::shared_ptr<Pictures>>(module, "Pictures")
      .def(py::init<const py::dict&>())
      .def("views", [](const std::shared_ptr<Pictures>& pictures) {
        py::dict views;
        for (const auto& [name, image] : pictures->images)
          views[name.c_str()] = matrix_view(image.stored(), py::cast(pictures));
        return views;
      });
  py::class_<Reconstruction, ResultPtr>(module, "Reconstruction")
      .def_property_readonly("points", &point_arrays)
      .def_property_readonly("curves", &curve_arrays)
      .def_property_readonly("crossings", &crossing_arrays)
      .def_property_readonly("depth", &depth_arrays)
      .def_property_readonly("mesh", [](const ResultPtr& r) { return part(r, r->mesh); })
      .def_property_readonly("measured", [](const ResultPtr& r) { return part(r, r->measured); })
      .def_property_readonly("report", [](const Reconstruction& r) { return r.report; })
      .def("write", [](const Reconstruction& r, const std::string& folder) {
        const py::gil_scoped_release unlocked;
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
    const py::gil_scoped_release unlocked;
    return std::make_shared<Reconstruction>(reconstruct(rig, pictures.images, options));
  });
}

// ---- simulation, judgement, calibration ---------------------------------------------------------

void add_others(py::module_& module) {
  module.def("simulate", [](const Rig& rig, const TriangleMesh& mesh, const std::string& noise,
                            std::uint64_t seed, bool fit, const std::string& up, int bits,
                            double albedo, bool smooth, int frame, double rotate_rad,
                            const std::array<double, 3>& translate_mm, const py::object& progress) {
    SimulationOptions options;
    options.noise = noise;
    options.seed = seed;
    options.fit = fit;
    options.up = up;
    options.bits = bits;
    options.albedo = albedo;
    options.smooth = smooth;
    options.frame = frame;
    options.rotate_rad = rotate_rad;
    options.translate_mm = Vec3(translate_mm[0], translate_mm[1], translate_mm[2]);
    options.progress = listener(progress);
    SimulatedFrame simulated;
    {
      const py::gil_scoped_release unlocked;
      simulated = simulate(rig, mesh, options);
    }
    py::dict images;
    for (const auto& [name, image] : simulated.images) images[name.c_str()] = matrix_view(image);
    return py::make_tuple(images, std::make_shared<TriangleMesh>(std::move(simulated.truth)));
  });
  module.def("judge", [](const TriangleMesh& truth, const Rig& rig, const Reconstruction* result,
                         const std::string& points_path, const TriangleMesh* measured,
                         const std::string& align, std::uint64_t seed, const py::object& progress) {
    JudgementOptions options;
    options.align = align;
    options.seed = seed;
    options.progress = listener(progress);
    const py::gil_scoped_release unlocked;
    if (result != nullptr) return judge(truth, rig, *result, options);
    std::vector<MeasuredPoint> points;
    if (!points_path.empty()) points = read_points(points_path);
    return judge(truth, rig, points_path.empty() ? nullptr : &points, measured, options);
  });
  module.def("calibrate", [](const std::optional<std::string>& devices_path,
                             const std::string& devices_text,
                             const std::vector<std::string>& captures,
                             const std::optional<std::tuple<std::string, std::string, double>>&
                                 known,
                             const std::string& board, std::size_t max_tracks, std::uint64_t seed,
                             const py::object& progress) {
    RigCalibrationOptions options;
    if (known)
      options.known_distance = {{std::get<0>(*known), std::get<1>(*known)}, std::get<2>(*known)};
    options.board = board;
    options.max_tracks = max_tracks;
    options.seed = seed;
    options.progress = listener(progress);
    CalibratedRig found;
    {
      const py::gil_scoped_release unlocked;
      const UncalibratedRig devices =
          devices_path ? read_devices(*devices_path) : devices_from_text(devices_text);
      found = calibrate_rig(devices, {captures.begin(), captures.end()}, options);
    }
    return py::make_tuple(std::make_shared<Rig>(std::move(found.rig)), found.verdict, found.reasons,
                          found.figures, found.report);
  });
}

}  // namespace
}  // namespace pencilscan::python

PYBIND11_MODULE(_core, module) {
  using namespace pencilscan::python;
  module.attr("version") = pencilscan::version();
  py::register_exception_translator(&translate);
  add_mesh(module);
  add_rig(module);
  add_frame(module);
  add_others(module);
}
