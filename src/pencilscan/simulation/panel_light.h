#pragma once

#include <vector>

#include "pencilscan/pattern/gray_code.h"
#include "pencilscan/pattern/solid_color.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// How a projector turns its pattern into light.
struct FilmOptions {
  bool pixelated = false;  ///< lines resampled to square panel pixels, not a continuous film
  double blur_px = 0;      ///< standard deviation of the projector's blur, panel px, >= 0
  double black_level = 0;  ///< light where the panel is black, as a share of white, in [0, 1)
};

/// Light along one panel coordinate: piecewise constant RGB between knots, zero outside them. Its
/// running integral gives the mean over any box in O(log n), which is the analytic prefilter that
/// keeps lines free of aliasing without more rays.
class PanelProfile {
 public:
  /// values[i] holds on [knots[i], knots[i + 1]); knots increase; values.size() + 1 ==
  /// knots.size().
  PanelProfile(Axis axis, std::vector<double> knots, std::vector<Vec3> values);

  [[nodiscard]] Axis axis() const { return axis_; }
  /// Mean over [px - box_px / 2, px + box_px / 2].
  [[nodiscard]] Vec3 mean(double px, double box_px) const;
  /// The same light convolved with a Gaussian of sigma_px.
  [[nodiscard]] PanelProfile blurred(double sigma_px) const;

 private:
  [[nodiscard]] Vec3 integral(double px) const;

  Axis axis_;
  std::vector<double> knots_;
  std::vector<Vec3> values_;
  std::vector<Vec3> integral_;  ///< up to each knot
};

/// What one projector shines: the sum of its profiles, at most 1 per channel. Without profiles the
/// projector is off (no black level either).
struct PanelLight {
  std::vector<PanelProfile> profiles;
  double black_level = 0;

  [[nodiscard]] bool on() const { return !profiles.empty(); }
  /// Mean light over a box around a panel position.
  [[nodiscard]] Vec3 at(const Vec2& pixel, const Vec2& box_px) const;
};

/// The projector's line patterns.
[[nodiscard]] PanelLight line_light(const Projector& projector, const FilmOptions& film = {});
/// Line patterns of every projector of the rig, in its order.
[[nodiscard]] std::vector<PanelLight> line_lights(const Rig& rig, const FilmOptions& film = {});
/// One image of a Gray-code sequence, always in panel pixels.
[[nodiscard]] PanelLight gray_code_light(const Projector& projector, const GrayCodeImage& image,
                                         const FilmOptions& film = {});
/// An even image; the projector's light is proportional to the image's values.
[[nodiscard]] PanelLight solid_light(const Projector& projector, const SolidImage& image,
                                     const FilmOptions& film = {});

}  // namespace pencilscan
