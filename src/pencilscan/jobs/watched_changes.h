#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "pencilscan/jobs/changes.h"
#include "pencilscan/jobs/watch.h"

namespace pencilscan {

using Reading = std::function<double(const FrameRow&)>;

/// A figure of one device that is watched.
struct WatchedFigure {
  std::string kind;
  std::size_t device = 0;  ///< cameras, then projectors
  bool is_ratio = false;   ///< its logarithm is watched: what counts is the factor
  double smallest = 0;     ///< change that counts, of the logarithm where is_ratio
  Reading value;
  bool follows = true;  ///< ChangeOptions; false: motion hardly changes it, a device's drift does
  Reading beside = {};  ///< a change counts where this one's logarithm changes as much, too
  Reading beyond = {};  ///< a rise counts where this is above `smallest` after it, a fall before
};

/// A change of a watched figure.
struct FoundChange {
  const WatchedFigure* figure = nullptr;
  Change change;                     ///< of the figure itself
  std::optional<Change> named = {};  ///< of a lamp's light: of the camera's named share with it
};

[[nodiscard]] bool in_order(const FoundChange& a, const FoundChange& b);  ///< by frame, then kind
[[nodiscard]] bool rises(const FoundChange& found);
/// A shift of a camera's picture with which its crossings meet.
[[nodiscard]] bool is_shift(const FoundChange& found);

/// "cam1" and "camera cam1"; devices are cameras, then projectors.
[[nodiscard]] const std::string& bare_name(const SequenceDevices& devices, std::size_t device);
[[nodiscard]] std::string name_of(const SequenceDevices& devices, std::size_t device);

/// What is watched of these devices, each with the smallest change that counts
/// (docs/sequences.md).
[[nodiscard]] std::vector<WatchedFigure> watched_figures(const SequenceDevices& devices);

/// Changes of these figures over the frames that are done, those that other figures do not bear out
/// left out, in the order of frames. Single frames that are odd are added to `odd`. The changes
/// point to the figures.
[[nodiscard]] std::vector<FoundChange> find_watched_changes(std::span<const FrameRow> rows,
                                                            const SequenceDevices& devices,
                                                            const std::vector<WatchedFigure>& all,
                                                            std::vector<OddFrame>& odd);

/// Medians over the frames before row `at`, and over `frames_after` from there on. Before the first
/// ones nothing is known: then the first median is over the frames after these.
[[nodiscard]] std::pair<double, double> before_and_after(std::span<const FrameRow> rows,
                                                         std::size_t at, std::size_t frames_after,
                                                         const Reading& reading);

/// Medians over as many frames as changes.h remembers, before and within the change; where none is
/// known before it, over those after it.
[[nodiscard]] std::pair<double, double> long_before_and_within(std::span<const FrameRow> rows,
                                                               const Change& change,
                                                               const Reading& reading);

/// True where a projector's points or the light on lines rose at row `at`: more light then came
/// from the projectors.
[[nodiscard]] bool lines_got_light(std::span<const FrameRow> rows, const SequenceDevices& devices,
                                   std::size_t at);
/// True where the pictures of all cameras stay about as bright at row `at`, though the light on
/// lines falls to `share`: out of focus it is spread, not less.
[[nodiscard]] bool light_is_spread(std::span<const FrameRow> rows, std::size_t at, double share);

}  // namespace pencilscan
