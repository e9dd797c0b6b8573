#include <algorithm>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "pencilscan/cli/command.h"
#include "pencilscan/cli/sequence_jobs.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/recording/frame_folders.h"
#include "pencilscan/recording/pack.h"

namespace pencilscan::cli {
namespace {

using Json = nlohmann::ordered_json;

// ---- pencilscan sequence pack, unpack
// -------------------------------------------------------------

struct PackCommand {
  CommonOptions common;
  std::string frames;
  std::string out;
  std::string compression = "zstd";
  PackOptions pack;
};

void print_packed(const CommonOptions& common, const PackReport& report, const std::string& out) {
  Json figures;
  figures["frames"] = report.frames;
  figures["cameras"] = report.cameras.size();
  figures["pictures"] = report.pictures;
  figures["pictures_missing"] = report.missing;
  figures["out"] = out;
  for (const std::string& warning : report.warnings) warn_of(warning);
  print_figures(common, figures);
}

void run_pack(const PackCommand& command) {
  const ThreadLimit threads(command.common.threads);
  PackOptions options = command.pack;
  options.compression = command.compression == "none"  ? ZarrCompression::kNone
                        : command.compression == "lz4" ? ZarrCompression::kLz4
                                                       : ZarrCompression::kZstd;
  print_packed(command.common,
               pack_recording(command.frames, command.out, options, stderr_progress()),
               command.out);
}

void add_pack(CLI::App& group) {
  auto options = std::make_shared<PackCommand>();
  CLI::App* command =
      group.add_subcommand("pack", "Image folders into one recording, pixels as they are");
  command->add_option("--frames", options->frames, "Folder that holds the frame folders")
      ->required();
  command->add_option("--out", options->out, "The recording to make (recording.zarr)")->required();
  command
      ->add_option("--compression", options->compression,
                   "zstd: smallest; lz4: seven times as fast; none")
      ->check(one_of({"zstd", "lz4", "none"}))
      ->capture_default_str();
  command->add_option("--times", options->pack.times,
                      "Time stamps in ns: frame,<camera>,<camera>,... (default: timestamps.csv "
                      "beside the frame folders)");
  command
      ->add_option("--exposure-us", options->pack.exposure_us,
                   "How long the shutters were open; 0: unknown")
      ->check(zero_or_more())
      ->capture_default_str();
  command->add_flag("--overwrite", options->pack.overwrite, "Replace an earlier recording");
  add_common_options(*command, options->common,
                     "pencilscan sequence pack --frames frames --out recording.zarr");
  command->callback([options] { run_pack(*options); });
}

void run_unpack(const PackCommand& command) {
  const ThreadLimit threads(command.common.threads);
  const Recording recording = Recording::open(command.frames);
  if (!command.pack.overwrite && std::filesystem::exists(command.out) &&
      !std::filesystem::is_empty(command.out))
    throw InputError("--out", "", command.out, "must be new or empty (or give --overwrite)");
  print_packed(command.common,
               unpack_recording(recording, group_frames(recording), command.out, stderr_progress()),
               command.out);
}

void add_unpack(CLI::App& group) {
  auto options = std::make_shared<PackCommand>();
  CLI::App* command =
      group.add_subcommand("unpack", "A recording into folders of PNG files, one per moment");
  command->add_option("--frames", options->frames, "The recording")->required();
  command->add_option("--out", options->out, "Folder for the frame folders")->required();
  command->add_flag("--overwrite", options->pack.overwrite, "Replace pictures that are there");
  add_common_options(*command, options->common,
                     "pencilscan sequence unpack --frames recording.zarr --out frames");
  command->callback([options] { run_unpack(*options); });
}

// ---- pencilscan sequence info -------------------------------------------------------------------

struct InfoCommand {
  CommonOptions common;
  std::string frames;
};

/// "000012, 000020 and 5 more".
std::string frame_list(const std::vector<std::size_t>& frames) {
  std::vector<std::string> names;
  for (const std::size_t k : frames) names.push_back(six_digits(k));
  return name_list(names, kNamedFrames);
}

Json names_of(const std::vector<std::size_t>& frames) {
  Json names = Json::array();
  for (const std::size_t k : frames) names.push_back(six_digits(k));
  return names;
}

Json camera_figures(const RecordedCamera& camera, const CameraClock& clock, std::size_t lost) {
  Json figures;
  figures["size"] = std::to_string(camera.width) + "x" + std::to_string(camera.height);
  figures["pixels"] = (camera.channels == 3 ? "RGB " : "grey or mosaic ") +
                      std::to_string(camera.bit_depth) + " bit";
  if (camera.exposure_us > 0) figures["exposure_us"] = camera.exposure_us;
  figures["missing"] = clock.dropped.size();
  if (lost > 0) figures["lost"] = lost;
  if (!clock.left_out.empty()) figures["left_out"] = clock.left_out.size();
  if (!clock.timed) return figures;
  figures["late"] = clock.late.size();
  figures["clock_shift_ms"] = clock.shift_ns / 1e6;
  figures["clock_drift_ppm"] = clock.drift_ppm;
  return figures;
}

void say_what_is_wrong(const Recording& recording, const FrameSets& sets,
                       const LostPictures& lost) {
  if (!recording.is_closed())
    warn_of("the recording was cut off or goes on: it ends with the last picture that is whole");
  if (!sets.by_row)
    warn_of("the rows are not the moments: pictures are grouped by their time stamps");
  for (std::size_t c = 0; c < sets.clocks.size(); ++c) {
    const CameraClock& clock = sets.clocks[c];
    const std::string who = "camera " + recording.cameras()[c].name;
    if (!clock.dropped.empty())
      warn_of(who + " has no picture in " + std::to_string(clock.dropped.size()) +
              " frames: " + frame_list(clock.dropped));
    if (!clock.late.empty())
      warn_of(who + " is early or late in " + std::to_string(clock.late.size()) +
              " frames: " + frame_list(clock.late));
    if (!clock.shared)
      warn_of(who + ": its clock counts from another moment; it was shifted onto the others'");
  }
  for (const std::string& warning : recording_warnings(recording, sets)) warn_of(warning);
  for (const std::string& warning : lost_warnings(recording, lost)) warn_of(warning);
  for (const auto& [before, count] : sets.gaps)
    warn_of("before frame " + six_digits(before) + " " + std::to_string(count) +
            " moments are missing in all cameras");
}

void run_info(const InfoCommand& command) {
  const Recording recording = Recording::open(command.frames);
  const FrameSets sets = group_frames(recording);
  Json figures;
  figures["frames"] = sets.sets.size();
  figures["closed"] = recording.is_closed();
  figures["grouped_by"] = sets.by_row ? "row" : "time stamp";
  if (sets.period_ns > 0) {
    figures["frames_per_second"] = 1e9 / sets.period_ns;
    std::vector<double> spreads;
    for (const FrameSet& set : sets.sets) spreads.push_back(set.spread_ns / 1000);
    figures["spread_us"] = {{"median", lower_quantile(spreads, 0.5)},
                            {"p90", lower_quantile(spreads, 0.9)},
                            {"max", *std::max_element(spreads.begin(), spreads.end())}};
  }
  const LostPictures lost = lost_pictures(recording, sets);
  for (std::size_t c = 0; c < sets.clocks.size(); ++c)
    figures["cameras"][recording.cameras()[c].name] =
        camera_figures(recording.cameras()[c], sets.clocks[c], lost[c].size());
  print_figures({}, figures);
  say_what_is_wrong(recording, sets, lost);
  if (command.common.json_path.empty()) return;
  for (std::size_t c = 0; c < sets.clocks.size(); ++c) {
    Json& camera = figures["cameras"][recording.cameras()[c].name];
    camera["missing_frames"] = names_of(sets.clocks[c].dropped);
    camera["lost_frames"] = names_of(lost[c]);
    camera["late_frames"] = names_of(sets.clocks[c].late);
  }
  write_figures(command.common, figures);
}

void add_info(CLI::App& group) {
  auto options = std::make_shared<InfoCommand>();
  CLI::App* command = group.add_subcommand(
      "info", "What a recording holds: cameras, clocks, missing, lost and late pictures");
  command->add_option("--frames", options->frames, "The recording")->required();
  add_common_options(*command, options->common, "pencilscan sequence info --frames recording.zarr");
  command->callback([options] { run_info(*options); });
}

}  // namespace

void add_sequence_command(CLI::App& app) {
  CLI::App* group =
      app.add_subcommand("sequence", "Thousands of frames: pack, spread over machines, watch");
  group->require_subcommand(1);
  group->footer("Example:\n  pencilscan sequence pack --frames frames --out recording.zarr");
  add_pack(*group);
  add_unpack(*group);
  add_info(*group);
  add_sequence_jobs(*group);
  add_sequence_export(*group);
}

}  // namespace pencilscan::cli
