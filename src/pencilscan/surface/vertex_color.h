#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

struct ColorOptions {
  double least_cosine = 0.2;  ///< of the incidence to camera and projector, in (0, 1)
  double smoothing = 0.1;     ///< of a neighbour against a fully lit vertex, > 0
  int rounds = 60;            ///< of conjugate gradients
  double bright = 0.9;        ///< what the 95th percentile of the brightest channel becomes
};

/// One camera's image as colour needs it.
struct ColorView {
  int camera = 0;
  /// Linear, RGB of the camera, of any depth, one channel where all are alike; NaN or, in [0, 1],
  /// `full` and more where overexposed. It may share its pixels with the image as stored.
  cv::Mat image;
  float full = std::numeric_limits<float>::infinity();
  /// Projector RGB of an image with patterns.
  Eigen::Matrix3f light_from_image = Eigen::Matrix3f::Identity();
  double blur_px = 0.8;   ///< of camera and projector together
  bool is_plain = false;  ///< no patterns in the image: taken without them, or by a texture camera
};

/// Albedo per vertex from images of the patterns: linear red, green and blue in [0, 1], up to one
/// common factor that no frame tells. The surface is known, and so is the light on it:
///   I_c = rho (sum_p E_p P_p + a_c),  E_p = cosine / distance^2 where p is not shadowed,
/// P_p: the pattern's colour at the vertex with its lines as blurred as in the image, a_c: ambient
/// light of camera c, estimated where no line falls. rho is a least-squares fit per vertex and
/// channel. A vertex that a channel does not light, or that is invented, gets the colour of its
/// neighbours (the weighted Laplace equation on the mesh). Where there are plain views, only they
/// count, and their light is taken as even. All projectors are taken as equally bright at the
/// centre of the volume. Empty when no camera gives a colour.
[[nodiscard]] std::vector<std::array<float, 3>> vertex_colors(const Rig& rig,
                                                              const RayScene& surface,
                                                              std::span<const ColorView> views,
                                                              const ColorOptions& options = {});

}  // namespace pencilscan
