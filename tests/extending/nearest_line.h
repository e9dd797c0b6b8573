#pragma once

#include "pencilscan/pipeline/method.h"

namespace pencilscan::example {

extern const SolutionMethod kNearestLine;

}  // namespace pencilscan::example
