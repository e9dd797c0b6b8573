#include "pencilscan/jobs/change_events.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "pencilscan/core/median.h"
#include "pencilscan/jobs/change_words.h"
#include "pencilscan/pipeline/repeated_pictures.h"
#include "pencilscan/refinement/device_mover.h"

namespace pencilscan {
namespace {

/// What is said of a change, without its text.
SequenceEvent event_from(std::span<const FrameRow> rows, const FoundChange& found,
                         const std::string& device) {
  const Change& change = found.change;
  return {change.at,    change.end.value_or(rows.size()) - 1,
          !change.end,  found.figure->kind,
          device,       change.before,
          change.after, ""};
}

/// The middle one of the places where changes end.
std::optional<std::size_t> end_of_most(const std::vector<FoundChange>& together, std::size_t rows) {
  std::vector<std::size_t> ends;
  for (const FoundChange& f : together) ends.push_back(f.change.end.value_or(rows));
  const std::size_t end = upper_median(std::move(ends));
  return end < rows ? std::optional(end) : std::nullopt;
}

/// What cameras lost of their named curves, or won, with a lamp.
std::string named_with(const std::vector<FoundChange>& together, const SequenceDevices& devices) {
  const FoundChange* most = nullptr;
  std::size_t count = 0;
  const auto size = [](const FoundChange& f) { return std::abs(f.named->after - f.named->before); };
  for (const FoundChange& f : together) {
    if (!f.named) continue;
    ++count;
    if (most == nullptr || size(f) > size(*most)) most = &f;
  }
  if (most == nullptr) return "";
  return "; with it the share of curves that has a line, in " + std::to_string(count) +
         " of them, most in " + bare_name(devices, most->figure->device) + ": " +
         from_to("labelled", *most->named);
}

/// Crossings meet again as they should.
bool agrees_again(const FoundChange& found) {
  return is_shift(found) ? std::abs(found.change.after) < kSmallestMovePx : !rises(found);
}

double size_of(const FoundChange& found) {
  return std::abs(found.change.after - found.change.before);
}

/// Whether a camera's crossings meet with its picture where it was, so that it did not turn away.
/// Where noise hides how much they miss, the change is noticed some frames late: medians of many
/// frames on both sides, so that these are outvoted.
bool is_steady(std::span<const FrameRow> rows, const FoundChange& found) {
  const std::size_t camera = found.figure->device;
  if (camera >= rows[0].cameras.size()) return false;
  const auto change = [&](double CameraRow::*shift) {
    const auto [before, within] = long_before_and_within(
        rows, found.change, [&](const FrameRow& row) { return row.cameras[camera].*shift; });
    return within - before;
  };
  return std::hypot(change(&CameraRow::shift_x_px), change(&CameraRow::shift_y_px)) <
         kSmallestMovePx;
}

}  // namespace

SequenceEvent event_of(std::span<const FrameRow> rows, const SequenceDevices& devices,
                       const FoundChange& found) {
  const Change& change = found.change;
  const std::string& kind = found.figure->kind;
  const bool up = change.after > change.before;
  const bool lines_too = kind == "level" && up && lines_got_light(rows, devices, change.at);
  SequenceEvent event = event_from(rows, found, bare_name(devices, found.figure->device));
  event.text =
      name_of(devices, found.figure->device) + ": " + quantity(kind) + from_to(kind, change);
  const std::string cause = usual_cause(kind, {.up = up, .lines_too = lines_too});
  if (!cause.empty()) event.text += " (" + cause + ")";
  if (found.named) event.text += "; " + quantity("labelled") + from_to("labelled", *found.named);
  return event;
}

SequenceEvent event_of_all(std::span<const FrameRow> rows, const SequenceDevices& devices,
                           const std::vector<FoundChange>& together) {
  FoundChange middle = together[together.size() / 2];
  const std::string& kind = middle.figure->kind;
  const std::size_t first = together.front().change.at;
  const bool up = rises(middle);
  const bool lines_too = kind == "level" && up && lines_got_light(rows, devices, first);
  middle.change.at = first;
  middle.change.end = end_of_most(together, rows.size());
  const bool is_spread =
      kind == "light" && light_is_spread(rows, first, middle.change.after / middle.change.before);
  SequenceEvent event = event_from(rows, middle, "");
  event.text =
      std::to_string(together.size()) + (kind == "light" ? " projectors: " : " cameras: ") +
      quantity(kind) + from_to(kind, middle.change) + " (" +
      usual_cause(kind, {up, true, lines_too, is_spread}) + ")" + named_with(together, devices);
  return event;
}

SequenceEvent event_of_crossings(std::span<const FrameRow> rows, const SequenceDevices& devices,
                                 std::vector<FoundChange> together) {
  constexpr double kClearly = 1.3;  // a projector over the next one
  std::stable_sort(
      together.begin(), together.end(),
      [](const FoundChange& a, const FoundChange& b) { return size_of(a) > size_of(b); });
  std::set<std::size_t> cameras;
  std::vector<const FoundChange*> projectors;
  const FoundChange* of_camera = nullptr;
  std::size_t first = together.front().change.at;
  for (const FoundChange& f : together) {
    first = std::min(first, f.change.at);
    if (f.figure->device >= devices.cameras.size()) {
      projectors.push_back(&f);
      continue;
    }
    cameras.insert(f.figure->device);
    // What crossings miss is told where it is known.
    if (of_camera == nullptr || (is_shift(*of_camera) && !is_shift(f))) of_camera = &f;
  }
  const bool one_camera = cameras.size() == 1 && devices.cameras.size() > 1;
  const bool one_projector =
      !one_camera && cameras.size() != 1 && !projectors.empty() &&
      (projectors.size() == 1 ? devices.projectors.size() > 1
                              : size_of(*projectors[0]) > kClearly * size_of(*projectors[1]));
  const FoundChange& most = one_camera      ? *of_camera
                            : one_projector ? *projectors.front()
                                            : together.front();
  FoundChange whole = most;
  whole.change.at = first;
  whole.change.end = end_of_most(together, rows.size());
  SequenceEvent event = event_from(rows, whole, "");
  event.kind = "crossings";
  const bool is_back = std::all_of(together.begin(), together.end(), agrees_again);
  if (one_camera || one_projector) {
    event.device = bare_name(devices, most.figure->device);
    event.text = name_of(devices, most.figure->device) + ' ';
    if (std::none_of(together.begin(), together.end(), is_shift) && is_steady(rows, most)) {
      event.text += "stands where it stood, its crossing lines miss each other by " +
                    from_to(most.figure->kind, most.change) +
                    " (px; turned about its axis, focus, or motion within the exposure); rig check "
                    "--frames says more";
      return event;
    }
    event.text += is_back ? "is again where the rig has it" : "moved";
  } else {
    event.text = is_back ? "devices are again where the rig has them"
                         : "devices moved, which one these figures do not tell";
  }
  event.text += is_shift(most) ? ": crossing lines meet when its picture is shifted by "
                               : ": crossing lines miss each other by ";
  event.text += from_to(most.figure->kind, most.change) + " (px)";
  if (!is_back)
    event.text += "; rig check --frames says more, --refine-rig corrects the frames from here";
  return event;
}

std::vector<SequenceEvent> repetitions_of(std::span<const FrameRow> rows,
                                          const SequenceDevices& devices) {
  std::vector<std::vector<std::uint64_t>> hashes;
  for (const FrameRow& row : rows) {
    std::vector<std::uint64_t>& of_frame = hashes.emplace_back();
    for (const CameraRow& camera : row.cameras) of_frame.push_back(camera.picture);
  }
  std::vector<SequenceEvent> events;
  for (const RepeatedPicture& r : repeated_pictures(hashes)) {
    const std::string& camera = devices.cameras[r.camera];
    events.push_back({r.first + 1, r.last, r.last + 1 == rows.size(), "repeated", camera, 0,
                      static_cast<double>(r.last - r.first),
                      describe_repeated(camera, rows[r.first].name, rows[r.last].name)});
  }
  return events;
}

}  // namespace pencilscan
