#include "pencilscan/jobs/watch.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>

#include "pencilscan/jobs/change_events.h"
#include "pencilscan/jobs/change_words.h"
#include "pencilscan/jobs/finding_events.h"
#include "pencilscan/jobs/watched_changes.h"

namespace pencilscan {
namespace {

bool of_crossings(const FoundChange& found) {
  return is_shift(found) || found.figure->kind == "crossings";
}

constexpr std::size_t kFramesApart = 5;  ///< of changes that have one cause

/// Takes out what another change explains:
///   1. the light of a picture, or its named share, that goes with a projector, off or on again,
///   2. the light on lines of a camera that falls where they get wider: it is spread,
///   3. a shift with which a camera's crossings meet while they miss by far more than they did:
///      then its names are those of other lines.
void drop_explained(std::vector<FoundChange>& found) {
  const std::vector<FoundChange> all = found;
  const auto goes_with_projector = [&](const FoundChange& f, const FoundChange& projector) {
    const auto is_at = [&](std::size_t at) {
      return std::max(at, f.change.at) - std::min(at, f.change.at) <= kFramesApart;
    };
    if (is_at(projector.change.at) && rises(f) == rises(projector)) return true;
    return projector.change.end && is_at(*projector.change.end) && rises(f) != rises(projector);
  };
  const auto explains = [&](const FoundChange& f, const FoundChange& cause) {
    if (f.figure->kind == "level" || f.figure->kind == "labelled")
      return cause.figure->kind == "projector" && goes_with_projector(f, cause);
    if (f.figure->kind == "height" && !rises(f))
      return cause.figure->kind == "width" && rises(cause) &&
             cause.figure->device == f.figure->device &&
             cause.change.at <= f.change.at + kFramesApart &&
             (!cause.change.end || f.change.at < *cause.change.end);
    const bool is_within = cause.change.at + kFramesApart < f.change.at &&
                           (!cause.change.end || f.change.at < *cause.change.end);
    return is_shift(f) && cause.figure->kind == "crossings" && rises(cause) && is_within &&
           cause.figure->device == f.figure->device;
  };
  std::erase_if(found, [&](const FoundChange& f) {
    return std::any_of(all.begin(), all.end(),
                       [&](const FoundChange& cause) { return explains(f, cause); });
  });
}

/// Takes out the named shares of cameras that change with a lamp, and tells its light of them:
/// lines drown in light, and come out of it again. What begins without it, or stays lost after it,
/// has another cause.
void join_with_lamps(std::vector<FoundChange>& found) {
  const auto apart = [](std::size_t a, std::size_t b) { return std::max(a, b) - std::min(a, b); };
  const auto goes_with = [&](const FoundChange& f, const FoundChange& lamp) {
    const bool outlasts =
        lamp.change.end && (!f.change.end || *f.change.end > *lamp.change.end + kFramesApart);
    return lamp.figure->kind == "level" && f.figure->device == lamp.figure->device &&
           rises(f) != rises(lamp) && apart(f.change.at, lamp.change.at) <= kFramesApart &&
           !outlasts;
  };
  std::vector<FoundChange> rest;
  for (const FoundChange& f : found)
    if (f.figure->kind != "labelled") rest.push_back(f);
  for (const FoundChange& f : found) {
    if (f.figure->kind != "labelled") continue;
    const auto lamp = std::find_if(rest.begin(), rest.end(),
                                   [&](const FoundChange& other) { return goes_with(f, other); });
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
std::vector<FoundChange> take_together(std::vector<FoundChange>& found) {
  const FoundChange first = found.front();
  const auto goes_with = [&](const FoundChange& f) {
    const bool is_kind = f.figure->kind == first.figure->kind && rises(f) == rises(first);
    return is_kind || (of_crossings(f) && of_crossings(first) && (is_shift(f) || is_shift(first)));
  };
  std::size_t end = first.change.at + kFramesApart + 1;
  std::set<const WatchedFigure*> changed;
  for (const FoundChange& f : found) {
    if (goes_with(f) && !changed.insert(f.figure).second) end = std::min(end, f.change.at);
  }
  std::vector<FoundChange> together;
  std::vector<FoundChange> rest;
  for (const FoundChange& f : found) {
    const bool same = goes_with(f) && f.change.at < end;
    (same ? together : rest).push_back(f);
  }
  found = std::move(rest);
  return together;
}

std::vector<std::string> without_crossings(std::span<const FrameRow> rows,
                                           const SequenceDevices& devices) {
  std::vector<std::string> names;
  for (std::size_t d = 0; d < devices.cameras.size() + devices.projectors.size(); ++d) {
    std::size_t done = 0;
    std::size_t known = 0;
    for (const FrameRow& row : rows) {
      if (row.status.state != FrameState::kDone) continue;
      ++done;
      if (std::isfinite(row.device_crossing_px[d])) ++known;
    }
    if (done > 1 && 2 * known < done) names.push_back(bare_name(devices, d));
  }
  return names;
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
  report.not_watched = without_crossings(rows, devices);
  const std::vector<WatchedFigure> all = watched_figures(devices);
  std::vector<FoundChange> found = find_watched_changes(rows, devices, all, report.odd);
  drop_explained(found);
  join_with_lamps(found);
  while (!found.empty()) {
    const std::vector<FoundChange> together = take_together(found);
    const FoundChange& first = together.front();
    const bool moved = of_crossings(first) &&
                       (rises(first) || std::any_of(together.begin(), together.end(), is_shift));
    if (moved) {
      report.events.push_back(event_of_crossings(rows, devices, together));
    } else if (first.figure->kind != "projector" && together.size() > 1 &&
               2 * together.size() > (first.figure->kind == "light" ? devices.projectors.size()
                                                                    : devices.cameras.size())) {
      report.events.push_back(event_of_all(rows, devices, together));
    } else {
      for (const FoundChange& f : together) report.events.push_back(event_of(rows, devices, f));
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
