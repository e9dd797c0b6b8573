#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "pencilscan/cli/command.h"
#include "pencilscan/cli/rendered_light.h"
#include "pencilscan/cli/simulate_options.h"
#include "pencilscan/core/counted_progress.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/geometry/used_vertices.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/io/partial_folder.h"
#include "pencilscan/planning/units.h"
#include "pencilscan/recording/frame_folders.h"
#include "pencilscan/simulation/blender.h"
#include "pencilscan/simulation/photography.h"
#include "pencilscan/simulation/povray.h"
#include "pencilscan/simulation/truth.h"

namespace pencilscan::cli {
namespace {

namespace fs = std::filesystem;

/// Light that a projector shows where its panel is black, in Gray-code captures.
constexpr double kCaptureBlackLevel = 0.004;
/// First image number of the captures: their noise never repeats that of a frame.
constexpr std::uint32_t kFirstCaptureImage = 0x40000000;

/// The mesh where frame 0 has it; InputError when no camera would see any of it.
TriangleMesh placed_mesh(const SimulateOptions& options, const Rig& rig) {
  TriangleMesh mesh =
      turned_upright(without_unused_vertices(read_mesh(options.mesh_path)), options.up);
  for (Vec3& v : mesh.vertices) v *= options.scale;
  if (options.fit) {
    mesh = fitted(std::move(mesh), working_volume(rig));
  } else {
    warn_of(object_unit_warning(mesh, rig, options.scale));
  }
  check_scene(rig, mesh, options.mesh_path, options.rig_path);
  return mesh;
}

/// Below --out: the scene until it is whole. What an interrupted run left there is no result.
constexpr const char* kMakingFolder = ".making";

/// What a scene consists of.
constexpr const char* kTruthFolder = "truth";
constexpr std::array kSceneFolders = {"frames", kTruthFolder, "captures", "povray", "blender"};
constexpr const char* kSceneRig = "rig.json";

/// True for a folder with a scene of an earlier run, or what was left of one that was killed.
/// Frames and a rig without the truth are a capture.
bool holds_a_scene(const fs::path& folder) {
  return fs::exists(folder / kMakingFolder) ||
         (fs::is_regular_file(folder / kSceneRig) && fs::is_directory(folder / kTruthFolder));
}

/// Refuses to replace anything but an earlier scene, and that without --overwrite.
void check_output(const SimulateOptions& options) {
  const fs::path out(options.out);
  std::error_code ignored;
  if (!fs::exists(out, ignored)) return;
  if (!fs::is_directory(out, ignored)) {
    throw InputError("--out", "", options.out, "must be a folder, not a file");
  }
  const bool holds_any =
      std::any_of(fs::directory_iterator(out), fs::directory_iterator(),
                  [](const auto& entry) { return entry.path().filename() != kMakingFolder; });
  if (holds_any && !options.overwrite) {
    throw InputError("--out", "", options.out,
                     "must be new or empty: choose another folder, or give --overwrite to replace "
                     "the scene in it");
  }
  if (holds_any && !holds_a_scene(out)) {
    throw InputError("--out", "", options.out,
                     "must hold an earlier scene (rig.json and truth/) to be replaced, and what is "
                     "there is none");
  }
}

/// Puts a whole scene where it belongs, instead of an earlier one; the rig last.
void publish(const fs::path& made, const fs::path& out) {
  for (const char* name : kSceneFolders) {
    fs::remove_all(out / name);
    if (fs::exists(made / name)) fs::rename(made / name, out / name);
  }
  fs::rename(made / kSceneRig, out / kSceneRig);
}

cv::Mat as_float(const cv::Mat& map) {
  cv::Mat result;
  map.convertTo(result, CV_32F);
  return result;
}

void write_truth_maps(const fs::path& folder, const Rig& rig, std::size_t c,
                      const CameraTruth& truth) {
  const std::string& camera = rig.cameras[c].name;
  write_image(folder / "depth" / (camera + ".tiff"), as_float(truth.depth));
  write_image(folder / "cosine" / (camera + ".tiff"), truth.cosine);
  for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
    const ProjectorTruth& light = truth.projectors[p];
    const fs::path place = folder / rig.projectors[p].name;
    write_image(place / "lit" / (camera + ".png"), light.lit * 255);
    write_image(place / "cosine" / (camera + ".tiff"), light.cosine);
    for (std::size_t i = 0; i < light.line.size(); ++i) {
      const std::string name = light.line.size() == 1 ? "line" : "line" + std::to_string(i);
      write_image(place / name / (camera + ".tiff"), as_float(light.line[i]));
    }
  }
}

Vec3 vector_of(const std::vector<double>& three) { return {three[0], three[1], three[2]}; }

bool moves_within_exposure(const SimulateOptions& options) {
  return !vector_of(options.speed_mm_s).isZero(0) || !vector_of(options.spin_deg_s).isZero(0);
}

/// InputError where another renderer cannot show what is asked for.
void check_exports(const SimulateOptions& options, const Rig& rig) {
  for (const auto& [option, is_given] : {std::pair("--export-povray", options.export_povray),
                                         std::pair("--export-blender", options.export_blender)}) {
    if (is_given && moves_within_exposure(options)) {
      throw InputError(option, "", "",
                       "must stand without --motion-mm-s and --spin-deg-s: in its scenes nothing "
                       "moves while the shutter is open");
    }
  }
  if (options.export_povray) check_povray_can_show(rig, options.surface, options.rig_path);
  if (options.export_blender) check_blender_can_show(rig, options.surface, options.rig_path);
}

/// The light of --light; nothing without it. InputError where something is asked for that would
/// have to be in it.
std::optional<RenderedLight> rendered_light(const SimulateOptions& options, const Rig& rig) {
  if (options.light.empty()) return std::nullopt;
  if (moves_within_exposure(options)) {
    throw InputError("--light", "", options.light,
                     "must stand without --motion-mm-s and --spin-deg-s: light is as it was made");
  }
  return RenderedLight(options.light, rig, options.frame_count);
}

void write_frames(const SimulateOptions& options, const Rig& rig, const TriangleMesh& mesh,
                  const std::optional<RenderedLight>& light, const Progress& progress) {
  const fs::path out(options.out);
  if (options.export_blender) {
    write_blender_scene(out / "blender", rig, options.surface, panel_film(options.photo),
                        scene_light(options.photo));
  }
  const Motion motion{options.rotate_deg * M_PI / 180, vector_of(options.translate_mm),
                      working_volume(rig).center};
  const double seconds = options.exposure_ms / 1000;
  const ExposurePath in_exposure{seconds * vector_of(options.speed_mm_s),
                                 seconds * M_PI / 180 * vector_of(options.spin_deg_s),
                                 working_volume(rig).center};
  const std::size_t total = static_cast<std::size_t>(options.frame_count) * rig.cameras.size();
  for (int frame = 0; frame < options.frame_count; ++frame) {
    const SimulatedObject object(mesh, options.surface, motion.at(frame));
    const std::vector<SimulatedObject> moments =
        through_exposure(mesh, options.surface, motion.at(frame), in_exposure, footprint(rig));
    const std::string name = six_digits(static_cast<std::size_t>(frame));
    const fs::path truth =
        options.frame_count == 1 ? out / kTruthFolder : out / kTruthFolder / name;
    write_mesh(truth / "mesh.ply", object.mesh(), rig.unit_known);
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      const Camera& camera = rig.cameras[c];
      const auto image =
          static_cast<std::uint32_t>(static_cast<std::size_t>(frame) * rig.cameras.size() + c);
      tell_steps(progress, "rendering frames: image", image, total);
      const cv::Mat picture =
          light ? apply_sensor(light->read(name, camera), camera_sensor(options.photo, camera),
                               options.photo.seed, image)
                : photograph(rig, c, moments, options.photo, image);
      const fs::path stem = out / "frames" / name / camera.name;
      if (options.jpeg) {
        write_jpeg(stem.string() + ".jpg", picture, *options.jpeg);
      } else {
        write_image(stem.string() + ".png", picture, options.photo.bits);
      }
      if (options.truth_maps) write_truth_maps(truth, rig, c, camera_truth(rig, c, object));
    }
    if (options.export_povray) {
      write_povray_scene(out / "povray" / name, rig, object, scene_light(options.photo));
    }
    if (options.export_blender) write_blender_object(out / "blender", name, object);
  }
  tell_steps(progress, "rendering frames: image", total, total);
}

