#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pencilscan/detection/mosaic_trace.h"
#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// What is wrong with the picture of a camera.
enum class PictureFault {
  kBlack,             ///< no light in it
  kGrey,              ///< its colours are gone, and lines are told apart by colour
  kUnstatedMosaic,    ///< its colours are the samples of a mosaic that the rig does not state
  kOtherMosaic,       ///< its green samples lie where the stated mosaic has red and blue
  kRepeated,          ///< another camera has the same picture
  kRedBlueExchanged,  ///< its channels are stored as blue, green, red
  kExchanged,         ///< it fits where another camera stands
  kTurned,            ///< by half a turn
  kMirrored,          ///< left and right
  kUpsideDown,        ///< mirrored top and bottom
  kDoesNotFit,        ///< none of these: another moment, or the camera was moved or is out of focus
};

struct PictureFinding {
  PictureFault fault = PictureFault::kBlack;
  int camera = 0;
  int other = -1;                 ///< the camera that has the same picture, or that it is of
  Greens greens = Greens::kNone;  ///< of the mosaic in the picture
  double contrast = 1;  ///< of its lines, of what is usual in the others (line_contrast.h)
};

/// One sentence for the user: which camera, what is wrong, what to do.
[[nodiscard]] std::string describe(const Rig& rig, const PictureFinding& finding);

/// Faults that show without looking for lines: black, grey, of another mosaic, repeated. One a
/// camera at most.
[[nodiscard]] std::vector<PictureFinding> plain_faults(const Rig& rig, const Frame& frame);

/// Finds the fault of cameras whose curves the solution could not name. Each of the faults above is
/// undone in turn, and the camera's curves are named alone. The one after which most curves have a
/// name was the fault. Where none helps, the picture does not fit, unless it shows lines where
/// other cameras measured them (shown_lines.h): a camera may see little that two projectors light.
/// `found`: with the labels of all cameras (joint).
[[nodiscard]] std::vector<PictureFinding> misplaced_pictures(const Rig& rig, const Frame& frame,
                                                             const PointResult& found,
                                                             const PointOptions& options);

/// Finds the picture that fits the projectors but not what the other cameras see: two cameras are
/// exchanged in a ring that repeats itself, or one took its picture at another moment. Tried is
/// only what takes all contradictions away (view_agreement.h). `found` as above.
[[nodiscard]] std::vector<PictureFinding> contradicting_pictures(const Rig& rig, const Frame& frame,
                                                                 const PointResult& found,
                                                                 const PointOptions& options);

/// True where each camera with enough to say shows lines where the others measured them
/// (shown_lines.h), two cameras at least. `found` as above.
[[nodiscard]] bool points_lie_on_lines(const Rig& rig, const PointResult& found);

/// Finds two projectors that show each other's patterns: their lines have next to no names, and
/// each of the cameras with the smallest named share gets more once these are exchanged. `found` as
/// above. Only projectors with panels of one size and different patterns are tried.
[[nodiscard]] std::optional<std::pair<int, int>> exchanged_projectors(const Rig& rig,
                                                                      const Frame& frame,
                                                                      const PointResult& found,
                                                                      const PointOptions& options);

}  // namespace pencilscan
