#pragma once

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// A frame as the sensors gave it. Pictures of 16 bits whose values need 10, 12 or 14 are those of
/// such a sensor, and have its range. Pictures whose colours were filled in behind a mosaic are
/// their samples again where these stand in them unchanged (detection/mosaic_trace.h), and their
/// cameras have that mosaic; a note says which.
struct SensorFrame {
  Rig rig;
  Frame frame;
};

[[nodiscard]] SensorFrame sensor_frame(Rig rig, Frame frame);

/// Curves of a frame as it was read, for those who want nothing else of it.
[[nodiscard]] PointResult detect_stored_frame(const Rig& rig, Frame frame,
                                              const PointOptions& options = {});

}  // namespace pencilscan
