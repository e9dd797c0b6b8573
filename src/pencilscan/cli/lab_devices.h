#pragma once

#include <memory>
#include <string>

#include "pencilscan/capture/gray_capture.h"
#include "pencilscan/capture/lab_file.h"
#include "pencilscan/capture/projector_tests.h"
#include "pencilscan/capture/record.h"
#include "pencilscan/display/projector_screen.h"

namespace pencilscan::cli {

/// Windows on the outputs that the laboratory, or else the rig, names. InputError and StageError as
/// of uses_of() and ProjectorWindows; for messages: the files of rig and laboratory.
[[nodiscard]] std::unique_ptr<ProjectorScreen> open_lab_screen(const Rig& rig, const Lab& lab,
                                                               const std::string& rig_source,
                                                               const std::string& lab_source);

/// All cameras of the rig, opened, set and running; exposures that the laboratory does not state
/// are filled in with the cameras' own. InputError where a camera delivers another mosaic than the
/// rig states. `source`: lab.json, for messages.
[[nodiscard]] std::unique_ptr<LiveCameras> start_lab_cameras(const Rig& rig, Lab& lab,
                                                             const std::string& source);

/// Delays and patience as the laboratory has them.
[[nodiscard]] GrayCaptureOptions gray_options(const Rig& rig, const Lab& lab);

[[nodiscard]] ProjectorTestOptions test_options(const Lab& lab);

/// Rate, trigger and limit of the spread as the laboratory has them; `still`: nothing moves.
[[nodiscard]] RecordOptions record_options(const Lab& lab, bool still);

}  // namespace pencilscan::cli
