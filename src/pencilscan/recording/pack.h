#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pencilscan/core/progress.h"
#include "pencilscan/recording/frame_sets.h"
#include "pencilscan/recording/recording_writer.h"

namespace pencilscan {

/// What went into a recording or came out of it.
struct PackReport {
  std::size_t frames = 0;
  std::vector<std::string> cameras;
  std::size_t pictures = 0;
  std::size_t missing = 0;  ///< pictures of a frame that are not there
  std::vector<std::string> warnings;
};

struct PackOptions {
  ZarrCompression compression = ZarrCompression::kZstd;
  std::filesystem::path times;  ///< timestamps.csv: frame, then nanoseconds per camera; or empty
  double exposure_us = 0;       ///< of all cameras; 0: unknown
  bool overwrite = false;
};

/// Makes a recording of image folders (`frames/<frame>/<camera>.png` and so on), pixels as stored.
/// Folders of six digits keep their number as their row, so that a gap stays a gap: rows without
/// pictures, which are no frames. Folders without a picture are left out with a warning. InputError
/// for pictures that are damaged or of another size or type than the camera's others, and for time
/// stamps of other cameras, of a frame that stands twice, or of none of the frames. Warns of
/// pictures and time stamps that found no partner. Nothing is written among what is packed. The
/// recording is made in `<out>.partial` and
/// appears whole; an earlier one stays until then. Warns of what order_warning() says, too.
PackReport pack_recording(const std::filesystem::path& frames, const std::filesystem::path& out,
                          const PackOptions& options = {}, const Progress& progress = {});

/// The opposite: a folder of PNG files per frame set, and timestamps.csv where there are times.
/// InputError where `out` is the recording, lies in it, or holds pictures or times that would stay,
/// and be taken for this set's.
PackReport unpack_recording(const Recording& recording, const FrameSets& sets,
                            const std::filesystem::path& out, const Progress& progress = {});

/// Says which rows or moments are no frames (FrameSets::no_frame), and which pictures are in no
/// frame, a sentence a camera (CameraClock::left_out); that time stamps are in another unit, and
/// where they do not grow.
[[nodiscard]] std::vector<std::string> recording_warnings(const Recording& recording,
                                                          const FrameSets& sets);

/// Per camera the numbers of the sets whose picture of it was lost: it was recorded, and its file
/// is no longer there.
using LostPictures = std::vector<std::vector<std::size_t>>;
[[nodiscard]] LostPictures lost_pictures(const Recording& recording, const FrameSets& sets);
/// A sentence for each camera of them.
[[nodiscard]] std::vector<std::string> lost_warnings(const Recording& recording,
                                                     const LostPictures& lost);

}  // namespace pencilscan
