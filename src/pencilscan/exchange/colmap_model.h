#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "pencilscan/exchange/exchanged_device.h"
#include "pencilscan/labeling/measured_point.h"

namespace pencilscan {

// COLMAP's text model: cameras.txt, images.txt, points3D.txt (COLMAP documentation, "Output
// Format"). Axes and poses are ours (camera from world, quaternion w x y z). The centre of its
// top-left pixel is (0.5, 0.5): its coordinates are ours plus one half.

/// COLMAP's centre of the first pixel.
inline constexpr double kColmapHalfPixel = 0.5;

/// COLMAP draws that many at ease.
inline constexpr std::size_t kMostColmapPoints = 100000;

/// Reads cameras.txt and images.txt: one device per image, named like the image file without
/// ending. Models SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV. All are
/// cameras; lengths and world are the model's own. InputError with the line at fault.
[[nodiscard]] ExchangedRig read_colmap(const std::filesystem::path& folder);

/// Writes every device as an image <name>.png with a camera of its own (PINHOLE, OPENCV or
/// FULL_OPENCV, whichever holds its lens) and, of `points` measured with this rig, at most
/// `most_points`, evenly picked, seen where their cameras saw them. Devices are numbered from 1,
/// cameras first. InputError for skew in K, for names with blanks, and for one name of a camera and
/// a projector, which COLMAP cannot hold.
void write_colmap(const Rig& rig, std::span<const MeasuredPoint> points,
                  const std::filesystem::path& folder, std::size_t most_points = kMostColmapPoints);

}  // namespace pencilscan