/// Returns the number of camera-projector pairs with captures.
int write_captures(const SimulateOptions& options, const Rig& rig, const TriangleMesh& mesh,
                   const Progress& progress) {
  const SimulatedObject object(mesh, options.surface);
  FilmOptions film = options.photo.film;
  film.black_level = options.photo.black_level.value_or(kCaptureBlackLevel);
  const RenderOptions light = scene_light(options.photo);
  const std::size_t pairs = rig.projectors.size() * rig.cameras.size();
  int written = 0;
  for (std::size_t pair = 0; pair < pairs; ++pair) {
    tell_steps(progress, "rendering captures: pair", pair, pairs);
    const Projector& projector = rig.projectors[pair / rig.cameras.size()];
    const std::size_t c = pair % rig.cameras.size();
    std::vector<PanelLight> sequence;
    std::vector<std::string> names;
    for (const auto& image : gray_code_sequence(projector.width, projector.height)) {
      names.push_back(six_digits(names.size()).substr(3));
      sequence.push_back(gray_code_light(projector, image, film));
    }
    if (options.color_captures) {
      for (const SolidImage& image : solid_images()) {
        names.push_back(image.name);
        sequence.push_back(solid_light(projector, image, film));
      }
    }
    const auto render = options.color_captures ? render_color_sequence : render_sequence;
    const auto images = render(rig, c, pair / rig.cameras.size(), object, sequence, light);
    if (images.empty()) continue;  // the camera cannot see this projector's light
    ++written;
    const fs::path folder =
        fs::path(options.out) / "captures" / projector.name / rig.cameras[c].name;
    const SensorOptions sensor = camera_sensor(options.photo, rig.cameras[c]);
    parallel_for(images.size(), [&](std::size_t i) {
      const auto number = kFirstCaptureImage + static_cast<std::uint32_t>(pair * 64 + i);
      write_image(folder / (names[i] + ".png"),
                  apply_sensor(images[i], sensor, options.common.seed, number), options.photo.bits);
    });
  }
  tell_steps(progress, "rendering captures: pair", pairs, pairs);
  return written;
}

