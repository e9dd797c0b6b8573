#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace pencilscan {

/// Sum over the groups of the strongest vote of each: what one voice says twice counts once.
/// `votes`: ordered by their `group`; strength(vote): what one of them weighs, >= 0.
template <class Vote, class Strength>
[[nodiscard]] auto tally(const std::vector<Vote>& votes, Strength strength) {
  using Sum = decltype(strength(votes[0]));
  Sum total = 0;
  Sum best = 0;
  for (std::size_t i = 0; i < votes.size(); ++i) {
    if (i > 0 && votes[i].group != votes[i - 1].group) {
      total += best;
      best = 0;
    }
    best = std::max(best, strength(votes[i]));
  }
  return total + best;
}

}  // namespace pencilscan
