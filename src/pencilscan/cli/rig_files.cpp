#include "pencilscan/cli/rig_files.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "pencilscan/cli/device_arguments.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/evaluation/truth_check.h"
#include "pencilscan/exchange/colmap_model.h"
#include "pencilscan/exchange/opencv_file.h"
#include "pencilscan/exchange/unheld.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/labeling/point_file.h"
#include "pencilscan/planning/conventions.h"
#include "pencilscan/planning/units.h"
#include "pencilscan/report/rig_picture.h"
#include "pencilscan/rig/device_list.h"
#include "pencilscan/rig/devices_file.h"

namespace pencilscan::cli {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, at);) parts.push_back(part);
  return parts;
}

// ---- pencilscan rig import ----------------------------------------------------------------------

struct ImportCommand {
  CommonOptions common;
  std::vector<std::string> opencv;
  std::string colmap;
  std::string base;
  std::string out;
  std::string unit;
  std::vector<std::string> projectors;
  std::vector<std::string> sizes;
  std::vector<std::string> known_distance;
  bool overwrite = false;
};

/// [NAME[,NAME]=]FILE.
void read_opencv_argument(const std::string& text, ExchangedRig& rig) {
  const auto equals = text.find('=');
  const bool is_named = equals != std::string::npos && text.find('/') > equals;
  if (!is_named) return read_opencv(text, {}, rig);
  read_opencv(text.substr(equals + 1), split(text.substr(0, equals), ','), rig);
}

/// NAME=WIDTHxHEIGHT for devices whose file lacks it.
void set_sizes(const std::vector<std::string>& sizes, ExchangedRig& rig) {
  std::set<std::string> names;
  for (const std::string& text : sizes) {
    const auto equals = text.rfind('=');
    int width = 0;
    int height = 0;
    int used = 0;
    const std::string value = equals == std::string::npos ? "" : text.substr(equals + 1);
    if (std::sscanf(value.c_str(), "%dx%d%n", &width, &height, &used) != 2 ||
        static_cast<std::size_t>(used) != value.size() || width < 1 || height < 1)
      throw InputError("command line", "--size", text, "must be NAME=WIDTHxHEIGHT in px");
    const std::string name = text.substr(0, equals);
    if (!names.insert(name).second)
      throw InputError("command line", "--size", text, "must be given once for a device");
    state_size(name, width, height, rig);
  }
}

/// Those named so, and those whose name begins like one.
void mark_projectors(const std::vector<std::string>& names, ExchangedRig& rig) {
  for (const std::string& name : names)
    if (std::none_of(rig.devices.begin(), rig.devices.end(),
                     [&](const ExchangedDevice& d) { return d.device.name == name; }))
      throw InputError("command line", "--projector", name, "must be a device of the files");
  for (ExchangedDevice& d : rig.devices)
    d.is_projector = d.is_projector || d.device.name.starts_with("proj") ||
                     std::find(names.begin(), names.end(), d.device.name) != names.end();
}

std::optional<StatedDistance> stated_distance(const std::vector<std::string>& words) {
  if (words.empty()) return std::nullopt;
  const auto mm = positive_number(words[2]);
  if (!mm)
    throw InputError("command line", "--known-distance", words[2], "must be a distance > 0 in mm");
  return StatedDistance{words[0], words[1], *mm};
}

ExchangeOptions exchange_options(const ImportCommand& command) {
  ExchangeOptions options;
  // Reconstructions from pictures have no scale of their own.
  const std::string unit =
      command.unit.empty() ? (command.colmap.empty() ? "mm" : "unknown") : command.unit;
  options.unit_known = unit != "unknown";
  if (unit == "cm") options.mm_per_unit = 10;
  if (unit == "m") options.mm_per_unit = 1000;
  options.known_distance = stated_distance(command.known_distance);
  return options;
}

std::set<std::string> names_of(const ExchangedRig& files) {
  std::set<std::string> names;
  for (const ExchangedDevice& d : files.devices) names.insert(d.device.name);
  return names;
}

/// The rig without the devices that other files describe.
Rig only_these(const std::set<std::string>& names, Rig rig) {
  const auto is_other = [&](const Device& d) { return !names.contains(d.name); };
  std::erase_if(rig.cameras, is_other);
  std::erase_if(rig.projectors, is_other);
  return rig;
}

void note(const std::string& text) { std::cerr << "note: " << text << "\n"; }

/// What is still missing, for people.
std::string missing_values(const UncalibratedRig& rig) {
  std::string text;
  for (std::size_t d = 0; d < device_count(rig.rig); ++d) {
    const GivenCalibration& given = rig.given[d];
    std::string lacks;
    if (!given.K) lacks += " K";
    if (!given.distortion) lacks += " distortion";
    if (!given.pose) lacks += " R t";
    if (!lacks.empty()) add_name(text, device_at(rig.rig, d).name + " lacks" + lacks, "; ");
  }
  return text;
}

