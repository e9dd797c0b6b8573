#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "pencilscan/calibration/from_captures.h"
#include "pencilscan/cli/arguments.h"
#include "pencilscan/cli/command.h"
#include "pencilscan/cli/device_arguments.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/io/file.h"
#include "pencilscan/page/page.h"

namespace pencilscan::cli {
namespace {

namespace fs = std::filesystem;

struct CalibrateCommand {
  CommonOptions common;
  std::vector<std::string> captures;
  std::string devices;
  std::string out;
  std::vector<std::string> known_distance;
  std::string board;
  std::size_t max_tracks = GrayTrackOptions{}.max_tracks;
  double focal_tolerance_percent = 100 * GivenTolerance{}.focal;
  double center_tolerance_px = GivenTolerance{}.center_px;
  bool has_tolerance = false;  ///< one was given
  bool keep_unusable = false;
  bool overwrite = false;
};

std::optional<KnownDistance> known_distance(const CalibrateCommand& command, const Rig& rig) {
  if (command.known_distance.empty()) return std::nullopt;
  KnownDistance distance;
  distance.a = device_by_name(rig, command.known_distance[0], "--known-distance");
  distance.b = device_by_name(rig, command.known_distance[1], "--known-distance");
  const auto mm = positive_number(command.known_distance[2]);
  if (!mm || distance.a == distance.b)
    throw InputError("command line", "--known-distance", command.known_distance[2],
                     "must be two different devices and a distance > 0 in mm");
  distance.mm = *mm;
  return distance;
}

/// rig.json becomes rig.unusable.json.
fs::path unusable_path(const CalibrateCommand& command) {
  const fs::path out = command.out;
  return out.parent_path() / (out.stem().string() + ".unusable" + out.extension().string());
}

/// The rig without the devices that have no place.
Rig placed_rig(const CalibrationResult& result) {
  Rig rig = result.rig;
  std::size_t device = 0;
  const auto is_absent = [&](const Device&) { return result.placed[device++] == 0; };
  std::erase_if(rig.cameras, is_absent);
  std::erase_if(rig.projectors, is_absent);
  return rig;
}

/// Where the rig goes: one that is unusable only where it was asked for, under a name that says so.
std::optional<fs::path> rig_path(const CalibrateCommand& command,
                                 const CapturesCalibration& calibration) {
  if (calibration.is_usable()) return command.out;
  if (!command.keep_unusable || !calibration.result.solved) return std::nullopt;
  return unusable_path(command);
}

void write_result(const CapturesCalibration& calibration, const fs::path& path) {
  if (calibration.is_usable()) return write_rig(calibration.result.rig, path);
  write_rig(placed_rig(calibration.result), path);
  std::cerr << "the unusable rig is " << path.string() << "\n";
}

void check_new(const CalibrateCommand& command, const fs::path& file) {
  std::error_code ignored;
  if (!command.overwrite && fs::exists(file, ignored))
    throw InputError("command line", "--out", file.string(),
                     "must be a new file (or give --overwrite)");
}

constexpr const char* kReportFile = "calibration.json";
constexpr const char* kPageFile = "calibration.html";
/// Key of the report: the rig file that it is of. There is none where no rig was written.
constexpr const char* kReportedRig = "rig";

/// The report lies beside the rig: that of another rig is not replaced unasked.
void check_report(const CalibrateCommand& command) {
  const fs::path out = command.out;
  const fs::path report = out.parent_path() / kReportFile;
  const fs::path page = out.parent_path() / kPageFile;
  std::error_code ignored;
  const bool is_there = fs::exists(report, ignored);
  if (command.overwrite || (!is_there && !fs::exists(page, ignored))) return;
  const auto earlier = is_there ? read_json(report) : nlohmann::json();
  // That of an unusable calibration is of no rig that anybody uses: the next attempt replaces it.
  if (earlier.is_object()) {
    if (earlier.value("verdict", nlohmann::json()) == "unusable") return;
    if (earlier.value(kReportedRig, nlohmann::json()) == out.filename().string()) return;
  }
  throw InputError("command line", "--out", command.out,
                   "must be in another folder: " + (is_there ? report : page).string() +
                       " is not of this rig (or give --overwrite)");
}

void check_command(const CalibrateCommand& command) {
  std::error_code ignored;
  if (fs::equivalent(command.out, command.devices, ignored))
    throw InputError("command line", "--out", command.out, "must not be the devices file");
  check_new(command, command.out);
  if (command.keep_unusable) check_new(command, unusable_path(command));
  check_report(command);
}

void print_remarks(const ColorCalibration& color) {
  for (const std::string& remark : color.remarks) std::cerr << "colour: " << remark << "\n";
}

void print_verdict(const Verdict& verdict) {
  for (const Finding& finding : verdict.findings) {
    std::cerr << to_string(finding.grade) << ": " << finding.what << "\n";
    if (!finding.advice.empty()) std::cerr << "  what to do: " << finding.advice << "\n";
  }
}

void run_calibrate(const CalibrateCommand& command) {
  const ThreadLimit threads(command.common.threads);
  const Stopwatch watch;
  check_command(command);
  const UncalibratedRig devices = read_devices(command.devices);
  if (command.has_tolerance && std::none_of(devices.given.begin(), devices.given.end(),
                                            [](const auto& given) { return given.K; }))
    warn_of("--focal-tolerance and --center-tolerance have no effect here: no device has a K");
  CapturesOptions options;
  options.distance = known_distance(command, devices.rig);
  options.board = command.board;
  options.max_tracks = command.max_tracks;
  options.tolerance = {command.focal_tolerance_percent / 100, command.center_tolerance_px};
  options.seed = command.common.seed;
  const CapturesCalibration calibration = calibrate_captures(
      devices, {command.captures.begin(), command.captures.end()}, options, stderr_progress());
  const Verdict& verdict = calibration.verdict;
  const fs::path folder = fs::path(command.out).parent_path();
  nlohmann::ordered_json report_json = calibration_json(calibration);
  const std::optional<fs::path> rig = rig_path(command, calibration);
  if (rig) report_json[kReportedRig] = rig->filename().string();
  write_json(folder / kReportFile, report_json);
  write_text(folder / kPageFile,
             calibration_page(report_json, "Calibration", "pencilscan " PENCILSCAN_VERSION));
  if (rig) write_result(calibration, *rig);
  print_verdict(verdict);
  print_remarks(calibration.color);
  nlohmann::ordered_json figures = calibration_figures(calibration);
  figures["seconds"] = watch.seconds();
  print_figures(command.common, figures);
  if (!calibration.is_usable()) {
    std::cout.flush();
    throw StageError("unusable: " + verdict.findings.front().what);
  }
}

}  // namespace

void add_calibrate_command(CLI::App& app) {
  auto options = std::make_shared<CalibrateCommand>();
  CLI::App* command =
      app.add_subcommand("calibrate", "Find the rig from Gray-code captures, and judge it");
  command
      ->add_option("--captures", options->captures,
                   "Folder <projector>/<camera>/NNN.png; repeat it for more poses of the object")
      ->required();
  command
      ->add_option("--devices", options->devices,
                   "A rig.json in which K, distortion, R and t may be missing or rough")
      ->required();
  command
      ->add_option("--out", options->out,
                   "The rig file to write; calibration.html and calibration.json go beside it")
      ->required();
  command
      ->add_option("--known-distance", options->known_distance,
                   "Two devices and the distance of their centres in mm: cam0 cam1 850")
      ->expected(3);
  command->add_option(
      "--board", options->board,
      "A board in the captures: chessboard:9x7:75, inner corners and mm of a square, "
      "or charuco:10x8:75:56:DICT_5X5_100, squares, mm of a square and of a marker");
  command->add_option("--max-tracks", options->max_tracks, "Surface points to use at most")
      ->check(between<std::size_t>(200, 1000000))
      ->capture_default_str();
  CLI::Option* focal =
      command
          ->add_option(
              "--focal-tolerance", options->focal_tolerance_percent,
              "How far off given focal lengths may be, one standard deviation in per cent; 0: "
              "they are exact")
          ->check(between(0.0, 100 * GivenTolerance::kMostFocal))
          ->capture_default_str();
  CLI::Option* center = command
                            ->add_option("--center-tolerance", options->center_tolerance_px,
                                         "The same of given principal points, px")
                            ->check(between(0.0, GivenTolerance::kMostCenterPx))
                            ->capture_default_str();
  command->add_flag("--keep-unusable", options->keep_unusable,
                    "Write an unusable rig, too: rig.unusable.json for --out rig.json");
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier rig and its report");
  add_common_options(*command, options->common,
                     "pencilscan calibrate --captures pose1 --captures pose2 --devices "
                     "devices.json --known-distance cam0 cam1 850 --out rig.json");
  command->callback([options, focal, center] {
    options->has_tolerance = focal->count() + center->count() > 0;
    run_calibrate(*options);
  });
}

}  // namespace pencilscan::cli
