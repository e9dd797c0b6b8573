#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "pencilscan/capture/projector_tests.h"
#include "pencilscan/cli/command.h"
#include "pencilscan/cli/interruption.h"
#include "pencilscan/cli/lab_devices.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"

namespace pencilscan::cli {
namespace {

using Json = nlohmann::ordered_json;

struct CaptureCommand {
  CommonOptions common;
  std::string rig_path;
  std::string lab_path;
  std::vector<std::string> cameras;
  std::string out;
  std::string trigger;
  double rate_hz = 0;
  double seconds = 0;
  std::size_t frames = 0;
  bool still = false;
  bool whole_only = false;
  bool show = false;
  bool gray_code = false;
  bool solids = false;
  std::string test_to;
  bool list = false;
  bool overwrite = false;
};

void list_all(const CaptureCommand& command) {
  Json figures;
  for (const CameraInfo& camera : list_cameras())
    figures[camera.address] = {{"model", camera.model}, {"serial", camera.serial}};
  if (figures.empty())
    throw StageError(
        "no camera answers (those of a network must be in one subnet with this "
        "computer, and no other program may hold them)");
  print_figures(command.common, figures);
}

Lab lab_of(const CaptureCommand& command) {
  Lab lab;
  if (!command.lab_path.empty()) lab = read_lab(command.lab_path);
  for (const std::string& text : command.cameras) {
    auto [name, camera] = lab_camera_from_text(text, "--camera");
    if (const auto before = lab.cameras.find(name);
        before != lab.cameras.end() && before->second.of_command_line)
      throw InputError("command line", "--camera", text,
                       name + " is " + before->second.device + " already");
    lab.cameras[name] = camera;
  }
  if (!command.trigger.empty()) lab.trigger = *trigger_from_text(command.trigger);
  if (command.rate_hz > 0) lab.rate_hz = command.rate_hz;
  return lab;
}

std::string with_advice(const Fault& fault) {
  return to_string(fault) + (fault.advice.empty() ? "" : "\n  what to do: " + fault.advice);
}

/// Fails where something is wrong, after everything was printed: with the first fault, the last to
/// be said.
void end_with(const std::vector<Fault>& faults) {
  std::cout.flush();
  if (faults.empty()) return;
  for (std::size_t i = 1; i < faults.size(); ++i)
    std::cerr << "pencilscan: " << with_advice(faults[i]) << "\n";
  throw StageError(with_advice(faults.front()));
}

/// Cameras that are opened, set and running.
struct Running {
  Rig rig;
  Lab lab;
  std::unique_ptr<LiveCameras> cameras;
};

Running start(const CaptureCommand& command) {
  if (command.rig_path.empty())
    throw InputError("command line", "--rig", "", "is required, but for --list");
  Running running;
  running.rig = read_devices(command.rig_path).rig;
  running.lab = lab_of(command);
  const std::string source = command.lab_path.empty() ? "command line" : command.lab_path;
  running.cameras = start_lab_cameras(running.rig, running.lab, source);
  return running;
}

std::unique_ptr<ProjectorScreen> open_screen_of(const Running& running,
                                                const CaptureCommand& command) {
  return open_lab_screen(running.rig, running.lab, command.rig_path,
                         command.lab_path.empty() ? "the file of --lab" : command.lab_path);
}

Json describe(const RecordReport& report, const Rig& rig) {
  Json figures;
  figures["frames"] = report.frames;
  figures["whole"] = report.whole;
  if (report.left_out > 0) figures["left_out"] = report.left_out;
  figures["seconds"] = report.seconds;
  figures["spread_median_ms"] = report.spread.median_ms;
  figures["spread_largest_ms"] = report.spread.largest_ms;
  figures["most_waiting_for_disk"] = report.most_waiting;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c)
    figures["cameras"][rig.cameras[c].name] = {{"pictures", report.tallies[c].pictures},
                                               {"incomplete", report.tallies[c].incomplete},
                                               {"skipped", report.tallies[c].skipped},
                                               {"late", report.tallies[c].late},
                                               {"frames_without", report.missing[c]}};
  return figures;
}

/// What may be why no picture came.
std::string why_nothing_came(const Lab& lab) {
  for (const auto& [name, camera] : lab.cameras) {
    if (camera.device.starts_with(kFolderDevice))
      return "; " + name +
             " is a folder: a picture counts that appears there after the start, and "
             "one that was there before does not";
  }
  return "";
}

void record_frames(const CaptureCommand& command, Interruption& interruption) {
  Running running = start(command);
  std::unique_ptr<ProjectorScreen> screen;
  if (command.show) {
    screen = open_screen_of(running, command);
    screen->show_all({ProjectorPicture::Kind::kLines, 0, {}});
  }
  RecordOptions options = record_options(running.lab, command.still);
  options.seconds = command.seconds;
  options.frames = command.frames;
  options.keep_partial = !command.whole_only;
  const Progress progress = stderr_progress();
  RecordReport report =
      record(*running.cameras, running.rig, command.out, options, [&](const RecordReport& so_far) {
        const double share = command.seconds > 0  ? so_far.seconds / command.seconds
                             : command.frames > 0 ? static_cast<double>(so_far.frames) /
                                                        static_cast<double>(command.frames)
                                                  : 0;
        progress("recording, " + std::to_string(so_far.frames) + " frames", share);
        return !interruption.within(0);
      });
  if (screen)
    for (Fault& fault : screen->check()) report.faults.push_back(std::move(fault));
  print_figures(command.common, describe(report, running.rig));
  end_with(report.faults);
  if (report.frames == 0)
    throw StageError("not a single frame came" + why_nothing_came(running.lab));
}

void capture_gray(const CaptureCommand& command, Interruption& interruption) {
  Running running = start(command);
  const auto screen = open_screen_of(running, command);
  GrayCaptureOptions options = gray_options(running.rig, running.lab);
  options.solids = command.solids;
  const Progress progress = stderr_progress();
  const GrayCaptureReport report =
      capture_gray_codes(*running.cameras, *screen, running.rig, command.out, options,
                         [&](const std::string& what, double share) {
                           progress(what, share);
                           return !interruption.within(0);
                         });
  Json figures;
  figures["pictures"] = report.pictures;
  figures["retaken"] = report.retaken;
  figures["resumed_projectors"] = report.resumed;
  if (!report.refused.empty()) figures["refused_projectors"] = report.refused;
  figures["seconds"] = report.seconds;
  figures["waiting_seconds"] = report.waiting_seconds;
  for (std::size_t p = 0; p < running.rig.projectors.size(); ++p)
    for (std::size_t c = 0; c < running.rig.cameras.size(); ++c)
      if (report.views[p][c].share > 0)
        figures["sees"][running.rig.projectors[p].name][running.rig.cameras[c].name] =
            report.views[p][c].share;
  print_figures(command.common, figures);
  for (const std::string& projector : report.refused)
    std::cerr << "pencilscan: the pictures of " << projector
              << " are refused; the same command takes them anew\n";
  end_with(report.faults);
  if (interruption.within(0)) throw StageError("stopped; the same command goes on");
}

void test_lab(const CaptureCommand& command, Interruption& interruption) {
  std::error_code ignored;  // of files that do not exist
  const bool updates = std::filesystem::equivalent(command.test_to, command.lab_path, ignored);
  refuse_existing("--test", command.test_to, command.overwrite || updates);
  Running running = start(command);
  const auto screen = open_screen_of(running, command);
  const Progress progress = stderr_progress();
  ProjectorTestReport report = test_projectors(*running.cameras, *screen, test_options(running.lab),
                                               [&](const std::string& what, double share) {
                                                 progress("flashing " + what, share);
                                                 return !interruption.within(0);
                                               });
  if (interruption.within(0)) throw StageError("stopped; nothing was written");
  for (Fault& fault : screen->check()) report.faults.push_back(std::move(fault));
  Json figures;
  for (std::size_t p = 0; p < running.rig.projectors.size(); ++p) {
    const ProjectorTiming& timing = report.projectors[p];
    if (!timing.measured) continue;
    const std::string& name = running.rig.projectors[p].name;
    running.lab.delay_ms[name] = timing.use_ms;
    running.lab.outputs[name] = screen->projectors()[p].output;
    figures[name] = {{"delay_least_ms", timing.least_ms},
                     {"delay_most_ms", timing.most_ms},
                     {"frames_behind", timing.frames_behind},
                     {"flicker", timing.flicker}};
  }
  write_lab(running.lab, command.test_to);
  print_figures(command.common, figures);
  end_with(report.faults);
}

void run_capture(const CaptureCommand& command) {
  Interruption interruption;  // before any thread
  const ThreadLimit threads(command.common.threads);
  if (command.list) return list_all(command);
  if (!command.test_to.empty()) return test_lab(command, interruption);
  if (command.out.empty())
    throw InputError("command line", "--out", "", "is required, but for --list and --test");
  if (command.gray_code) return capture_gray(command, interruption);
  record_frames(command, interruption);
}

}  // namespace

