#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/page/block.h"
#include "pencilscan/page/result_folder.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A picture as the browser gets it.
struct EncodedImage {
  std::string type;  ///< "image/webp", "image/png", "image/jpeg"
  std::string bytes;
};

/// What a camera saw, gamma-coded for a screen, at most `max_width` pixels wide; nothing where the
/// result holds no picture of it. InputError for a broken file.
[[nodiscard]] std::optional<EncodedImage> camera_image(const ResultEntry& entry,
                                                       const Camera& camera, int max_width,
                                                       int quality);

/// pictures/<camera>_holes.png without its legend, every fourth pixel.
[[nodiscard]] std::optional<EncodedImage> hole_image(const ResultEntry& entry,
                                                     const Camera& camera);

/// Camera z (mm) of every fourth pixel of every fourth row: from depth/<camera>.tiff, or else of
/// the measured surface (may be null). Header: columns, rows, stride, source.
[[nodiscard]] std::optional<Block> depth_block(const ResultEntry& entry, const Camera& camera,
                                               const RayScene* measured);

/// A small shaded view of a mesh as JPEG.
[[nodiscard]] EncodedImage mesh_thumbnail(const TriangleMesh& mesh, int width, int height);

}  // namespace pencilscan
