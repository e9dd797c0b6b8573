#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "pencilscan/boards/board.h"
#include "pencilscan/calibration/calibration_report.h"
#include "pencilscan/calibration/tracks.h"
#include "pencilscan/cli/command.h"
#include "pencilscan/cli/device_arguments.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/gray/gray_decode.h"
#include "pencilscan/gray/image_order.h"
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

/// Decodes one pair and adds its correspondences, unless the codes make no sense; looks for the
/// board where all of the panel is lit.
DecodeSummary decode_pair(const CapturePair& pair, std::size_t capture, const Rig& rig,
                          TrackBuilder& tracks, ColorCollector& colors, BoardFinder* boards,
                          std::vector<Finding>& findings) {
  const Projector& projector = rig.projectors[pair.projector];
  const GrayStack stack = read_gray_stack(pair, rig);
  if (boards != nullptr) boards->look(capture, pair.camera, stack.white);
  const DecodedView view = decode_gray_stack(stack);
  DecodeSummary summary{capture, pair.projector, pair.camera, view.counts, view.valid_share(), 0,
                        {}};
  summary.wrong_order = explain_wrong_order(
      projector.width, projector.height, pair.inverses,
      [&](std::size_t i) { return read_gray_image(pair, rig, i); }, view);
  if (!summary.wrong_order.empty()) {
    findings.push_back({Grade::kDoubtful,
                        "the images of " + projector.name + "/" + rig.cameras[pair.camera].name +
                            " (--captures number " + std::to_string(capture + 1) +
                            ") are in the wrong order: " + summary.wrong_order,
                        "put them in the documented order; they were left out"});
    return summary;
  }
  const std::size_t before = tracks.samples();
  tracks.add(capture, pair.camera, pair.projector, view);
  colors.add(pair, view);
  if (boards != nullptr)
    boards->project(capture, pair.camera, rig.cameras.size() + pair.projector, view);
  summary.samples = tracks.samples() - before;
  return summary;
}

void check_command(const CalibrateCommand& command) {
  std::error_code ignored;
  if (fs::equivalent(command.out, command.devices, ignored))
    throw InputError("command line", "--out", command.out, "must not be the devices file");
  if (!command.overwrite && fs::exists(command.out, ignored))
    throw InputError("command line", "--out", command.out,
                     "must be a new file (or give --overwrite)");
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

nlohmann::ordered_json figures_of(const CalibrationResult& result, const Uncertainty& uncertainty,
                                  const Verdict& verdict, double seconds) {
  nlohmann::ordered_json figures;
  figures["verdict"] = to_string(verdict.grade);
  for (std::size_t i = 0; i < verdict.findings.size(); ++i)
    if (verdict.findings[i].grade == verdict.grade && verdict.grade != Grade::kGood)
      figures["reasons"].push_back(verdict.findings[i].what);
  figures["rms_px"] = result.rms_px;
  figures["held_out_rms_px"] = result.held_out_rms_px;
  if (!result.problem.board_views.empty()) figures["board_rms_px"] = result.board_rms_px;
  figures["views"] = result.views;
  figures["views_dropped"] = result.views_dropped;
  figures["point_sigma"] = uncertainty.volume_median;
  figures["unit"] = result.rig.unit_known ? "mm" : "unknown";
  figures["seconds"] = seconds;
  return figures;
}

void run_calibrate(const CalibrateCommand& command) {
  const ThreadLimit threads(command.common.threads);
  const Stopwatch watch;
  check_command(command);
  const UncalibratedRig devices = read_devices(command.devices);
  CalibrationInput input;
  input.rig = devices.rig;
  input.known = devices.given;
  input.distance = known_distance(command, input.rig);

  std::optional<BoardFinder> boards;
  if (!command.board.empty()) boards.emplace(board_from_text(command.board, "--board"));

  const Progress progress = stderr_progress();
  GrayTrackOptions track_options;
  track_options.max_tracks = command.max_tracks;
  TrackBuilder tracks(input.rig, track_options);
  ColorCollector colors(input.rig);
  std::vector<DecodeSummary> decoded;
  std::vector<Finding> findings;
  std::vector<std::vector<CapturePair>> captures;
  for (const std::string& folder : command.captures)
    captures.push_back(list_captures(folder, input.rig));
  for (std::size_t k = 0; k < captures.size(); ++k) {
    for (std::size_t i = 0; i < captures[k].size(); ++i) {
      progress("decoding", (static_cast<double>(k) +
                            static_cast<double>(i) / static_cast<double>(captures[k].size())) /
                               static_cast<double>(captures.size()));
      decoded.push_back(decode_pair(captures[k][i], k, input.rig, tracks, colors,
                                    boards ? &*boards : nullptr, findings));
    }
  }
  input.tracks = tracks.tracks();
  if (boards) {
    input.board_views = boards->views();
    input.projected_corners = boards->projected_views();
    input.boards = command.captures.size();
    if (boards->found() == 0)
      findings.push_back({Grade::kDoubtful,
                          "the board " + command.board + " is in no picture of any camera",
                          "count its inner corners, and let a camera see all of it lit"});
  }

  CalibrateOptions options;
  CalibrationResult result = calibrate(input, options, progress);
  const ColorCalibration color = colors.result();
  set_colors(color, result.rig);
  progress("judging", 0.9);
  Uncertainty sigma;
  sigma.devices.resize(device_count(input.rig));
  if (result.solved) {
    sigma = uncertainty(result.problem, result.adjustment, command.common.seed);
  }
  const LoopClosure loop = close_loop(result);
  if (const auto finding = judge_loop(result, loop)) findings.push_back(*finding);
  const Verdict verdict = judge(input, result, sigma, std::move(findings));
  progress("judging", 1);
  const CalibrationReport report{input, result, sigma, verdict, decoded, loop, color};
  const fs::path folder = fs::path(command.out).parent_path();
  const nlohmann::ordered_json report_json = calibration_json(report);
  write_json(folder / "calibration.json", report_json);
  write_text(folder / "calibration.html",
             calibration_page(report_json, "Calibration", "pencilscan " PENCILSCAN_VERSION));
  if (verdict.grade != Grade::kUnusable) write_rig(result.rig, command.out);
  print_verdict(verdict);
  print_remarks(color);
  print_figures(command.common, figures_of(result, sigma, verdict, watch.seconds()));
  if (verdict.grade == Grade::kUnusable) {
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
      ->check(CLI::Range(std::size_t{200}, std::size_t{1000000}))
      ->capture_default_str();
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier rig");
  add_common_options(*command, options->common,
                     "pencilscan calibrate --captures pose1 --captures pose2 --devices "
                     "devices.json --known-distance cam0 cam1 850 --out rig.json");
  command->callback([options] { run_calibrate(*options); });
}

}  // namespace pencilscan::cli
