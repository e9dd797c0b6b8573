#pragma once

#include <cstddef>
#include <string>

#include "pencilscan/core/progress.h"

namespace pencilscan {

/// Tells of a stage of known steps, of which `done` are behind it: "rendering: image 3 of 30".
inline void tell_steps(const Progress& progress, const std::string& what, std::size_t done,
                       std::size_t steps) {
  if (!progress) return;
  progress(what + " " + std::to_string(done) + " of " + std::to_string(steps),
           steps == 0 ? 1 : static_cast<double>(done) / static_cast<double>(steps));
}

}  // namespace pencilscan
