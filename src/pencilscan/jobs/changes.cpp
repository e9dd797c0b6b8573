#include "pencilscan/jobs/changes.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>

#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

// Short, so that slow motion of the object is followed: waves of 15 deviations with a period of 125
// values gave no change in 100 sequences of 300 values; with 25 values 12.
constexpr std::size_t kReference = 15;
constexpr std::size_t kFewest = 8;  // values that a median and its spread can be trusted of
constexpr std::size_t kInARow = 3;  // named within that many frames, and no single bad one is

/// The running median and its spread.
class Reference {
 public:
  Reference(double least_spread, double threshold)
      : least_spread_(least_spread), threshold_(threshold) {}

  [[nodiscard]] bool is_known() const { return values_.size() >= kFewest; }
  [[nodiscard]] double median() const { return median_; }
  [[nodiscard]] double spreads(double value) const { return (value - median_) / spread_; }
  /// -1: below, 1: above, 0: as before.
  [[nodiscard]] int side(double value) const {
    if (std::abs(spreads(value)) <= threshold_) return 0;
    return value > median_ ? 1 : -1;
  }
  void add(double value) {
    values_.push_back(value);
    if (values_.size() > kReference) values_.pop_front();
    median_ = upper_median(std::vector<double>(values_.begin(), values_.end()));
    std::vector<double> distances;
    for (const double v : values_) distances.push_back(std::abs(v - median_));
    spread_ = std::max(least_spread_, kDeviationPerMedian * upper_median(std::move(distances)));
  }
  void clear() { values_.clear(); }

 private:
  double least_spread_;
  double threshold_;
  std::deque<double> values_;
  double median_ = 0;
  double spread_ = 0;
};

/// Standard deviation from value to value, over all of them: what a few quiet ones cannot hide.
double frame_noise(std::span<const double> values, const std::vector<std::size_t>& known) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < known.size(); ++k)
    steps.push_back(std::abs(values[known[k]] - values[known[k - 1]]));
  return kDeviationPerMedian * upper_median(std::move(steps)) / std::numbers::sqrt2;
}

}  // namespace

ChangeReport find_changes(std::span<const double> values, const ChangeOptions& options) {
  const double threshold =
      std::sqrt(2 * std::log(2 * static_cast<double>(options.values) / options.chance));
  std::vector<std::size_t> known;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) known.push_back(i);
  }
  ChangeReport report;
  Reference reference(std::max(options.smallest / threshold, frame_noise(values, known)),
                      threshold);
  for (std::size_t k = 0; k < known.size(); ++k) {
    const double value = values[known[k]];
    const int side = reference.is_known() ? reference.side(value) : 0;
    if (side == 0) {
      reference.add(value);
      continue;
    }
    std::vector<double> next;
    for (std::size_t i = k; i < known.size() && next.size() < kInARow; ++i)
      next.push_back(values[known[i]]);
    const bool lasts =
        next.size() == kInARow &&
        std::all_of(next.begin(), next.end(), [&](double v) { return reference.side(v) == side; });
    if (!lasts) {
      report.outliers.push_back(known[k]);
      continue;
    }
    const double after = upper_median(next);
    report.changes.push_back({known[k], reference.median(), after, reference.spreads(after)});
    reference.clear();
    reference.add(value);
  }
  return report;
}

}  // namespace pencilscan
