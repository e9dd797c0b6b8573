#include "pencilscan/jobs/changes.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>
#include <optional>
#include <utility>

#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

constexpr std::size_t kFewest = 8;  // values that a median and its spread can be trusted of
// Noise may bring one value of a small change back a little; with two, slow motion as above gave
// two changes in 200 sequences.
constexpr std::size_t kWithin = 4;

double median_of(std::span<const double> values) {
  return upper_median(std::vector<double>(values.begin(), values.end()));
}

/// 1.4826 times the median distance from `median`.
double spread_of(std::span<const double> values, double median) {
  std::vector<double> distances;
  for (const double value : values) distances.push_back(std::abs(value - median));
  return kDeviationPerMedian * upper_median(std::move(distances));
}

/// The running median and its spread.
class Reference {
 public:
  Reference(double least_spread, double threshold, bool follows)
      : least_spread_(least_spread), threshold_(threshold), follows_(follows) {}

  [[nodiscard]] bool is_known() const { return values_.size() >= kFewest; }
  [[nodiscard]] double median() const { return median_; }
  [[nodiscard]] double spread() const { return spread_; }
  [[nodiscard]] double spreads(double value) const { return (value - median_) / spread_; }
  /// -1: below, 1: above, 0: as before.
  [[nodiscard]] int side(double value) const { return side(value, spread_); }
  [[nodiscard]] int side(double value, double spread) const {
    if (std::abs(value - median_) <= threshold_ * spread) return 0;
    return value > median_ ? 1 : -1;
  }
  void add(double value) {
    if (!follows_ && values_.size() >= kReference) return;
    values_.push_back(value);
    if (values_.size() > kReference) values_.pop_front();
    know(std::vector<double>(values_.begin(), values_.end()));
  }
  /// The same values, all shifted to this median.
  [[nodiscard]] Reference moved_to(double median) const {
    Reference result = *this;
    for (double& value : result.values_) value += median - median_;
    result.median_ = median;
    return result;
  }
  /// Of these values alone.
  [[nodiscard]] Reference around(std::span<const double> values) const {
    Reference result(least_spread_, threshold_, follows_);
    result.know(values);
    return result;
  }

 private:
  void know(std::span<const double> values) {
    median_ = median_of(values);
    spread_ = std::max(least_spread_, spread_of(values, median_));
  }

  double least_spread_;
  double threshold_;
  bool follows_;
  std::deque<double> values_;
  double median_ = 0;
  double spread_ = 0;
};

/// Standard deviation from value to value, over all of them: what a few quiet ones cannot hide.
double frame_noise(std::span<const double> values) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < values.size(); ++k)
    steps.push_back(std::abs(values[k] - values[k - 1]));
  return kDeviationPerMedian * upper_median(std::move(steps)) / std::numbers::sqrt2;
}

/// The running median now, and that of before the last change.
class Levels {
 public:
  explicit Levels(const Reference& empty) : empty_(empty), now_(empty) {}

  [[nodiscard]] const Reference& now() const { return now_; }
  /// 0 where the value is as before, or nothing to compare it with is known. Soon after a change,
  /// only what fits the values before it and not those from there is out: it returns.
  [[nodiscard]] int side(double value) const { return side(value, 1); }
  /// As side(), of half the distance.
  [[nodiscard]] int leaning(double value) const { return side(value, 0.5); }
  /// True where a value that is out is as those before the last change.
  [[nodiscard]] bool returns(double value) const {
    return before_ && before_->side(value) == 0 &&
           std::abs(value - before_->median()) < std::abs(value - now_.median());
  }
  void add(double value) { now_.add(value); }
  /// The values `next` are no longer as before.
  void change(std::span<const double> next) {
    const bool is_return = returns(median_of(next));
    // While it lasted, slow motion of the object went on.
    Reference left = std::exchange(now_, is_return ? before_->moved_to(median_of(next)) : empty_);
    before_.reset();
    if (!is_return && left.is_known()) before_ = std::move(left);
    for (const double value : next) add(value);
  }

 private:
  [[nodiscard]] int side(double value, double share) const {
    if (now_.is_known()) return now_.side(value, share * now_.spread());
    if (!before_ || before_->side(value) != 0) return 0;
    return now_.side(value, before_->spread());  // that of a few values says little
  }

  Reference empty_;
  Reference now_;
  std::optional<Reference> before_;
};

/// How many of the values `next`, none of which is out, lead back to what was before: a level may
/// be so noisy that what was before lies within its spread. 0: they do not.
std::size_t length_of_quiet_return(std::span<const double> next, const Levels& levels) {
  if (next.size() < kFewest || !levels.now().is_known()) return 0;
  const auto first = next.first(kFewest);
  const auto returns = [&](double value) { return levels.returns(value); };
  return std::all_of(first.begin(), first.end(), returns) ? kFewest : 0;
}

/// How many of the values `next` are the beginning of a change to `side`; 0: they are none.
std::size_t length_of_change(std::span<const double> next, const Levels& levels, int side) {
  std::size_t out = 0;
  bool all_return = true;
  const std::size_t most = std::min(next.size(), kWithin);
  for (std::size_t i = 0; i < most && levels.leaning(next[i]) == side; ++i) {
    out += levels.side(next[i]) == side;
    if (out == kFramesOfChange) return i + 1;
    all_return = all_return && levels.returns(next[i]);
    if (i + 1 == next.size() && all_return) return i + 1;
  }
  return 0;
}

