#pragma once

#include <algorithm>

namespace pencilscan {

/// visit(begin, end) for each stretch [begin, end) of equal values.
template <class Values, class Visit>
void for_each_stretch(const Values& values, Visit visit) {
  for (auto begin = values.begin(); begin != values.end();) {
    const auto end =
        std::find_if(begin, values.end(), [&](const auto& value) { return !(value == *begin); });
    visit(static_cast<int>(begin - values.begin()), static_cast<int>(end - values.begin()));
    begin = end;
  }
}

}  // namespace pencilscan
