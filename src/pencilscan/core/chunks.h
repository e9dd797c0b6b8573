#pragma once

#include <algorithm>
#include <cstddef>

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

}  // namespace pencilscan
