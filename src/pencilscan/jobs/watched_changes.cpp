#include "pencilscan/jobs/watched_changes.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <tuple>
#include <utility>

#include "pencilscan/core/median.h"
#include "pencilscan/jobs/change_words.h"
#include "pencilscan/refinement/device_mover.h"

namespace pencilscan {
namespace {

/// The smallest changes that count, each with what it does to the result.
const double kLabelled = 0.05;          // a twentieth of the points lost or won
const double kWidth = std::log(1.15);   // deviations of points grow with width^1.5: by a fifth
const double kHeight = std::log(1.25);  // they grow with noise over height: by a quarter
const double kLevel = std::log(1.25);   // as much more light without lines
const double kLight = kHeight;          // of the lines of a projector: the same
const double kPoints = std::log(4.0);   // a projector that lost three quarters of its points
/// Half of what the rule of disagreeing crossings (crossing_tracks.h) allows beyond noise.
constexpr double kCrossingsPx = 0.05;
double finite_log(double value) { return value > 0 ? std::log(value) : kUnknownFigure; }

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

/// Whether what tells of a change at row `at` bears it out: from the frames before to so many from
/// there on.
bool is_confirmed(std::span<const FrameRow> rows, const WatchedFigure& figure, std::size_t at,
                  std::size_t frames_after) {
  if (!figure.beside && !figure.beyond) return true;
  const auto [own_before, own_after] = before_and_after(rows, at, frames_after, figure.value);
  if (figure.beyond) {
    const auto [before, after] = before_and_after(rows, at, frames_after, figure.beyond);
    const double beyond = own_after > own_before ? after : before;
    return !std::isfinite(beyond) || beyond > figure.smallest;
  }
  const auto [before, after] = before_and_after(
      rows, at, frames_after, [&](const FrameRow& row) { return finite_log(figure.beside(row)); });
  if (!std::isfinite(before) || !std::isfinite(after)) return true;
  return (after > before) == (own_after > own_before) && std::abs(after - before) > figure.smallest;
}

/// Changes of logarithms, or of numbers to which one was added, as those of the figure itself.
Change of_figure(const WatchedFigure& figure, Change change) {
  if (figure.is_ratio) {
    change.before = std::exp(change.before);
    change.after = std::exp(change.after);
  }
  if (figure.kind == "projector") {
    change.before -= 1;
    change.after -= 1;
  }
  return change;
}

/// The figure of one frame, as from_to() has it.
std::string odd_figure(std::span<const FrameRow> rows, const WatchedFigure& figure,
                       std::size_t at) {
  const auto [before, after] = before_and_after(rows, at, 1, figure.value);
  if (is_of_light(figure.kind)) return in_words(after / before) + " of that before";
  return in_words(
      of_figure(figure, {at, {}, 0, figure.is_ratio ? std::log(after) : after, 0}).after);
}

}  // namespace

bool in_order(const FoundChange& a, const FoundChange& b) {
  return std::tie(a.change.at, a.figure->kind) < std::tie(b.change.at, b.figure->kind);
}

bool rises(const FoundChange& found) { return found.change.after > found.change.before; }

bool is_shift(const FoundChange& found) { return found.figure->kind == kShift; }

const std::string& bare_name(const SequenceDevices& devices, std::size_t device) {
  return device < devices.cameras.size() ? devices.cameras[device]
                                         : devices.projectors[device - devices.cameras.size()];
}

std::string name_of(const SequenceDevices& devices, std::size_t device) {
  return (device < devices.cameras.size() ? "camera " : "projector ") + bare_name(devices, device);
}

std::vector<WatchedFigure> watched_figures(const SequenceDevices& devices) {
  std::vector<WatchedFigure> all;
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
    of_camera(kShift, false, kSmallestMovePx, &CameraRow::shift_x_px);
    of_camera(kShift, false, kSmallestMovePx, &CameraRow::shift_y_px);
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

std::pair<double, double> long_before_and_within(std::span<const FrameRow> rows,
                                                 const Change& change, const Reading& reading) {
  const auto at = rows.begin() + static_cast<std::ptrdiff_t>(change.at);
  const auto end = rows.begin() + static_cast<std::ptrdiff_t>(change.end.value_or(rows.size()));
  double before = median_of_done(std::make_reverse_iterator(at), rows.rend(), kReference, reading);
  if (!std::isfinite(before)) before = median_of_done(end, rows.end(), kReference, reading);
  return {before, median_of_done(at, end, kReference, reading)};
}

bool light_is_spread(std::span<const FrameRow> rows, std::size_t at, double share) {
  constexpr double kBrightAsBefore = 0.25;  // of what the lines lose, in logarithms
  if (!(share > 0 && share < 1)) return false;
  std::vector<double> changes;
  for (std::size_t c = 0; c < rows[0].cameras.size(); ++c) {
    const auto [before, after] = before_and_after(
        rows, at, kFramesOfChange,
        [c](const FrameRow& row) { return finite_log(row.cameras[c].image_level); });
    if (std::isfinite(after - before)) changes.push_back(after - before);
  }
  return !changes.empty() &&
         lower_quantile(std::move(changes), 0.5) > kBrightAsBefore * std::log(share);
}

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

std::vector<FoundChange> find_watched_changes(std::span<const FrameRow> rows,
                                              const SequenceDevices& devices,
                                              const std::vector<WatchedFigure>& all,
                                              std::vector<OddFrame>& odd) {
  std::vector<FoundChange> found;
  for (const WatchedFigure& figure : all) {
    std::vector<double> values;
    for (const FrameRow& row : rows) {
      const double value =
          row.status.state == FrameState::kDone ? figure.value(row) : kUnknownFigure;
      values.push_back(figure.is_ratio ? finite_log(value) : value);
    }
    ChangeOptions options{figure.smallest, all.size() * rows.size()};
    options.follows = figure.follows;
    const ChangeReport changes = find_changes(values, options);
    for (const Change& change : changes.changes) {
      if (!is_confirmed(rows, figure, change.at, kFramesOfChange)) continue;
      found.push_back({&figure, of_figure(figure, change)});
    }
    const auto say_odd = [&](std::size_t at, const char* where) {
      if (!is_confirmed(rows, figure, at, 1)) return;
      odd.push_back({at, name_of(devices, figure.device) + ": " + quantity(figure.kind) +
                             odd_figure(rows, figure, at) + where});
    };
    for (const std::size_t at : changes.outliers) say_odd(at, " in this frame alone");
    for (const std::size_t at : changes.at_end) say_odd(at, " at the end");
  }
  std::stable_sort(found.begin(), found.end(), in_order);
  return found;
}

}  // namespace pencilscan
