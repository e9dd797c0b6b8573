#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "pencilscan/capture/gathering.h"
#include "pencilscan/capture/live_cameras.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

struct RecordOptions {
  double rate_hz = 10;       ///< at which pictures are to come; > 0
  double seconds = 0;        ///< to record; 0: until `frames` or stopped
  std::size_t frames = 0;    ///< to record; 0: until `seconds` or stopped
  double max_spread_ms = 0;  ///< as of GatheringOptions
  bool one_clock = false;
  bool one_trigger = false;
  bool software_trigger = false;  ///< we set the pace, by trigger()
  /// Nothing moves: the pictures of a frame may be so far apart, s, and are waited for so long;
  /// software triggers wait until every camera answered the one before. 0: it moves.
  double still_s = 0;
  /// Frames with a picture missing, or out of time, are kept (their pictures are what there is);
  /// false: they are left out.
  bool keep_partial = true;
  std::size_t queue = 48;  ///< frames that may wait for the disk
};

struct RecordReport {
  std::size_t frames = 0;      ///< written
  std::size_t whole = 0;       ///< of them, with a picture of every camera, in time
  std::size_t left_out = 0;    ///< not whole, and not kept
  std::size_t disk_drops = 0;  ///< the disk was too slow for
  double seconds = 0;
  std::vector<CameraTally> tallies;  ///< per camera
  std::vector<std::size_t> missing;  ///< per camera: frames without a picture of it
  FrameGathering::Spread spread;
  std::size_t most_waiting = 0;  ///< frames that waited for the disk, at most
  std::vector<Fault> faults;     ///< of cameras, gathering and disk
};

/// What is told while it runs, a few times a second; true: go on.
using RecordWatch = std::function<bool(const RecordReport& so_far)>;

/// Records until it is over into `out`: recording.zarr where its name ends in ".zarr", else image
/// folders `out`/000000/<camera>.png. `rig`: its cameras in the order of `cameras`; a mosaic that
/// it does not state is made colour, as in Gray-code captures. The cameras run. It begins when all
/// of them have given some pictures, so that their clocks are known, or after two seconds; at once
/// where all are folders that others fill, which may never get a second picture. Whatever is
/// missing is named in the report. InputError when `out` is there already and not empty; StageError
/// when the disk is full, or a camera delivers another mosaic than the rig states.
[[nodiscard]] RecordReport record(LiveCameras& cameras, const Rig& rig,
                                  const std::filesystem::path& out, const RecordOptions& options,
                                  const RecordWatch& watch = {});

}  // namespace pencilscan
