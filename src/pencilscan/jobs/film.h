#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "pencilscan/core/progress.h"

namespace pencilscan {

/// The shapes of a sequence, frame by frame.
struct Film {
  std::filesystem::path out;        ///< output folder of reconstruct
  std::vector<std::string> frames;  ///< all frames of the sequence
  std::vector<char> has_mesh;       ///< per frame
  bool unit_known = true;           ///< of the rig in use
  bool measured_only = false;       ///< mesh_measured.ply in place of the closed mesh.ply

  [[nodiscard]] std::filesystem::path mesh_file(std::size_t frame) const;
};

/// InputError when `out` is no output folder, or no frame of it has a mesh.
[[nodiscard]] Film find_film(const std::filesystem::path& out, bool measured_only);

/// One Zarr group (version 2) with a group per frame that has a mesh: `vertices` <f4 [n, 3] in the
/// rig's unit, `faces` <i4 [m, 3], `sigma` <f4 [n] along the normal, `measured` |u1 [n]. Appears
/// whole or not at all; replaces what an earlier call wrote, InputError for anything else there.
void write_film_zarr(const Film& film, const std::filesystem::path& folder,
                     const Progress& progress = {});

/// One mesh of USD text (.usda) with time samples of points, faces, colours and sigma; the k-th
/// frame is time code k. A frame without a mesh shows nothing; one without colours is white where
/// others have some. Of an unknown unit `metersPerUnit` is 1, and `customLayerData` says so. One
/// frame is in memory at a time.
void write_film_usd(const Film& film, double frames_per_second, const std::filesystem::path& file,
                    const Progress& progress = {});

}  // namespace pencilscan
