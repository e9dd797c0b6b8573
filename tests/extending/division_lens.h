#pragma once

#include "pencilscan/exchange/brown_fit.h"

namespace pencilscan::example {

[[nodiscard]] LensModel division_lens(double lambda);

}  // namespace pencilscan::example
