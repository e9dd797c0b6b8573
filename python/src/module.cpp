// The compiled part of the Python package: values of the library as arrays that share their memory.
// python/pencilscan/ gives it keyword arguments, defaults and documentation.

#include "module.h"

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <variant>
#include <vector>

#include "pencilscan/core/parallel.h"

namespace pencilscan::python {
namespace {

// ---- errors -------------------------------------------------------------------------------------

/// Raises `name` of pencilscan._errors with the given arguments.
template <class... Arguments>
void raise(const char* name, Arguments&&... arguments) {
  const py::object type = py::module_::import("pencilscan._errors").attr(name);
  PyErr_SetObject(type.ptr(), type(std::forward<Arguments>(arguments)...).ptr());
}

/// As Python has text from outside: names of files need not be UTF-8.
py::object text_of(std::string_view text) {
  return py::reinterpret_steal<py::object>(
      PyUnicode_DecodeUTF8(text.data(), static_cast<py::ssize_t>(text.size()), "surrogateescape"));
}

void translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const InputError& error) {
    raise("InputError", text_of(error.path), text_of(error.field), text_of(error.value),
          text_of(error.rule));
  } catch (const StageError& error) {
    raise("StageError", text_of(error.what()));
  } catch (const Cancelled& error) {
    raise("Cancelled", error.what());
  }
}

// ---- values -------------------------------------------------------------------------------------

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
      .def("write", [](const TriangleMesh& mesh, const std::string& path, bool unit_known) {
        const Unlocked unlocked;
        if (path.ends_with(".ply")) {
          write_mesh(path, mesh, unit_known);
        } else {
          export_mesh(path, mesh, unit_known);
        }
      });
  module.def("read_mesh", [](const std::string& path) {
    const Unlocked unlocked;
    return std::make_shared<TriangleMesh>(read_mesh(path));
  });
  module.def("mesh_unit_known", [](const std::string& path) { return mesh_unit_known(path); });
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
      .def_readonly("unit_known", &Rig::unit_known)
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

// ---- simulation, judgement, calibration ---------------------------------------------------------

/// Of the whole process while it lives; 0: as it is.
std::unique_ptr<ThreadLimit> thread_limit(int threads) {
  return threads > 0 ? std::make_unique<ThreadLimit>(threads) : nullptr;
}

void add_simulation(py::module_& module) {
  module.def("simulate", [](const Rig& rig, const TriangleMesh& mesh, const std::string& noise,
                            std::uint64_t seed, bool fit, const std::string& up, int bits,
                            double albedo, bool smooth, int frame, double rotate_rad,
                            const std::array<double, 3>& translate_mm, int threads,
                            const py::object& progress) {
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
      const Unlocked unlocked;
      const auto limit = thread_limit(threads);
      simulated = simulate(rig, mesh, options);
    }
    py::dict images;
    for (const auto& [name, image] : simulated.images) images[name.c_str()] = matrix_view(image);
    return py::make_tuple(images, std::make_shared<TriangleMesh>(std::move(simulated.truth)));
  });
}

void add_judgement(py::module_& module) {
  module.def("judge", [](const TriangleMesh& truth, const Rig& rig, const Reconstruction* result,
                         const std::string& points_path, const TriangleMesh* measured,
                         const std::string& align, std::uint64_t seed, int threads,
                         const py::object& progress) {
    JudgementOptions options;
    options.align = align;
    options.seed = seed;
    options.progress = listener(progress);
    const Unlocked unlocked;
    const auto limit = thread_limit(threads);
    if (result != nullptr) return judge(truth, rig, *result, options);
    std::vector<MeasuredPoint> points;
    if (!points_path.empty()) points = read_points(points_path);
    return judge(truth, rig, points_path.empty() ? nullptr : &points, measured, options);
  });
}

