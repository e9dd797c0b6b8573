#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/geometry/mesh.h"

namespace pencilscan {

/// What the surface of one moment hands on to the next. Lengths in footprints; coordinates are
/// floats, so that a file gives back the same.
struct TrackedSurface {
  TriangleMesh mesh;                             ///< in its final place
  std::vector<std::array<int, 3>> coarse_faces;  ///< of its first vertices, before they were cut
  std::vector<float> variance;  ///< per vertex: of its place along the normal; 0: not measured
  RigidTransform motion;        ///< since the moment before

  /// The mesh before its triangles were cut finer, where it is now.
  [[nodiscard]] TriangleMesh coarse() const;
};

/// Whole or not at all. `key`: what it belongs to.
void write_tracked_surface(const std::filesystem::path& path, const TrackedSurface& surface,
                           const std::string& key);
/// Nothing where there is no such file, or it belongs to something else, or is broken.
[[nodiscard]] std::optional<TrackedSurface> read_tracked_surface(const std::filesystem::path& path,
                                                                 const std::string& key);

}  // namespace pencilscan
