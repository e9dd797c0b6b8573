#include "pencilscan/jobs/watch.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <optional>
#include <set>
#include <tuple>

#include "pencilscan/core/median.h"
#include "pencilscan/jobs/change_words.h"
#include "pencilscan/jobs/changes.h"
#include "pencilscan/jobs/finding_events.h"
#include "pencilscan/pipeline/repeated_pictures.h"

namespace pencilscan {
namespace {

using Reading = std::function<double(const FrameRow&)>;

/// A figure of one device that is watched.
struct Series {
  std::string kind;
  std::size_t device = 0;  ///< cameras, then projectors
  bool is_ratio = false;   ///< its logarithm is watched: what counts is the factor
  double smallest = 0;     ///< change that counts, of the logarithm where is_ratio
  Reading value;
  bool follows = true;  ///< ChangeOptions; false: motion hardly changes it, a device's drift does
  Reading beside = {};  ///< a change counts where this one's logarithm changes as much, too
  Reading beyond = {};  ///< a rise counts where this is above `smallest` after it, a fall before
};

struct Found {
  const Series* series = nullptr;
  Change change;                     ///< of the figure itself
  std::optional<Change> named = {};  ///< of a lamp's light: of the camera's named share with it
};

bool in_order(const Found& a, const Found& b) {
  return std::tie(a.change.at, a.series->kind) < std::tie(b.change.at, b.series->kind);
}

bool rises(const Found& found) { return found.change.after > found.change.before; }

/// The smallest changes that count, each with what it does to the result.
const double kLabelled = 0.05;          // a twentieth of the points lost or won
const double kWidth = std::log(1.15);   // deviations of points grow with width^1.5: by a fifth
const double kHeight = std::log(1.25);  // they grow with noise over height: by a quarter
const double kLevel = std::log(1.25);   // as much more light without lines
const double kLight = kHeight;          // of the lines of a projector: the same
const double kPoints = std::log(4.0);   // a projector that lost three quarters of its points
/// Half of what the rule of disagreeing crossings (crossing_tracks.h) allows beyond noise.
constexpr double kCrossingsPx = 0.05;
/// As rig check (moved_devices.h): a camera that is off by less is as calibrated.
constexpr double kShiftPx = 0.2;

double finite_log(double value) { return value > 0 ? std::log(value) : kUnknownFigure; }

std::vector<Series> all_series(const SequenceDevices& devices) {
  std::vector<Series> all;
  for (std::size_t c = 0; c < devices.cameras.size(); ++c) {
    const auto of_camera = [&](const char* kind, bool is_ratio, double smallest,
                               double CameraRow::*member) {
      all.push_back({kind, c, is_ratio, smallest,
                     [c, member](const FrameRow& row) { return row.cameras[c].*member; }});
    };
    of_camera("labelled", false, kLabelled, &CameraRow::labelled_share);
    // A share also falls where more is seen that is no line.
    all.back().beside = [c](const FrameRow& row) { return row.cameras[c].labelled_points; };
    of_camera("width", true, kWidth, &CameraRow::line_width_px);
    all.back().follows = false;  // a lens creeps out of focus
    of_camera("level", true, kLevel, &CameraRow::image_level);
    of_camera(kShift, false, kShiftPx, &CameraRow::shift_x_px);
    of_camera(kShift, false, kShiftPx, &CameraRow::shift_y_px);
  }
  for (std::size_t d = 0; d < devices.cameras.size() + devices.projectors.size(); ++d) {
    all.push_back({"crossings", d, false, kCrossingsPx,
                   [d](const FrameRow& row) { return row.device_crossing_px[d]; }});
    all.back().beyond = [d](const FrameRow& row) {
      return row.device_crossing_px[d] - row.device_crossing_expected_px[d];
    };
    const bool is_camera = d < devices.cameras.size();
    all.push_back({is_camera ? "height" : "light", d, true, is_camera ? kHeight : kLight,
                   [d](const FrameRow& row) { return row.device_light[d]; }});
  }
  for (std::size_t p = 0; p < devices.projectors.size(); ++p) {
    // One is added, so that none is a number too.
    all.push_back({"projector", devices.cameras.size() + p, true, kPoints,
                   [p](const FrameRow& row) { return row.projector_points[p] + 1; }});
  }
  return all;
}

const std::string& bare_name(const SequenceDevices& devices, std::size_t device) {
  return device < devices.cameras.size() ? devices.cameras[device]
                                         : devices.projectors[device - devices.cameras.size()];
}

std::string name_of(const SequenceDevices& devices, std::size_t device) {
  return (device < devices.cameras.size() ? "camera " : "projector ") + bare_name(devices, device);
}

/// Median over the known ones of `count` frames, from `first` on.
template <class Row>
double median_of_done(Row first, Row last, std::size_t count, const Reading& reading) {
  std::vector<double> values;
  for (; first != last && values.size() < count; ++first) {
    const double value =
        first->status.state == FrameState::kDone ? reading(*first) : kUnknownFigure;
    if (std::isfinite(value)) values.push_back(value);
  }
  return values.empty() ? kUnknownFigure : upper_median(std::move(values));
}

/// Medians over the frames before row `at`, and over `frames_after` from there on. Before the first
/// ones nothing is known: then the first median is over the frames after these.
std::pair<double, double> before_and_after(std::span<const FrameRow> rows, std::size_t at,
                                           std::size_t frames_after, const Reading& reading) {
  const auto here = rows.begin() + static_cast<std::ptrdiff_t>(at);
  double before =
      median_of_done(std::make_reverse_iterator(here), rows.rend(), kFramesOfChange, reading);
  if (!std::isfinite(before)) {
    const std::size_t next = std::min(at + frames_after, rows.size());
    before = median_of_done(rows.begin() + static_cast<std::ptrdiff_t>(next), rows.end(),
                            kFramesOfChange, reading);
  }
  return {before, median_of_done(here, rows.end(), frames_after, reading)};
}

/// True where a projector's points or the light on lines rose at row `at`: more light then came
/// from the projectors.
bool lines_got_light(std::span<const FrameRow> rows, const SequenceDevices& devices,
                     std::size_t at) {
  const auto got_more = [&](double smallest, const Reading& reading) {
    const auto [before, after] = before_and_after(
        rows, at, kFramesOfChange, [&](const FrameRow& row) { return finite_log(reading(row)); });
    return after - before > smallest;  // false where one is unknown
  };
  for (std::size_t d = 0; d < devices.cameras.size() + devices.projectors.size(); ++d) {
    if (got_more(kLight, [d](const FrameRow& row) { return row.device_light[d]; })) return true;
  }
  for (std::size_t p = 0; p < devices.projectors.size(); ++p) {
    if (got_more(kPoints, [p](const FrameRow& row) { return row.projector_points[p] + 1; }))
      return true;
  }
  return false;
}

/// What is said of a change, without its text.
SequenceEvent event_from(std::span<const FrameRow> rows, const Found& found,
                         const std::string& device) {
  const Change& change = found.change;
  return {change.at,    change.end.value_or(rows.size()) - 1,
          !change.end,  found.series->kind,
          device,       change.before,
          change.after, ""};
}

SequenceEvent event_of(std::span<const FrameRow> rows, const SequenceDevices& devices,
                       const Found& found) {
  const Change& change = found.change;
  const std::string& kind = found.series->kind;
  const bool up = change.after > change.before;
  const bool lines_too = kind == "level" && up && lines_got_light(rows, devices, change.at);
  SequenceEvent event = event_from(rows, found, bare_name(devices, found.series->device));
  event.text =
      name_of(devices, found.series->device) + ": " + quantity(kind) + from_to(kind, change);
  const std::string cause = usual_cause(kind, up, false, lines_too);
  if (!cause.empty()) event.text += " (" + cause + ")";
  if (found.named) event.text += "; " + quantity("labelled") + from_to("labelled", *found.named);
  return event;
}

/// The middle one of the places where changes end.
std::optional<std::size_t> end_of_most(const std::vector<Found>& together, std::size_t rows) {
  std::vector<std::size_t> ends;
  for (const Found& f : together) ends.push_back(f.change.end.value_or(rows));
  const std::size_t end = upper_median(std::move(ends));
  return end < rows ? std::optional(end) : std::nullopt;
}

/// What cameras lost of their named curves, or won, with a lamp.
std::string named_with(const std::vector<Found>& together, const SequenceDevices& devices) {
  const Found* most = nullptr;
  std::size_t count = 0;
  const auto size = [](const Found& f) { return std::abs(f.named->after - f.named->before); };
  for (const Found& f : together) {
    if (!f.named) continue;
    ++count;
    if (most == nullptr || size(f) > size(*most)) most = &f;
  }
  if (most == nullptr) return "";
  return "; with it the share of curves that has a line, in " + std::to_string(count) +
         " of them, most in " + bare_name(devices, most->series->device) + ": " +
         from_to("labelled", *most->named);
}

/// The same change in most cameras, or most projectors, at once is one event, of none of them.
SequenceEvent event_of_all(std::span<const FrameRow> rows, const SequenceDevices& devices,
                           const std::vector<Found>& together) {
  Found middle = together[together.size() / 2];
  const std::string& kind = middle.series->kind;
  const std::size_t first = together.front().change.at;
  const bool up = rises(middle);
  const bool lines_too = kind == "level" && up && lines_got_light(rows, devices, first);
  middle.change.at = first;
  middle.change.end = end_of_most(together, rows.size());
  SequenceEvent event = event_from(rows, middle, "");
  event.text = std::to_string(together.size()) +
               (kind == "light" ? " projectors: " : " cameras: ") + quantity(kind) +
               from_to(kind, middle.change) + " (" + usual_cause(kind, up, true, lines_too) + ")" +
               named_with(together, devices);
  return event;
}

bool is_shift(const Found& found) { return found.series->kind == kShift; }

bool of_crossings(const Found& found) {
  return is_shift(found) || found.series->kind == "crossings";
}

/// Crossings meet again as they should.
bool agrees_again(const Found& found) {
  return is_shift(found) ? std::abs(found.change.after) < kShiftPx : !rises(found);
}

double size_of(const Found& found) { return std::abs(found.change.after - found.change.before); }

/// Whether a camera's crossings meet with its picture where it was, so that it did not turn away.
/// Where noise hides how much they miss, the change is noticed some frames late: medians of many
/// frames on both sides, so that these are outvoted.
bool is_steady(std::span<const FrameRow> rows, const Found& found) {
  const std::size_t camera = found.series->device;
  if (camera >= rows[0].cameras.size()) return false;
  const auto at = rows.begin() + static_cast<std::ptrdiff_t>(found.change.at);
  const auto end =
      rows.begin() + static_cast<std::ptrdiff_t>(found.change.end.value_or(rows.size()));
  const auto change = [&](double CameraRow::*shift) {
    const Reading reading = [&](const FrameRow& row) { return row.cameras[camera].*shift; };
    double before =
        median_of_done(std::make_reverse_iterator(at), rows.rend(), kReference, reading);
    if (!std::isfinite(before)) before = median_of_done(end, rows.end(), kReference, reading);
    return median_of_done(at, end, kReference, reading) - before;
  };
  return std::hypot(change(&CameraRow::shift_x_px), change(&CameraRow::shift_y_px)) < kShiftPx;
}

/// Which device made crossings miss each other, or meet again. One camera alone, be it that its
/// crossings miss or that its picture is shifted: that one, since a crossing's disagreement is that
/// of one camera with two projectors. Several: the projector whose crossings suffer most, if there
/// is one; of two projectors every crossing is of both.
SequenceEvent bump(std::span<const FrameRow> rows, const SequenceDevices& devices,
                   std::vector<Found> together) {
  constexpr double kClearly = 1.3;  // a projector over the next one
  std::stable_sort(together.begin(), together.end(),
                   [](const Found& a, const Found& b) { return size_of(a) > size_of(b); });
  std::set<std::size_t> cameras;
  std::vector<const Found*> projectors;
  const Found* of_camera = nullptr;
  std::size_t first = together.front().change.at;
  for (const Found& f : together) {
    first = std::min(first, f.change.at);
    if (f.series->device >= devices.cameras.size()) {
      projectors.push_back(&f);
      continue;
    }
    cameras.insert(f.series->device);
    // What crossings miss is told where it is known.
    if (of_camera == nullptr || (is_shift(*of_camera) && !is_shift(f))) of_camera = &f;
  }
  const bool one_camera = cameras.size() == 1 && devices.cameras.size() > 1;
  const bool one_projector =
      !one_camera && cameras.size() != 1 && !projectors.empty() &&
      (projectors.size() == 1 ? devices.projectors.size() > 1
                              : size_of(*projectors[0]) > kClearly * size_of(*projectors[1]));
  const Found& most = one_camera      ? *of_camera
                      : one_projector ? *projectors.front()
                                      : together.front();
  Found whole = most;
  whole.change.at = first;
  whole.change.end = end_of_most(together, rows.size());
  SequenceEvent event = event_from(rows, whole, "");
  event.kind = "crossings";
  const bool is_back = std::all_of(together.begin(), together.end(), agrees_again);
  if (one_camera || one_projector) {
    event.device = bare_name(devices, most.series->device);
    event.text = name_of(devices, most.series->device) + ' ';
    if (std::none_of(together.begin(), together.end(), is_shift) && is_steady(rows, most)) {
      event.text += "stands where it stood, its crossing lines miss each other by " +
                    from_to(most.series->kind, most.change) +
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
  event.text += from_to(most.series->kind, most.change) + " (px)";
  if (!is_back)
    event.text += "; rig check --frames says more, --refine-rig corrects the frames from here";
  return event;
}

/// Whether what tells of a change at row `at` bears it out: from the frames before to so many from
/// there on.
bool is_confirmed(std::span<const FrameRow> rows, const Series& series, std::size_t at,
                  std::size_t frames_after) {
  if (!series.beside && !series.beyond) return true;
  const auto [own_before, own_after] = before_and_after(rows, at, frames_after, series.value);
  if (series.beyond) {
    const auto [before, after] = before_and_after(rows, at, frames_after, series.beyond);
    const double beyond = own_after > own_before ? after : before;
    return !std::isfinite(beyond) || beyond > series.smallest;
  }
  const auto [before, after] = before_and_after(
      rows, at, frames_after, [&](const FrameRow& row) { return finite_log(series.beside(row)); });
  if (!std::isfinite(before) || !std::isfinite(after)) return true;
  return (after > before) == (own_after > own_before) && std::abs(after - before) > series.smallest;
}

/// Changes of logarithms, or of numbers to which one was added, as those of the figure itself.
Change of_figure(const Series& series, Change change) {
  if (series.is_ratio) {
    change.before = std::exp(change.before);
    change.after = std::exp(change.after);
  }
  if (series.kind == "projector") {
    change.before -= 1;
    change.after -= 1;
  }
  return change;
}

/// The figure of one frame, as from_to() has it.
std::string odd_figure(std::span<const FrameRow> rows, const Series& series, std::size_t at) {
  const auto [before, after] = before_and_after(rows, at, 1, series.value);
  if (is_of_light(series.kind)) return in_words(after / before) + " of that before";
  return in_words(
      of_figure(series, {at, {}, 0, series.is_ratio ? std::log(after) : after, 0}).after);
}

std::vector<Found> find_all(std::span<const FrameRow> rows, const SequenceDevices& devices,
                            const std::vector<Series>& all, WatchReport& report) {
  std::vector<Found> found;
  for (const Series& series : all) {
    std::vector<double> values;
    for (const FrameRow& row : rows) {
      const double value =
          row.status.state == FrameState::kDone ? series.value(row) : kUnknownFigure;
      values.push_back(series.is_ratio ? finite_log(value) : value);
    }
    ChangeOptions options{series.smallest, all.size() * rows.size()};
    options.follows = series.follows;
    const ChangeReport changes = find_changes(values, options);
    for (const Change& change : changes.changes) {
      if (!is_confirmed(rows, series, change.at, kFramesOfChange)) continue;
      found.push_back({&series, of_figure(series, change)});
    }
    const auto say_odd = [&](std::size_t at, const char* where) {
      if (!is_confirmed(rows, series, at, 1)) return;
      report.odd.push_back({at, name_of(devices, series.device) + ": " + quantity(series.kind) +
                                    odd_figure(rows, series, at) + where});
    };
    for (const std::size_t at : changes.outliers) say_odd(at, " in this frame alone");
    for (const std::size_t at : changes.at_end) say_odd(at, " at the end");
  }
  return found;
}

constexpr std::size_t kFramesApart = 5;  ///< of changes that have one cause

/// Takes out what another change explains:
///   1. the light of a picture, or its named share, that goes with a projector, off or on again,
///   2. the light on lines of a camera that falls where they get wider: it is spread,
///   3. a shift with which a camera's crossings meet while they miss by far more than they did:
///      then its names are those of other lines.
void drop_explained(std::vector<Found>& found) {
  const std::vector<Found> all = found;
  const auto goes_with_projector = [&](const Found& f, const Found& projector) {
    const auto is_at = [&](std::size_t at) {
      return std::max(at, f.change.at) - std::min(at, f.change.at) <= kFramesApart;
    };
    if (is_at(projector.change.at) && rises(f) == rises(projector)) return true;
    return projector.change.end && is_at(*projector.change.end) && rises(f) != rises(projector);
  };
  const auto explains = [&](const Found& f, const Found& cause) {
    if (f.series->kind == "level" || f.series->kind == "labelled")
      return cause.series->kind == "projector" && goes_with_projector(f, cause);
    if (f.series->kind == "height" && !rises(f))
      return cause.series->kind == "width" && rises(cause) &&
             cause.series->device == f.series->device &&
             cause.change.at <= f.change.at + kFramesApart &&
             (!cause.change.end || f.change.at < *cause.change.end);
    const bool is_within = cause.change.at + kFramesApart < f.change.at &&
                           (!cause.change.end || f.change.at < *cause.change.end);
    return is_shift(f) && cause.series->kind == "crossings" && rises(cause) && is_within &&
           cause.series->device == f.series->device;
  };
  std::erase_if(found, [&](const Found& f) {
    return std::any_of(all.begin(), all.end(),
                       [&](const Found& cause) { return explains(f, cause); });
  });
}

/// Takes out the named shares of cameras that change with a lamp, and tells its light of them:
/// lines drown in light, and come out of it again. What begins without it, or stays lost after it,
/// has another cause.
void join_with_lamps(std::vector<Found>& found) {
  const auto apart = [](std::size_t a, std::size_t b) { return std::max(a, b) - std::min(a, b); };
  const auto goes_with = [&](const Found& f, const Found& lamp) {
    const bool outlasts =
        lamp.change.end && (!f.change.end || *f.change.end > *lamp.change.end + kFramesApart);
    return lamp.series->kind == "level" && f.series->device == lamp.series->device &&
           rises(f) != rises(lamp) && apart(f.change.at, lamp.change.at) <= kFramesApart &&
           !outlasts;
  };
  std::vector<Found> rest;
  for (const Found& f : found)
    if (f.series->kind != "labelled") rest.push_back(f);
  for (const Found& f : found) {
    if (f.series->kind != "labelled") continue;
    const auto lamp = std::find_if(rest.begin(), rest.end(),
                                   [&](const Found& other) { return goes_with(f, other); });
    if (lamp == rest.end()) {
      rest.push_back(f);
    } else {
      lamp->named = f.change;
    }
  }
  std::stable_sort(rest.begin(), rest.end(), in_order);
  found = std::move(rest);
}

/// Takes out crossings of a device that frames themselves name, from the same or an earlier one on
/// to no earlier one than the last that these tell of.
void drop_said(std::vector<SequenceEvent>& events) {
  const std::vector<SequenceEvent> all = events;
  const auto says = [](const SequenceEvent& said, const SequenceEvent& event) {
    return (said.kind == "device-is-off" || said.kind == "wrong-picture") &&
           said.device == event.device && said.first <= event.first && said.last >= event.last;
  };
  std::erase_if(events, [&](const SequenceEvent& event) {
    return event.kind == "crossings" &&
           std::any_of(all.begin(), all.end(),
                       [&](const SequenceEvent& said) { return says(said, event); });
  });
}

/// Takes out of `found` what changed in the same figure and direction within a few frames of the
/// first one, and before one of these figures changes again.
std::vector<Found> take_together(std::vector<Found>& found) {
  const Found first = found.front();
  const auto goes_with = [&](const Found& f) {
    const bool is_kind = f.series->kind == first.series->kind && rises(f) == rises(first);
    return is_kind || (of_crossings(f) && of_crossings(first) && (is_shift(f) || is_shift(first)));
  };
  std::size_t end = first.change.at + kFramesApart + 1;
  std::set<const Series*> changed;
  for (const Found& f : found) {
    if (goes_with(f) && !changed.insert(f.series).second) end = std::min(end, f.change.at);
  }
  std::vector<Found> together;
  std::vector<Found> rest;
  for (const Found& f : found) {
    const bool same = goes_with(f) && f.change.at < end;
    (same ? together : rest).push_back(f);
  }
  found = std::move(rest);
  return together;
}

/// Cameras that hung.
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

}  // namespace

std::string when_text(const SequenceEvent& event, std::span<const FrameRow> rows) {
  const std::string& first = rows[event.first].name;
  if (event.first == event.last) return "in frame " + first;
  return event.lasts ? "from frame " + first
                     : "in frames " + first + " to " + rows[event.last].name;
}

WatchReport watch_sequence(std::span<const FrameRow> rows, const SequenceDevices& devices) {
  WatchReport report;
  const std::vector<Series> all = all_series(devices);
  std::vector<Found> found = find_all(rows, devices, all, report);
  std::stable_sort(found.begin(), found.end(), in_order);
  drop_explained(found);
  join_with_lamps(found);
  while (!found.empty()) {
    const std::vector<Found> together = take_together(found);
    const Found& first = together.front();
    const bool moved = of_crossings(first) &&
                       (rises(first) || std::any_of(together.begin(), together.end(), is_shift));
    if (moved) {
      report.events.push_back(bump(rows, devices, together));
    } else if (first.series->kind != "projector" && together.size() > 1 &&
               2 * together.size() > (first.series->kind == "light" ? devices.projectors.size()
                                                                    : devices.cameras.size())) {
      report.events.push_back(event_of_all(rows, devices, together));
    } else {
      for (const Found& f : together) report.events.push_back(event_of(rows, devices, f));
    }
  }
  std::ranges::move(finding_events(rows), std::back_inserter(report.events));
  drop_said(report.events);
  std::ranges::move(repetitions_of(rows, devices), std::back_inserter(report.events));
  std::stable_sort(
      report.events.begin(), report.events.end(),
      [](const SequenceEvent& a, const SequenceEvent& b) { return a.first < b.first; });
  return report;
}

}  // namespace pencilscan
