#include "pencilscan/pipeline/rig_periods.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "pencilscan/core/formatted.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/line_naming.h"
#include "pencilscan/pipeline/naming_doubt.h"

namespace pencilscan {
namespace {

using nlohmann::ordered_json;

/// The verdict where a device moved between frames.
constexpr const char* kMovedMeanwhile = "moved meanwhile";

/// Finds where one period ends and the next one begins.
class PeriodFinder {
 public:
  PeriodFinder(const Rig& stated, std::span<const FrameCurves> frames,
               const MovedDevicesOptions& options, const Progress& progress)
      : stated_(stated),
        rig_(in_footprints(stated)),
        frames_(frames),
        options_(options),
        progress_(progress) {
    for (std::size_t f = 0; f < frames.size(); ++f) {
      say("names of lines", f);
      labels_.push_back(std::move(labels_of(rig_, frames.subspan(f, 1)).front()));
    }
  }

  [[nodiscard]] std::vector<RigPeriod> periods() {
    find(0, frames_.size());
    std::vector<RigPeriod> result;
    for (Period& period : found_) result.push_back(std::move(period.said));
    return result;
  }

 private:
  struct Period {
    RigPeriod said;
    Explanation explained;
  };

  void say(const char* what, std::size_t frame) const {
    if (progress_)
      progress_(what, static_cast<double>(frame) / static_cast<double>(frames_.size()));
  }
  [[nodiscard]] std::span<const Labeling> labels(std::size_t first, std::size_t end) const {
    return std::span(labels_).subspan(first, end - first);
  }
  [[nodiscard]] Explanation first_explanation(std::size_t first, std::size_t end) const {
    const auto named = labels(first, end);
    return explanation_of(rig_, frames_.subspan(first, end - first), {named.begin(), named.end()},
                          options_);
  }
  [[nodiscard]] std::vector<NamingDoubt> doubts(std::size_t first,
                                                std::span<const Labeling> labels) const {
    std::vector<NamingDoubt> of_frame;
    for (std::size_t f = 0; f < labels.size(); ++f)
      of_frame.push_back(naming_doubt(rig_, frames_.subspan(first + f, 1), labels.subspan(f, 1)));
    return of_frame;
  }
  /// The move that the crossings of these labels tell of. What few names a device has that stands
  /// far off are those of other lines.
  [[nodiscard]] std::optional<MoveBetweenFrames> move_between(
      const Rig& rig, std::size_t first, std::span<const Labeling> labels) const {
    std::vector<std::vector<CrossingTrack>> tracks;
    for (std::size_t f = 0; f < labels.size(); ++f)
      tracks.push_back(crossing_tracks(rig, frames_.subspan(first + f, 1), labels.subspan(f, 1)));
    const std::vector<NamingDoubt> of_frame = doubts(first, labels);
    std::vector<std::size_t> named;
    for (std::size_t d = 0; d < device_count(rig_); ++d) {
      if (std::none_of(of_frame.begin(), of_frame.end(),
                       [d](const NamingDoubt& doubt) { return doubt.lacks_names(d); }))
        named.push_back(d);
    }
    return find_move_between(rig, tracks, named, options_);
  }
  /// The first frame in which a device has lost its names, or has them again.
  [[nodiscard]] std::optional<std::size_t> names_change(std::size_t first, std::size_t end) const {
    const std::vector<NamingDoubt> of_frame = doubts(first, labels(first, end));
    for (std::size_t f = 1; f < of_frame.size(); ++f) {
      for (std::size_t d = 0; d < device_count(rig_); ++d) {
        const NamingDoubt& a = of_frame[f - 1];
        const NamingDoubt& b = of_frame[f];
        const auto [less, more] =
            std::minmax({a.telling(d).named_share(), b.telling(d).named_share()});
        if (a.lacks_names(d) != b.lacks_names(d) && less < more / 2) return first + f;
      }
    }
    return std::nullopt;
  }
  /// Adds the periods of these frames.
  void find(std::size_t first, std::size_t end) {
    if (const auto at = names_change(first, end)) return find_both(first, *at, end);
    Explanation explanation = first_explanation(first, end);
    const auto move = move_between(explanation.put_back, first, labels(first, end));
    if (move) return find_both(first, first + move->frame, end);
    say("what moved", first);
    found_.push_back(explained(first, end, std::move(explanation)));
    join_last();
  }
  void find_both(std::size_t first, std::size_t at, std::size_t end) {
    find(first, at);
    find(at, end);
  }
  [[nodiscard]] Period explained(std::size_t first, std::size_t end, Explanation begin) const {
    Explanation explanation =
        explain(rig_, frames_.subspan(first, end - first), std::move(begin), options_);
    RigFit fit = fit_of(stated_, rig_, explanation);
    return {{first, end - 1, std::move(fit), std::nullopt}, std::move(explanation)};
  }
  /// First names may be wrong in one frame and right in the next: where with the last ones nothing
  /// moved, two periods are one.
  void join_last() {
    if (found_.size() < 2) return;
    Period& a = found_[found_.size() - 2];
    Period& b = found_.back();
    const std::size_t first = a.said.first;
    const std::size_t end = b.said.last + 1;
    std::vector<Labeling> named = a.explained.labelings;
    named.insert(named.end(), b.explained.labelings.begin(), b.explained.labelings.end());
    auto move = move_between(a.explained.put_back, first, named);
    if (move) {
      move->frame += first;
      // Names changed in one frame, and in another one the device moved.
      if (move->frame != b.said.first) {
        const auto before = a.said.moved_before;
        a = explained(first, move->frame, first_explanation(first, move->frame));
        a.said.moved_before = before;
        b = explained(move->frame, end, first_explanation(move->frame, end));
      }
      b.said.moved_before = move;
      return;
    }
    if (a.said.fit.verdict != b.said.fit.verdict) return;
    Period joined = explained(first, end, first_explanation(first, end));
    joined.said.moved_before = a.said.moved_before;
    if (joined.said.fit.verdict != a.said.fit.verdict) return;
    found_.pop_back();
    found_.back() = std::move(joined);
  }