void run_import(const ImportCommand& command) {
  if (command.opencv.empty() == command.colmap.empty())
    throw InputError("command line", "--opencv, --colmap", "", "exactly one of them is needed");
  refuse_existing("--out", command.out, command.overwrite);
  ExchangedRig files;
  for (const std::string& file : command.opencv) read_opencv_argument(file, files);
  if (!command.colmap.empty()) files = read_colmap(command.colmap);
  set_sizes(command.sizes, files);
  mark_projectors(command.projectors, files);
  UncalibratedRig base;
  if (!command.base.empty()) base = read_devices(command.base);
  const std::set<std::string> names = names_of(files);
  const JoinedRig rig = join_rig(std::move(files), base, exchange_options(command));
  if (rig.rig.cameras.empty() || rig.rig.projectors.empty())
    throw InputError("command line", "--projector", rig.rig.cameras.empty() ? "no camera" : "none",
                     "a rig has a camera and a projector: name the projectors among the files, or "
                     "give the other devices with --base");
  write_devices(rig, command.out);
  for (const std::string& text : rig.notes) note(text);
  for (const std::string& text : rig.warnings) warn_of(text);
  const std::string missing = missing_values(rig);
  if (!missing.empty())
    note(missing + ": the file is for calibrate --devices, no rig yet");
  else if (const auto warning = pose_unit_warning(only_these(names, rig.rig)))
    warn_of(*warning + ": --unit says what the files are in");
  if (missing.empty()) warn_of(shared_pose_warning(rig.rig));
  print_figures(command.common, {{"rig", command.out},
                                 {"cameras", rig.rig.cameras.size()},
                                 {"projectors", rig.rig.projectors.size()},
                                 {"unit", rig.rig.unit_known ? "mm" : "unknown"},
                                 {"complete", missing.empty()}});
}

void add_import(CLI::App& group) {
  auto options = std::make_shared<ImportCommand>();
  CLI::App* command =
      group.add_subcommand("import", "Make a rig from files of OpenCV or a COLMAP model");
  command->add_option("--opencv", options->opencv,
                      "[NAME[,NAME]=]FILE: YAML or XML of one device, or of a stereo calibration "
                      "(two names); repeat it for more files");
  command->add_option("--colmap", options->colmap, "Folder of a COLMAP text model");
  command->add_option("--out", options->out, "The rig file to write (rig.json)")->required();
  add_overwrite(*command, options->overwrite, "Replace a rig file that is there");
  command->add_option(
      "--base", options->base,
      "A rig.json whose devices of the same name take the calibration over and keep "
      "patterns and colours");
  command->add_option("--projector", options->projectors,
                      "A device that is a projector; those named proj... are anyway");
  command->add_option("--size", options->sizes,
                      "NAME=WIDTHxHEIGHT where the file lacks it, as cam0=1280x960");
  command
      ->add_option("--unit", options->unit, "Of the files' lengths; default mm, for COLMAP unknown")
      ->check(one_of({"mm", "cm", "m", "unknown"}));
  command
      ->add_option("--known-distance", options->known_distance,
                   "Two devices of the files and the distance of their centres in mm: cam0 cam1 "
                   "850")
      ->expected(3);
  add_common_options(*command, options->common,
                     "pencilscan rig import --opencv cam0,proj0=stereo.yml --size cam0=1280x960 "
                     "--size proj0=1280x800 --out rig.json");
  command->callback([options] { run_import(*options); });
}

// ---- pencilscan rig export ----------------------------------------------------------------------

struct ExportCommand {
  CommonOptions common;
  std::string rig_path;
  std::string opencv;
  std::string colmap;
  std::string points;
  std::vector<std::string> stereo;
  bool is_xml = false;
  bool overwrite = false;
};

/// Returns the number of devices in the files.
std::size_t export_opencv(const ExportCommand& command, const Rig& rig) {
  const OpencvSyntax syntax = command.is_xml ? OpencvSyntax::kXml : OpencvSyntax::kYaml;
  const char* ending = command.is_xml ? ".xml" : ".yml";
  const auto stereo_device = [&](std::size_t i) -> const Device& {
    return device_at(rig, device_by_name(rig, command.stereo[i], "--stereo"));
  };
  std::vector<std::pair<std::string, std::string>> files;
  if (command.stereo.empty()) {
    for (std::size_t d = 0; d < device_count(rig); ++d)
      files.emplace_back(device_at(rig, d).name + ending, opencv_text(device_at(rig, d), syntax));
  } else {
    if (command.stereo[0] == command.stereo[1])
      throw InputError("command line", "--stereo", command.stereo[0] + " " + command.stereo[1],
                       "must be two different devices");
    files.emplace_back(command.stereo[0] + "-" + command.stereo[1] + ending,
                       opencv_stereo_text(stereo_device(0), stereo_device(1), syntax));
  }
  const fs::path folder(command.opencv);
  for (const auto& [name, text] : files)
    refuse_existing("--opencv", folder / name, command.overwrite);
  for (const auto& [name, text] : files) write_text(folder / name, text);
  return command.stereo.empty() ? device_count(rig) : command.stereo.size();
}

