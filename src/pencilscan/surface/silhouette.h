#pragma once

#include <opencv2/core.hpp>
#include <span>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Where one camera's image is dark: the camera sees nothing there that a projector lights.
struct Silhouette {
  int camera = 0;
  cv::Mat light;  ///< CV_8U, 0: dark as far as the lines are apart
};

/// Separates dark and light in an image (CV_32FC3, linear; NaN: overexposed, which is light). Gaps
/// between lines are at most `reach_px` on each side, so that a pixel is dark only if it is farther
/// than that from light. An image without contrast has no dark pixels.
[[nodiscard]] Silhouette silhouette(int camera, const cv::Mat& image, double reach_px);

/// Half the distance of neighbouring lines in a camera's image at the centre of the volume, px, of
/// the projector that spreads them farthest.
[[nodiscard]] double line_reach_px(const Rig& rig, const Camera& camera);

struct CarvingOptions {
  double step = 2;  ///< footprints per round, > 0
  int rounds = 48;
  double least_cosine = 0.2;  ///< of the incidence to camera and projector, in (0, 1)
};

/// Silhouette carving (Laurentini, "The visual hull concept", 1994) of the invented part of a
/// closed mesh, whose vertices have confidence 0. A vertex that a camera sees where its image is
/// dark is wrong in two cases: some projector would light it, or the line of sight meets nothing
/// that was measured, so that the pixel shows background. (Otherwise the pixel may show a shadow on
/// the object.) A wrong vertex moves inwards, at most a quarter of the way to the opposite side,
/// and takes its invented neighbours along. Returns how many vertices moved.
std::size_t carve(const Rig& rig, std::span<const Silhouette> silhouettes,
                  const CarvingOptions& options, TriangleMesh& mesh);

}  // namespace pencilscan