  const Rig& stated_;
  const Rig rig_;
  const std::span<const FrameCurves> frames_;
  const MovedDevicesOptions& options_;
  const Progress& progress_;
  std::vector<Labeling> labels_;  ///< the first ones
  std::vector<Period> found_;
};

/// True where both are known, and differ in the devices that are to be put back.
bool stands_elsewhere(const RigFit& a, const RigFit& b) {
  if (std::max(a.verdict, b.verdict) > RigVerdict::kSeveralMoved) return false;
  return !std::equal(
      a.devices.begin(), a.devices.end(), b.devices.begin(), b.devices.end(),
      [](const DeviceFit& x, const DeviceFit& y) { return x.has_moved == y.has_moved; });
}

}  // namespace

std::string frames_of(const RigPeriod& period, std::span<const std::string> names) {
  return period.first == period.last
             ? "frame " + names[period.first]
             : "frames " + names[period.first] + " to " + names[period.last];
}

std::vector<RigPeriod> check_rig_over_frames(const Rig& rig, std::span<const FrameCurves> frames,
                                             const MovedDevicesOptions& options,
                                             const Progress& progress) {
  return PeriodFinder(rig, frames, options, progress).periods();
}

std::string verdict_of(std::span<const RigPeriod> periods) {
  RigVerdict worst = RigVerdict::kFits;
  for (std::size_t i = 0; i < periods.size(); ++i) {
    if (periods[i].moved_before || (i > 0 && stands_elsewhere(periods[i - 1].fit, periods[i].fit)))
      return kMovedMeanwhile;
    worst = std::max(worst, periods[i].fit.verdict);
  }
  return to_string(worst);
}

std::string describe_periods(std::span<const RigPeriod> periods,
                             std::span<const std::string> names) {
  if (periods.size() == 1) return periods.front().fit.text;
  std::string text;
  for (const RigPeriod& period : periods) {
    if (!text.empty()) text += "; ";
    if (period.moved_before) {
      text += full_name(period.fit.devices[period.moved_before->device]) + " moved" +
              formatted(period.moved_before->shift_px, " by %.2f px") + " between frames " +
              names[period.first - 1] + " and " + names[period.first] + "; ";
    }
    text += "in " + frames_of(period, names) + ", " + period.fit.text;
  }
  return text;
}

ordered_json periods_json(std::span<const RigPeriod> periods, std::span<const std::string> names) {
  ordered_json report = rig_fit_json(periods.back().fit);
  if (periods.size() == 1) return report;
  report["verdict"] = verdict_of(periods);
  report["text"] = describe_periods(periods, names);
  report["periods"] = ordered_json::array();
  for (const RigPeriod& period : periods) {
    ordered_json entry = {{"first_frame", names[period.first]},
                          {"last_frame", names[period.last]},
                          {"verdict", to_string(period.fit.verdict)},
                          {"text", period.fit.text}};
    if (period.moved_before) {
      entry["moved_before"] = period.fit.devices[period.moved_before->device].name;
      entry["moved_before_px"] = thousandth(period.moved_before->shift_px);
    }
    report["periods"].push_back(std::move(entry));
  }
  return report;
}

}  // namespace pencilscan
