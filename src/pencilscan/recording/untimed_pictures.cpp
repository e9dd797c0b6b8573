#include "pencilscan/recording/untimed_pictures.h"

namespace pencilscan {
namespace {

/// The sets between those of the timed rows before and after `rows`, if they are as many and hold
/// nothing of camera c.
std::vector<std::size_t> sets_for(const FrameSets& result, std::size_t c,
                                  std::optional<std::size_t> before,
                                  std::optional<std::size_t> after, std::size_t rows) {
  std::vector<std::size_t> between;
  if (!before || !after || *after <= *before || *after - *before - 1 != rows) return between;
  for (std::size_t k = *before + 1; k < *after; ++k) {
    if (result.sets[k].rows[c]) return {};
    between.push_back(k);
  }
  return between;
}

}  // namespace

void place_untimed(const ShotTimes& camera, std::size_t c,
                   const std::vector<std::optional<std::size_t>>& set_of, FrameSets& result) {
  std::vector<std::size_t>& left_out = result.clocks[c].left_out;
  std::optional<std::size_t> before;
  std::vector<std::size_t> untimed;
  const auto place = [&](std::optional<std::size_t> after) {
    const std::vector<std::size_t> sets = sets_for(result, c, before, after, untimed.size());
    if (sets.empty()) left_out.insert(left_out.end(), untimed.begin(), untimed.end());
    for (std::size_t i = 0; i < sets.size(); ++i) result.sets[sets[i]].rows[c] = untimed[i];
    untimed.clear();
  };
  for (std::size_t row = 0; row < camera.valid.size(); ++row) {
    if (set_of[row]) {
      place(set_of[row]);
      before = set_of[row];
    } else if (camera.valid[row] != 0) {
      untimed.push_back(row);
    }
  }
  place(std::nullopt);
}

}  // namespace pencilscan