void add_calibration(py::module_& module) {
  module.def("calibrate", [](const std::optional<std::string>& devices_path,
                             const std::string& devices_text,
                             const std::vector<std::string>& captures,
                             const std::optional<std::tuple<std::string, std::string, double>>&
                                 known,
                             const std::string& board, std::optional<double> focal_tolerance,
                             std::optional<double> center_tolerance, std::size_t max_tracks,
                             std::uint64_t seed, int threads, const py::object& progress) {
    RigCalibrationOptions options;
    if (known)
      options.known_distance = {{std::get<0>(*known), std::get<1>(*known)}, std::get<2>(*known)};
    options.board = board;
    options.focal_tolerance = focal_tolerance;
    options.center_tolerance = center_tolerance;
    options.max_tracks = max_tracks;
    options.seed = seed;
    options.progress = listener(progress);
    CalibratedRig found;
    {
      const Unlocked unlocked;
      const auto limit = thread_limit(threads);
      const UncalibratedRig devices =
          devices_path ? read_devices(*devices_path) : devices_from_text(devices_text);
      found = calibrate_rig(devices, {captures.begin(), captures.end()}, options);
    }
    return py::make_tuple(std::make_shared<Rig>(std::move(found.rig)), found.verdict, found.reasons,
                          found.figures, found.report);
  });
}

// ---- the end of the interpreter -----------------------------------------------------------------

/// The calls at work without the interpreter's lock.
struct Calls {
  std::mutex mutex;
  std::condition_variable changed;
  int running = 0;
  std::optional<std::thread::id> ending;  ///< the thread that ends the interpreter
};

/// Never destroyed: threads of daemons may hold it when the process ends.
Calls* calls = new Calls;

/// True in all threads but the one that ends the interpreter. `calls->mutex` is locked.
bool is_left_behind() { return calls->ending && *calls->ending != std::this_thread::get_id(); }

/// Stops the calls of daemon threads and waits for them, at the interpreter's exit.
void end_calls() {
  constexpr auto kInterval = std::chrono::milliseconds(50);  // Ctrl-C is noticed within it
  for (bool ended = false; !ended;) {
    {
      const py::gil_scoped_release unlocked;
      std::unique_lock lock(calls->mutex);
      calls->ending = std::this_thread::get_id();
      ended = calls->changed.wait_for(lock, kInterval, [] { return calls->running <= 0; });
    }
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  }
}

void watch_exit() {
  py::module_::import("atexit").attr("register")(py::cpp_function(&end_calls));
  // Calls of other threads do not go on in a child.
  py::module_::import("os").attr("register_at_fork")(
      py::arg("after_in_child") = py::cpp_function([] { calls = new Calls; }));
}

}  // namespace

Unlocked::Unlocked() {
  std::unique_lock lock(calls->mutex);
  while (is_left_behind()) calls->changed.wait(lock);
  ++calls->running;
}

Unlocked::~Unlocked() {
  std::unique_lock lock(calls->mutex);
  --calls->running;
  calls->changed.notify_all();
  while (is_left_behind()) calls->changed.wait(lock);
}

StageListener listener(const py::object& progress) {
  return [progress = progress.ptr()](std::string_view stage, double done) {
    const py::gil_scoped_acquire lock;
    {
      const std::lock_guard guard(calls->mutex);
      if (is_left_behind()) return false;
    }
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (Py_IsNone(progress) != 0) return true;
    const py::object answer =
        py::reinterpret_borrow<py::object>(progress)(py::str(stage.data(), stage.size()), done);
    // NumPy has a False of its own: `return error < limit` of its numbers.
    const bool is_truth = py::isinstance<py::bool_>(answer) ||
                          py::isinstance(answer, py::dtype::of<bool>().attr("type"));
    return !is_truth || PyObject_IsTrue(answer.ptr()) != 0;
  };
}

}  // namespace pencilscan::python

PYBIND11_MODULE(_core, module) {
  using namespace pencilscan::python;
  module.attr("version") = pencilscan::version();
  py::register_exception_translator(&translate);
  watch_exit();
  add_mesh(module);
  add_rig(module);
  add_frame(module);
  add_simulation(module);
  add_judgement(module);
  add_calibration(module);
}
