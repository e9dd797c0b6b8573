#pragma once

#include <opencv2/core.hpp>
#include <span>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Where one camera's image is dark: nothing that a projector lights is to be seen there.
struct Silhouette {
  int camera = 0;
  cv::Mat light;  ///< CV_8U, 0: dark as far as the lines are apart
};

/// Dark and light of an image (CV_32FC3, linear; NaN: overexposed, light). Lines leave gaps of
/// `reach_px` on each side at most: what is nearer than that to light is not called dark. Nothing
/// is dark in an image without contrast.
[[nodiscard]] Silhouette silhouette(int camera, const cv::Mat& image, double reach_px);

/// Half the distance of neighbouring lines in a camera's image at the centre of the volume, px, of
/// the projector that spreads them farthest.
[[nodiscard]] double line_reach_px(const Rig& rig, const Camera& camera);

struct DrawInOptions {
  double step = 2;  ///< footprints per round, > 0
  int rounds = 48;
  double least_cosine = 0.2;  ///< of the incidence to camera and projector, in (0, 1)
};

/// Draws the invented part of a closed mesh (confidence 0) into the silhouettes. A vertex that a
/// camera sees where its image is dark is not there if some projector lights it, or if the ray of
/// sight meets nothing that was measured: then the pixel shows background, and not the shadow on a
/// known object. It moves inwards, never farther than a quarter of the way to the opposite side,
/// and takes its invented neighbours along. Returns how many vertices moved.
std::size_t draw_in(const Rig& rig, std::span<const Silhouette> silhouettes,
                    const DrawInOptions& options, TriangleMesh& mesh);

}  // namespace pencilscan
