#include "pencilscan/cli/rig_fit_command.h"

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pencilscan/cli/arguments.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/pipeline/frame_source.h"
#include "pencilscan/pipeline/rig_periods.h"
#include "pencilscan/pipeline/sensor_frame.h"

namespace pencilscan::cli {
namespace {

struct PickedFrames {
  std::vector<FrameCurves> curves;
  std::vector<std::string> names;
};

/// The curves of so many frames, evenly picked, the first and the last one among them.
PickedFrames picked_frames(const Rig& rig, const FrameSource& frames, std::size_t wanted) {
  const Progress progress = stderr_progress();
  const std::size_t count = std::min(frames.size(), wanted);
  PickedFrames picked;
  for (std::size_t i = 0; i < count; ++i) {
    progress("lines of the frames", static_cast<double>(i) / static_cast<double>(count));
    // Of one frame that is looked at, the last: what the rig is like now.
    const std::size_t frame =
        count == 1 ? frames.size() - 1 : i * (frames.size() - 1) / (count - 1);
    PointResult detected = detect_stored_frame(rig, frames.read(rig, frame));
    picked.curves.push_back({std::move(detected.families), std::move(detected.graphs)});
    picked.names.push_back(frames.name(frame));
  }
  return picked;
}

void print_devices(const RigFit& fit) {
  std::printf("%-12s %9s %12s %12s %10s %12s\n", "device", "crossings", "they miss px",
              "expected px", "off by px", "seen from px");
  for (const DeviceFit& device : fit.devices) {
    std::printf("%-12s %9zu %12.3f %12.3f %10.3f %12.3f%s\n", device.name.c_str(),
                device.crossings.crossings, device.crossings.median_px,
                device.crossings.expected_px, device.shift_px, device.seen_from_px,
                device.has_moved ? "  moved" : "");
  }
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace

void add_rig_fit_options(CLI::App& command, RigFitCommand& options) {
  CLI::Option* frames =
      command.add_option("--frames", options.frames,
                         "Folder of frame folders, or a recording: does the rig still fit them?");
  add_number(command, "--frame-count", options.frame_count, 1, 1000,
             "Frames to look at, evenly picked")
      ->needs(frames);
  CLI::Option* put_back =
      command
          .add_option("--put-back", options.put_back,
                      "Write the rig with the devices that moved put back (rig.json)")
          ->needs(frames);
  add_overwrite(command, options.overwrite, "With --put-back: replace a rig file that is there",
                put_back);
}

void run_rig_fit(const CommonOptions& common, const std::string& rig_path,
                 const RigFitCommand& options) {
  if (!options.put_back.empty()) refuse_existing("--put-back", options.put_back, options.overwrite);
  const Rig rig = read_rig(rig_path);
  require_patterns(rig, rig_path, "there is nothing to see of this projector");
  const FrameSource frames = FrameSource::open(rig, options.frames);
  const PickedFrames picked = picked_frames(rig, frames, options.frame_count);
  const std::vector<RigPeriod> periods =
      check_rig_over_frames(rig, picked.curves, {}, stderr_progress());
  for (const RigPeriod& period : periods) {
    if (periods.size() > 1) std::printf("%s\n", frames_of(period, picked.names).c_str());
    print_devices(period.fit);
  }
  const RigFit& fit = periods.back().fit;  // how the rig stands now
  nlohmann::ordered_json report = periods_json(periods, picked.names);
  write_figures(common, report);
  report.erase("devices");
  report.erase("periods");
  print_figures({}, report);
  const bool is_known = fit.verdict == RigVerdict::kFits || fit.verdict == RigVerdict::kOneMoved ||
                        fit.verdict == RigVerdict::kSeveralMoved;
  if (is_known && !options.put_back.empty()) write_rig(fit.put_back, options.put_back);
  if (verdict_of(periods) != to_string(RigVerdict::kFits)) {
    throw StageError(
        describe_periods(periods, picked.names) +
        (is_known || options.put_back.empty() ? "" : "; " + options.put_back + " was not written"));
  }
}

}  // namespace pencilscan::cli
