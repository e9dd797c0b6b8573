#pragma once

#include <algorithm>
#include <cstddef>

#include "pencilscan/core/parallel.h"

namespace pencilscan {

/// parallel_for over [0, count) in runs of `chunk` indices: enough work to hide the scheduling
/// where body(i) is small.
template <typename Body>
void parallel_chunks(std::size_t count, std::size_t chunk, const Body& body) {
  parallel_for((count + chunk - 1) / chunk, [&](std::size_t k) {
    const std::size_t end = std::min(count, (k + 1) * chunk);
    for (std::size_t i = k * chunk; i < end; ++i) body(i);
  });
}

}  // namespace pencilscan
