#pragma once

#include <array>
#include <span>
#include <vector>

#include "pencilscan/gray/gray_decode.h"
#include "pencilscan/rig/color_registration.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {

/// One camera pixel under one projector's Gray codes in one channel: how far its panel coordinate
/// lies from that of all channels together.
struct ColorSample {
  std::size_t camera = 0;     ///< index in the rig
  std::size_t projector = 0;  ///< index in the rig
  std::size_t color = 0;      ///< 0 red, 1 green, 2 blue
  Vec2 camera_pixel = Vec2::Zero();
  Vec2 panel_pixel = Vec2::Zero();
  Eigen::Matrix2d panel_per_camera;  ///< d panel pixel / d camera pixel
  Vec2 offset_px = Vec2::Zero();     ///< panel px
  Vec2 sigma_px = Vec2::Zero();      ///< one standard deviation, > 0
};

/// On a lattice of camera pixels: `grey` is the decoded mean of the channels.
[[nodiscard]] std::vector<ColorSample> color_samples(std::size_t camera, std::size_t projector,
                                                     const DecodedView& grey,
                                                     const std::array<DecodedView, 3>& channels,
                                                     int spacing_px = 12);

/// What is known of one colour of one device.
struct ColorDisplacementEstimate {
  ColorDisplacement value;
  Vec2 shift_sigma_px = Vec2::Zero();
  double scale_sigma = 0;
  bool is_determined = false;  ///< the shift is known far better than what is usual of devices
};

struct LateralColorOptions {
  // What is usual of devices, one standard deviation: shared out evenly where the data know sums.
  double usual_shift_px = 1;    ///< > 0
  double usual_scale = 2e-3;    ///< > 0
  double edge_sigma_px = 0.01;  ///< error of an offset beyond its own deviation
  /// Errors (shading, what colours leak) that all samples of a part of an image share, and others
  /// that all of a pair do; residuals do not show them. Weakly known combinations magnify them.
  double shared_error_px = 0.004;
  double determined_share = 0.3;  ///< of usual_shift_px, that a known one's deviation is below
};

struct LateralColor {
  std::vector<std::array<ColorDisplacementEstimate, 3>> devices;  ///< cameras first; all or none
  std::size_t samples = 0;
  double offset_rms_px = 0;     ///< of the offsets as measured, panel px
  double remaining_rms_px = 0;  ///< of what the displacements do not explain
  double explained_rms_px = 0;  ///< of the offsets that the displacements predict
};

/// Where every device has each colour, from where pairs see it. A camera that has colour k
/// displaced by e(u) and a projector by d(x) together show the panel coordinate
///   offset = d(x) - J e(u),   J = d panel / d camera, d and e of the form s + a (pixel - center),
/// which is linear in s and a. Displacements are against all channels together, to which the rig
/// refers. Robust least squares (Tukey's weights) with what is usual as a prior: where J is alike
/// everywhere (one camera beside one projector), only sums show, and the prior shares them out.
/// Deviations: neighbours err alike, so parts of images (a ninth each, per pair) count as one error
/// (the "sandwich" of clustered data, Liang and Zeger 1986).
[[nodiscard]] LateralColor estimate_lateral_color(const Rig& rig,
                                                  std::span<const ColorSample> samples,
                                                  const LateralColorOptions& options = {});

}  // namespace pencilscan
