#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "pencilscan/core/parallel.h"

namespace pencilscan {

/// parallel_for over [0, count) in runs of indices: enough work to hide the scheduling where
/// body(i) is small.
template <typename Body>
void parallel_chunks(std::size_t count, const Body& body) {
  constexpr std::size_t kRun = 256;
  parallel_for((count + kRun - 1) / kRun, [&](std::size_t k) {
    const std::size_t end = std::min(count, (k + 1) * kRun);
    for (std::size_t i = k * kRun; i < end; ++i) body(i);
  });
}

/// `sum` (zero) and of_run(from, to) over [0, count) cut into runs of `run` indices, which go side
/// by side; their sums are added in order, so that it is the same for any number of threads.
template <typename Sum, typename OfRun>
[[nodiscard]] Sum sum_of_runs(std::size_t count, std::size_t run, Sum sum, const OfRun& of_run) {
  std::vector<Sum> sums((count + run - 1) / run, sum);
  parallel_for(sums.size(),
               [&](std::size_t r) { sums[r] = of_run(r * run, std::min(count, (r + 1) * run)); });
  for (const Sum& one : sums) sum += one;
  return sum;
}

}  // namespace pencilscan
