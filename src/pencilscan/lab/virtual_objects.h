#pragma once

#include <cstdint>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// A heap of balls as wide, deep and high as the volume, other ones for every seed: what
/// docs/lab.md recommends for a calibration.
[[nodiscard]] TriangleMesh make_heap(const Sphere& volume, std::uint64_t seed);

/// A closed smooth body with bumps and hollows that fills the volume: an object to measure where
/// the user has none.
[[nodiscard]] TriangleMesh make_pebble(const Sphere& volume);

}  // namespace pencilscan
