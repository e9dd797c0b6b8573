#pragma once

#include <string_view>

#include "pencilscan/api/reconstruct.h"
#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// What reconstruct() and its stages share: the caller's pictures and options as the pipeline takes
/// them, and its result as the caller gets it.

/// The pictures of a frame. InputError where they do not fit the rig.
[[nodiscard]] Frame frame_of(const Rig& rig, const Images& images,
                             const ReconstructionOptions& options);
/// InputError for an unknown method, or a rig that does not fit it.
[[nodiscard]] FrameOptions frame_options(const Rig& rig, const ReconstructionOptions& options);
[[nodiscard]] Reconstruction reconstruction_of(const Rig& rig, const Frame& frame,
                                               FrameResult found, bool depth_maps);

/// The stages that are told, in order.
[[nodiscard]] std::span<const std::string_view> told_stages();

}  // namespace pencilscan
