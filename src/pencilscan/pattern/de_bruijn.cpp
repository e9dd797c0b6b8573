#include "pencilscan/pattern/de_bruijn.h"

#include <cstddef>
#include <functional>

#include "pencilscan/core/check.h"

namespace pencilscan {

std::vector<int> de_bruijn_sequence(int alphabet, int order) {
  PENCILSCAN_CHECK(alphabet >= 1 && order >= 1);
  std::vector<int> word(static_cast<std::size_t>(order) + 1, 0);
  std::vector<int> sequence;
  // Appends, in lexicographic order, the Lyndon words whose length divides the order.
  const std::function<void(int, int)> extend = [&](int t, int period) {
    if (t > order) {
      if (order % period == 0)
        sequence.insert(sequence.end(), word.begin() + 1, word.begin() + 1 + period);
      return;
    }
    const auto at = static_cast<std::size_t>(t);
    word[at] = word[at - static_cast<std::size_t>(period)];
    extend(t + 1, period);
    for (int symbol = word[at] + 1; symbol < alphabet; ++symbol) {
      word[at] = symbol;
      extend(t + 1, t);
    }
  };
  extend(1, 1);
  return sequence;
}

}  // namespace pencilscan