/// What the files cannot hold, and what an import of them has to be told.
void tell_what_is_lost(const ExportCommand& command, const Rig& rig) {
  const bool is_stereo = !command.stereo.empty();
  std::string lost;
  for (const std::string& key : unheld_values(rig)) add_name(lost, key);
  if (is_stereo) add_name(lost, "R and t in the rig's world");
  const std::string format = command.opencv.empty() ? "COLMAP" : "OpenCV";
  if (!lost.empty())
    note(format + " files do not hold " + lost + ": rig import --base " + command.rig_path +
         " puts them back");
  if (!command.opencv.empty() && !rig.unit_known)
    warn_of(
        "the rig's unit is unknown, and T of OpenCV files is read as mm: give rig import "
        "--unit unknown");
  if (!command.colmap.empty() && rig.unit_known)
    note("COLMAP files do not hold the unit: give rig import --unit mm");
  for (const Projector& p : rig.projectors)
    if (!p.name.starts_with("proj") &&
        (!is_stereo || std::count(command.stereo.begin(), command.stereo.end(), p.name) > 0))
      note("the files do not say that " + p.name +
           " is a projector: give rig import --projector '" + p.name + "'");
}

void run_export(const ExportCommand& command) {
  const Rig rig = read_rig(command.rig_path);
  if (command.opencv.empty() == command.colmap.empty())
    throw InputError("command line", "--opencv, --colmap", "", "exactly one of them is needed");
  std::size_t devices = device_count(rig);
  require_distinct_names(rig);
  if (!command.opencv.empty()) {
    devices = export_opencv(command, rig);
  } else {
    for (const char* name : {"cameras.txt", "images.txt", "points3D.txt"})
      refuse_existing("--colmap", fs::path(command.colmap) / name, command.overwrite);
    std::vector<MeasuredPoint> points;
    if (!command.points.empty()) points = read_points(command.points);
    write_colmap(rig, points, command.colmap);
    if (const auto warning = other_rig_warning(rig, points))
      warn_of(command.points + ": " + *warning);
    if (points.size() > kMostColmapPoints)
      note("points3D.txt holds " + std::to_string(kMostColmapPoints) + " of " +
           std::to_string(points.size()) + " points, evenly picked");
  }
  tell_what_is_lost(command, rig);
  print_figures(
      command.common,
      {{"folder", command.opencv.empty() ? command.colmap : command.opencv}, {"devices", devices}});
}

void add_export(CLI::App& group) {
  auto options = std::make_shared<ExportCommand>();
  CLI::App* command =
      group.add_subcommand("export", "Write a rig for programs that use OpenCV, or for COLMAP");
  command->add_option("--rig", options->rig_path, "The rig (rig.json)")->required();
  CLI::Option* opencv = command->add_option(
      "--opencv", options->opencv, "Folder for one file per device, as cv::FileStorage writes it");
  command->add_flag("--xml", options->is_xml, "XML instead of YAML")->needs(opencv);
  command
      ->add_option("--stereo", options->stereo,
                   "Two devices: one file with K1, D1, K2, D2, R, T instead")
      ->expected(2)
      ->needs(opencv);
  CLI::Option* colmap =
      command->add_option("--colmap", options->colmap, "Folder for a COLMAP text model");
  command->add_option("--points", options->points, "points.ply measured with this rig, for COLMAP")
      ->needs(colmap);
  add_overwrite(*command, options->overwrite, "Replace files that are there");
  add_common_options(*command, options->common,
                     "pencilscan rig export --rig rig.json --colmap model");
  command->callback([options] { run_export(*options); });
}

// ---- pencilscan rig picture ---------------------------------------------------------------------

struct PictureCommand {
  CommonOptions common;
  std::string rig_path;
  std::string out;
  int side_px = 900;
  bool overwrite = false;
};

void run_picture(const PictureCommand& command) {
  refuse_existing("--out", command.out, command.overwrite);
  write_image(command.out, draw_rig(read_rig(command.rig_path), command.side_px));
  print_figures(command.common, {{"picture", command.out}});
}

void add_picture(CLI::App& group) {
  auto options = std::make_shared<PictureCommand>();
  CLI::App* command =
      group.add_subcommand("picture", "Draw the rig to scale, from above and from the side");
  command->add_option("--rig", options->rig_path, "The rig (rig.json)")->required();
  command->add_option("--out", options->out, "The picture to write (rig.png)")->required();
  add_overwrite(*command, options->overwrite, "Replace a picture that is there");
  add_number(*command, "--side-px", options->side_px, 300, 5000, "Side of each of the two views");
  add_common_options(*command, options->common,
                     "pencilscan rig picture --rig rig.json --out rig.png");
  command->callback([options] { run_picture(*options); });
}

}  // namespace

void add_rig_files(CLI::App& group) {
  add_import(group);
  add_export(group);
  add_picture(group);
}

}  // namespace pencilscan::cli