/// Changes of values that are all known; each goes on until the next. `first`: changes among the
/// first ones, in order.
std::vector<Change> search(std::span<const double> values, const Reference& empty,
                           std::span<const Change> first = {}) {
  std::vector<Change> changes;
  Levels levels(empty);
  for (std::size_t k = 0; k < values.size(); ++k) {
    while (!first.empty() && first.front().at < k) first = first.subspan(1);
    const bool is_told = !first.empty() && first.front().at == k;
    const int side = levels.side(values[k]);
    const std::span<const double> rest = values.subspan(k);
    const std::size_t length = is_told     ? std::min(kFramesOfChange, rest.size())
                               : side == 0 ? length_of_quiet_return(rest, levels)
                                           : length_of_change(rest, levels, side);
    if (length == 0) {
      if (side == 0) levels.add(values[k]);
      continue;
    }
    const auto next = rest.first(length);
    const double after = median_of(next);
    changes.push_back(
        is_told ? Change{k, {}, first.front().before, after, first.front().spreads}
                : Change{k, {}, levels.now().median(), after, levels.now().spreads(after)});
    levels.change(next);
    k += length - 1;
  }
  return changes;
}

/// Changes among the values of which the running median is not known yet: found backwards, from
/// values that it is known of.
std::vector<Change> first_changes(std::span<const double> values, const Reference& empty) {
  const std::size_t count = std::min(values.size(), kReference);
  std::vector<double> backwards(values.begin(),
                                values.begin() + static_cast<std::ptrdiff_t>(count));
  std::reverse(backwards.begin(), backwards.end());
  std::vector<Change> found = search(backwards, empty);
  std::reverse(found.begin(), found.end());
  std::vector<Change> changes;
  for (const Change& c : found) {
    const double earlier = c.after;
    const double later = c.before;
    std::size_t at = count - c.at;
    // Those that are known may begin with some from before the change.
    while (at < count && std::abs(values[at] - earlier) < std::abs(values[at] - later)) ++at;
    if (at <= kFewest) changes.push_back({at, {}, earlier, later, -c.spreads});
  }
  return changes;
}

/// Those that lead back to what was before an earlier one are its end, and of what came since.
std::vector<Change> with_ends(std::span<const Change> steps, double threshold) {
  std::vector<Change> changes;
  std::vector<std::size_t> open;
  for (const Change& step : steps) {
    const auto is_undone = [&](std::size_t i) {
      const Change& earlier = changes[i];
      const double spread = (earlier.after - earlier.before) / earlier.spreads;
      const double off = std::abs(step.after - earlier.before);
      return off <= threshold * spread && off < std::abs(step.after - step.before);
    };
    const auto found = std::find_if(open.rbegin(), open.rend(), is_undone);
    if (found == open.rend()) {
      open.push_back(changes.size());
      changes.push_back(step);
      continue;
    }
    const auto first = std::prev(found.base());
    for (auto i = first; i != open.end(); ++i) changes[*i].end = step.at;
    open.erase(first, open.end());
  }
  return changes;
}

/// The values next to number `k` of a list, without it.
std::vector<double> neighbours(std::span<const double> values, std::size_t k) {
  const std::size_t count = std::min(kReference + 1, values.size());
  const std::size_t first = std::min(k - std::min(k, kReference / 2), values.size() - count);
  std::vector<double> result;
  for (std::size_t i = first; i < first + count; ++i)
    if (i != k) result.push_back(values[i]);
  return result;
}

/// `level`: values of one level, in order; `row`: their places among all, of which `last` is the
/// last known one.
void find_outliers(std::span<const double> level, std::span<const std::size_t> row,
                   std::size_t last, const Reference& empty, ChangeReport& report) {
  if (level.size() <= kFewest) return;
  std::vector<int> sides;
  std::vector<int> leanings;
  for (std::size_t k = 0; k < level.size(); ++k) {
    const Reference around = empty.around(neighbours(level, k));
    sides.push_back(around.side(level[k]));
    leanings.push_back(around.side(level[k], 0.5 * around.spread()));
  }
  for (std::size_t k = 0; k < level.size();) {
    std::size_t end = k + 1;
    while (end < level.size() && leanings[end] == leanings[k]) ++end;
    const bool is_short = leanings[k] != 0 && end - k < kFramesOfChange;
    auto& list = row[end - 1] == last ? report.at_end : report.outliers;
    for (std::size_t i = k; i < end && is_short; ++i) {
      if (sides[i] != 0) list.push_back(row[i]);
    }
    k = end;
  }
}

}  // namespace

ChangeReport find_changes(std::span<const double> values, const ChangeOptions& options) {
  const double threshold =
      std::sqrt(2 * std::log(2 * static_cast<double>(options.values) / options.chance));
  std::vector<std::size_t> known;
  std::vector<double> series;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) continue;
    known.push_back(i);
    series.push_back(values[i]);
  }
  const Reference empty(std::max(options.smallest / threshold, frame_noise(series)), threshold,
                        options.follows);
  ChangeReport report;
  if (known.empty()) return report;
  report.changes = with_ends(search(series, empty, first_changes(series, empty)), threshold);
  // The last change that a value is in; those of none are of one level, before and after.
  std::vector<std::size_t> level_of(series.size(), 0);
  for (std::size_t c = 0; c < report.changes.size(); ++c) {
    Change& change = report.changes[c];
    const std::size_t end = change.end.value_or(series.size());
    for (std::size_t k = change.at; k < end; ++k) level_of[k] = c + 1;
    change.at = known[change.at];
    if (change.end) change.end = known[end];
  }
  for (std::size_t c = 0; c <= report.changes.size(); ++c) {
    std::vector<double> level;
    std::vector<std::size_t> rows;
    for (std::size_t k = 0; k < series.size(); ++k) {
      if (level_of[k] != c) continue;
      level.push_back(series[k]);
      rows.push_back(known[k]);
    }
    find_outliers(level, rows, known.back(), empty, report);
  }
  std::sort(report.outliers.begin(), report.outliers.end());
  return report;
}

}  // namespace pencilscan
