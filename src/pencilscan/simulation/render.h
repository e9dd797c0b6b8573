#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/rig/rig.h"
#include "pencilscan/simulation/panel_light.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {

/// Radiance that a camera receives. Model per ray, summed over the projectors that reach the point:
///
///   I = exposure * (D / d)^2 * (albedo cos + specular (n.h)^(1 / roughness)) * M * pattern
///
/// plus albedo * ambient, with d the distance to the projector, D the mean distance of all
/// projectors from the centre of the working volume (equal lamps, nominal strength there), h the
/// half-way vector (Blinn 1977), M the rig's colour matrix of the camera for that projector. One
/// pixel is the mean over samples x samples rays; the pattern under each ray is averaged over the
/// ray's own footprint. Where the rig states a color_registration, each colour of light has rays of
/// its own, bent by the camera's lens, and comes from its own place of the panel.
struct RenderOptions {
  int samples = 3;             ///< rays per pixel and axis, >= 1
  double exposure = 0.55;      ///< image value of a white, facing surface at the volume's centre
  bool inverse_square = true;  ///< light falls off with distance
  double ambient = 0;  ///< even grey light on all surfaces: image value of a white one, >= 0
};

/// D of the model, mm.
[[nodiscard]] double reference_distance(const Rig& rig);

/// Linear light of one camera, CV_32FC3 in RGB order, without sensor effects. `lights` has one
/// entry per projector of the rig.
[[nodiscard]] cv::Mat render_camera(const Rig& rig, std::size_t camera,
                                    const SimulatedObject& object,
                                    std::span<const PanelLight> lights,
                                    const RenderOptions& options = {});

/// Grey images (CV_32FC1, linear) of one camera under a sequence of patterns from one projector:
/// rays are traced once for all of them. Empty when the camera sees no point that the projector
/// lights.
[[nodiscard]] std::vector<cv::Mat> render_sequence(const Rig& rig, std::size_t camera,
                                                   std::size_t projector,
                                                   const SimulatedObject& object,
                                                   std::span<const PanelLight> sequence,
                                                   const RenderOptions& options = {});
/// The same in colour, CV_32FC3 RGB.
[[nodiscard]] std::vector<cv::Mat> render_color_sequence(const Rig& rig, std::size_t camera,
                                                         std::size_t projector,
                                                         const SimulatedObject& object,
                                                         std::span<const PanelLight> sequence,
                                                         const RenderOptions& options = {});

}  // namespace pencilscan