void add_capture_command(CLI::App& app) {
  auto options = std::make_shared<CaptureCommand>();
  CLI::App* command =
      app.add_subcommand("capture", "Take frames, or Gray-code captures, with cameras");
  command->add_option("--rig", options->rig_path,
                      "The rig (rig.json); K, distortion, R and t may be missing");
  command->add_option("--lab", options->lab_path,
                      "Which device each camera is, and how it is set (lab.json)");
  command->add_option("--camera", options->cameras,
                      "CAMERA=DEVICE instead of lab.json: cam0=aravis:Basler-2345, "
                      "cam0=v4l2:/dev/video0, cam0=folder:shots; once for each");
  command->add_option("--out", options->out,
                      "New: recording.zarr, or a folder for frames; for captures a folder, which "
                      "is gone on with");
  command->add_option("--trigger", options->trigger, "What starts the exposures")
      ->check(one_of({"free", "software", "wire", "ptp"}));
  command->add_option("--rate", options->rate_hz, "Frames per second")->check(above_zero());
  command->add_option("--seconds", options->seconds, "Record so long (default: until Ctrl-C)")
      ->check(above_zero());
  command
      ->add_option("--frames", options->frames,
                   "Record so many frames, those that --whole-only leaves out among them")
      ->check(any_number<std::size_t>());
  command->add_flag(
      "--still", options->still,
      "The object does not move: pictures of a frame may be as far apart as patience_s");
  command->add_flag("--whole-only", options->whole_only, "Leave out frames with a picture missing");
  command->add_flag("--show", options->show, "Show the rig's lines meanwhile");
  CLI::Option* gray_code =
      command->add_flag("--gray-code", options->gray_code,
                        "Take Gray-code captures of every projector, for calibrate");
  command->add_flag("--solids", options->solids, "Even colours as well")->needs(gray_code);
  CLI::Option* test =
      command->add_option("--test", options->test_to,
                          "Flash the projectors instead: who sees whom, delays, flicker; writes "
                          "lab.json with them, also the one of --lab");
  add_overwrite(*command, options->overwrite, "With --test: replace a file that is there", test);
  CLI::Option* list =
      command->add_flag("--list", options->list, "List the cameras that answer instead");
  excludes_all_but(
      *command, *gray_code,
      {"--rig", "--lab", "--camera", "--trigger", "--rate", "--out", "--solids", "--overwrite"});
  excludes_all_but(*command, *test,
                   {"--rig", "--lab", "--camera", "--trigger", "--rate", "--overwrite"});
  excludes_all_but(*command, *list, {});
  add_common_options(*command, options->common,
                     "pencilscan capture --rig rig.json --lab lab.json --seconds 60 --show "
                     "--out recording.zarr");
  command->callback([options] { run_capture(*options); });
}

}  // namespace pencilscan::cli