void run_simulate(SimulateOptions options) {
  const ThreadLimit threads(options.common.threads);
  const Stopwatch watch;
  options.surface.smooth = !options.flat;
  options.photo.render.inverse_square = !options.no_falloff;
  options.photo.seed = options.common.seed;
  options.photo.interpolated = Mosaic::from_name(options.interpolated);
  const Rig rig = read_rig(options.rig_path);
  warn_of_rig(rig);
  if (options.photo.interpolated &&
      std::all_of(rig.cameras.begin(), rig.cameras.end(),
                  [](const Camera& camera) { return camera.mosaic.has_value(); }))
    warn_of(
        "--interpolated has no effect here: it needs a camera whose \"mosaic\" the rig leaves out");
  const TriangleMesh mesh = placed_mesh(options, rig);
  const std::optional<RenderedLight> light = rendered_light(options, rig);
  check_exports(options, rig);
  check_output(options);
  const fs::path out = options.out;
  const PartialFolder making(out / kMakingFolder);
  options.out = making.path();
  write_text(making.path() / "rig.json", read_file(options.rig_path));
  const Progress progress = stderr_progress("nothing of the scene is kept, start again");
  write_frames(options, rig, mesh, light, progress);
  nlohmann::ordered_json figures;
  figures["frames"] = options.frame_count;
  figures["cameras"] = rig.cameras.size();
  figures["projectors"] = rig.projectors.size();
  figures["mesh_faces"] = mesh.faces.size();
  if (options.gray_code) figures["capture_pairs"] = write_captures(options, rig, mesh, progress);
  publish(making.path(), out);
  figures["seconds"] = watch.seconds();
  print_figures(options.common, figures);
}

}  // namespace

void add_simulate_command(CLI::App& app) {
  auto options = std::make_shared<SimulateOptions>();
  CLI::App* command =
      app.add_subcommand("simulate", "Render what the cameras of a rig would see of a mesh");
  command->add_option("--rig", options->rig_path, "The rig (rig.json)")->required();
  command->add_option("--mesh", options->mesh_path, "PLY, OBJ, STL or OFF, in the rig's unit (mm)")
      ->required();
  command->add_option("--out", options->out, "New folder: rig.json, frames/, truth/, captures/")
      ->required();
  add_overwrite(*command, options->overwrite, "Replace an earlier result in --out");
  CLI::Option* gray_code =
      command->add_flag("--gray-code", options->gray_code, "Also write Gray-code captures");
  command
      ->add_flag("--color-captures", options->color_captures,
                 "Gray-code captures in colour, with solid colours")
      ->needs(gray_code);
  command->add_flag("--truth-maps", options->truth_maps,
                    "Also write depth, line coordinates, lit masks and cosines");
  command->add_flag("--export-povray", options->export_povray,
                    "Also write the scene for POV-Ray 3.7");
  command->add_flag("--export-blender", options->export_blender,
                    "Also write the scene for Blender 3.4: blender -b -P blender/render.py");
  command->add_option("--light", options->light,
                      "Linear light that another renderer made, FOLDER/000000/<camera>.png, "
                      "instead of our own rendering; the sensor is simulated");
  add_scene_options(*command, *options);
  add_device_options(*command, *options);
  add_common_options(*command, options->common,
                     "pencilscan simulate --rig rig.json --mesh bunny.obj --up y --fit "
                     "--noise medium --out scene");
  command->callback([options] { run_simulate(*options); });
}

}  // namespace pencilscan::cli
