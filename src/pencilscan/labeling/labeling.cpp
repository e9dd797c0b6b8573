#include "pencilscan/labeling/labeling.h"

#include <algorithm>

namespace pencilscan {

std::size_t labelled_points(std::span<const LabeledRun> runs) {
  std::size_t count = 0;
  for (const LabeledRun& run : runs) count += static_cast<std::size_t>(run.end - run.begin);
  return count;
}

std::size_t labelled_points(const Labeling& labeling) {
  std::size_t count = 0;
  for (const auto& runs : labeling.runs) count += labelled_points(runs);
  return count;
}

std::array<std::size_t, 4> undecided_points(std::span<const UndecidedRun> undecided,
                                            std::span<const LabeledRun> labelled) {
  std::array<std::size_t, 4> points{};
  for (const UndecidedRun& run : undecided) {
    int left = run.end - run.begin;
    for (const LabeledRun& other : labelled) {
      if (other.curve == run.curve)
        left -= std::max(0, std::min(run.end, other.end) - std::max(run.begin, other.begin));
    }
    points[static_cast<std::size_t>(run.reason)] += static_cast<std::size_t>(left);
  }
  return points;
}

}  // namespace pencilscan
