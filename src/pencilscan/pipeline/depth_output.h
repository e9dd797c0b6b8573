#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// depth/<camera>.tiff and sigma/<camera>.tiff (float mm, NaN: none), depth/<camera>.png (16 bit,
/// 0.1 mm, 0: none). Returns a sentence for every PNG that does not hold what its TIFF does: depths
/// lie beyond 6553 mm, or 0.1 mm is more than two pixels cover at the median depth.
[[nodiscard]] std::vector<std::string> write_depth_maps(const std::filesystem::path& folder,
                                                        const Rig& rig, const ShapeResult& shape);

/// <camera>_holes.png: the reason of every foreground node without depth, in colours with a legend.
void write_hole_pictures(const std::filesystem::path& folder, const Rig& rig,
                         const ShapeResult& shape);

}  // namespace pencilscan
