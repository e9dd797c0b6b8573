#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "pencilscan/capture/live_cameras.h"
#include "pencilscan/capture/picture_check.h"
#include "pencilscan/display/projector_screen.h"

namespace pencilscan {

struct GrayCaptureOptions {
  bool inverses = true;
  bool solids = false;  ///< also the even colours, for crosstalk (cameras in colour)
  /// Per projector: from show() to the first picture that shows all of it, ms, as
  /// test_projectors() measures it (ProjectorTiming::use_ms); empty or 0: not measured, a careful
  /// guess is taken.
  std::vector<double> delay_ms;
  int retakes = 3;        ///< of a picture that fails its check, >= 0
  double patience_s = 3;  ///< for a picture of every camera, > 0
};

struct GrayCaptureReport {
  std::size_t pictures = 0;  ///< shown and taken, retakes too
  std::size_t retaken = 0;
  std::size_t resumed = 0;  ///< projectors that were there already
  /// Projectors whose pictures cannot be used: the same capture takes them anew.
  std::vector<std::string> refused;
  double seconds = 0;
  double waiting_seconds = 0;  ///< of them, for the projectors' delay and the cameras' pictures
  std::vector<Fault> faults;   ///< empty: the capture can be used as it is
  /// [projector][camera]: what each camera sees of each projector.
  std::vector<std::vector<LitView>> views;
};

/// Called with what is being taken and the share done; false: stop.
using GrayCaptureWatch = std::function<bool(const std::string& what, double share)>;

/// Called with every projector that is complete, from the calling thread.
using ProjectorDone = std::function<void(std::size_t projector)>;

/// Takes Gray-code captures of all projectors one after the other, the others black, with all
/// cameras at once, into `out`/<projector>/<camera>/NNN.png (docs/formats.md). A camera that sees
/// nothing of a projector gets no folder.
///
/// Every pair of pattern and inverse is checked while the next picture is taken, in every camera;
/// what fails is taken again. White is shown once more at the end, to see whether something moved.
/// A projector's folder appears when it is complete and has no fault, so that a capture that was
/// stopped goes on where it was: existing projectors are kept. Until then it is
/// `out`/.<projector>.part, and stays there for a look when it is refused; the next capture takes
/// it anew. What moved under one projector had another pose under those before it: these are
/// refused, too, where capture.json says that they were taken so. `rig`: names and sizes of the
/// cameras, in the order of `cameras`. InputError where the capture.json of a projector that is
/// there already contradicts this capture; then nothing is shown.
///
/// A camera that is gone, or gives no pictures any more, ends the capture; the next one goes on.
/// Faults: picture (given up after the retakes), moved, missing (a camera gives no pictures), dead,
/// unseen (no camera sees the projector), and those of the screen.
[[nodiscard]] GrayCaptureReport capture_gray_codes(LiveCameras& cameras, ProjectorScreen& screen,
                                                   const Rig& rig, const std::filesystem::path& out,
                                                   const GrayCaptureOptions& options,
                                                   const GrayCaptureWatch& watch = {},
                                                   const ProjectorDone& done = {});

}  // namespace pencilscan
