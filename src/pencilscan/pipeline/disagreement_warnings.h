#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/core/warning.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/lost_cameras.h"
#include "pencilscan/pipeline/view_agreement.h"

namespace pencilscan {

/// Crossings miss each other by more than noise; what was done about it.
[[nodiscard]] Warning rig_warning(const CrossingDisagreement& crossings, RigInFrame rig_in_frame);

/// The one device whose crossings miss each other by far more than noise, where the rig as a whole
/// does not (per device: cameras, then projectors). Counts alike in all resolutions.
[[nodiscard]] std::optional<std::size_t> device_that_is_off(
    std::span<const CrossingDisagreement> device_crossings);
/// By how much its crossings miss, and what noise explains, in plain words.
[[nodiscard]] std::string misses_text(const Device& device, const CrossingDisagreement& crossings);
[[nodiscard]] std::optional<Warning> device_warning(
    const Rig& rig, std::span<const CrossingDisagreement> device_crossings);

/// That one camera stands a little elsewhere, by what the others measure.
[[nodiscard]] Warning turned_warning(const Rig& rig, const TurnedCamera& turned);

/// That what one camera sees lies apart from what the others see, and that it was left out, or not.
[[nodiscard]] Warning another_moment_warning(const Rig& rig, std::size_t camera,
                                             const ViewsApart& apart, bool is_left_out);

/// That depths of different cameras are not those of one surface, by so many deviations.
[[nodiscard]] Warning views_warning(double deviations);

/// That depth maps of different cameras do not fit each other, over whole patches or each place by
/// itself, where nothing that was `said` explains it. The second is no fault of the rig.
[[nodiscard]] std::optional<Warning> depth_warning(const ConsistencyReport& depth,
                                                   std::span<const Warning> said);

/// Puts findings on gamma first, and leaves out that views disagree, which it explains. Crossings
/// meet as well with a gamma as without: findings on them stay.
void let_gamma_explain(std::vector<Warning>& warnings);

}  // namespace pencilscan
