#include "pencilscan/recording/camera_turns.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

namespace pencilscan {
namespace {

/// Where the widest step between the shots of a set is: the first shot after it.
std::size_t widest_step(const std::vector<TimedShot>& set) {
  std::size_t widest = 1;
  for (std::size_t i = 2; i < set.size(); ++i) {
    if (set[i].time_ns - set[i - 1].time_ns > set[widest].time_ns - set[widest - 1].time_ns)
      widest = i;
  }
  return widest;
}

/// The cameras of each half of a set, in order.
using Halves = std::pair<std::vector<std::size_t>, std::vector<std::size_t>>;

/// Nothing where the set is one moment (frame_sets.h).
std::optional<Halves> halves_of(const std::vector<TimedShot>& set, double period) {
  constexpr std::size_t kPair = 2;  // cameras that see one moment
  if (set.size() < 2 * kPair) return std::nullopt;
  const std::size_t step = widest_step(set);
  if (set[step].time_ns - set[step - 1].time_ns <= period / 4) return std::nullopt;
  if (step < kPair || set.size() - step < kPair) return std::nullopt;
  Halves halves;
  for (std::size_t i = 0; i < set.size(); ++i)
    (i < step ? halves.first : halves.second).push_back(set[i].camera);
  std::sort(halves.first.begin(), halves.first.end());
  std::sort(halves.second.begin(), halves.second.end());
  return halves;
}

}  // namespace

void split_turns(std::vector<std::vector<TimedShot>>& sets, double period) {
  std::map<Halves, std::size_t> counts;
  for (const std::vector<TimedShot>& set : sets) {
    if (const auto halves = halves_of(set, period)) ++counts[*halves];
  }
  const auto most =
      std::max_element(counts.begin(), counts.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most == counts.end() || 2 * most->second <= sets.size()) return;
  std::vector<std::vector<TimedShot>> result;
  for (std::vector<TimedShot>& set : sets) {
    // One that lacks pictures is split where its widest step is as well.
    const std::size_t step = set.size() > 1 ? widest_step(set) : 0;
    if (step == 0 || set[step].time_ns - set[step - 1].time_ns <= period / 4) {
      result.push_back(std::move(set));
      continue;
    }
    const auto middle = set.begin() + static_cast<std::ptrdiff_t>(step);
    result.emplace_back(set.begin(), middle);
    result.emplace_back(middle, set.end());
  }
  sets = std::move(result);
}

}  // namespace pencilscan
