#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "pencilscan/geometry/device.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {

/// What one camera ray meets.
struct SightedPoint {
  Vec3 point;        ///< world, mm
  Vec3 face_normal;  ///< unit, towards the camera
  Vec3 normal;       ///< unit, for shading
  Vec3 to_camera;    ///< unit
  double depth = 0;  ///< camera z, mm
  Vec3 across;       ///< how the point moves on its tangent plane per camera pixel in x, mm
  Vec3 down;         ///< the same in y
};

/// Rays of one camera. Tiles that the projected mesh cannot touch are known beforehand, so empty
/// background costs nothing. Immutable; keeps references to both arguments.
class CameraTracer {
 public:
  CameraTracer(const Device& camera, const SimulatedObject& object);

  /// False only when no ray within a pixel of (x, y) can hit.
  [[nodiscard]] bool may_hit(int x, int y) const {
    return tiles_[static_cast<std::size_t>(y / kTile) * tiles_across_ +
                  static_cast<std::size_t>(x / kTile)] != 0;
  }
  [[nodiscard]] std::optional<SightedPoint> trace(const Vec2& pixel) const;

 private:
  static constexpr int kTile = 8;  ///< px
  void mark_tiles();

  const Device* camera_;
  const SimulatedObject* object_;
  Vec3 center_;
  Mat3 world_from_camera_;
  std::size_t tiles_across_ = 0;
  std::vector<std::uint8_t> tiles_;
};

/// Where a projector's panel lights a point, in its own frame. Nothing behind it, outside of its
/// panel, and beyond where the polynomial of its lens turns back: no lens shows a place of the
/// panel in two directions.
[[nodiscard]] std::optional<Vec2> panel_pixel(const Device& projector, const Vec3& x_in_projector);

/// Light of one projector at a surface sample, before the test for shadows.
struct Incidence {
  Vec2 pixel;           ///< on the panel
  Vec2 footprint_px;    ///< root-mean-square width of one camera pixel on the panel, per axis
  Vec3 to_light;        ///< unit
  double cosine = 0;    ///< with the shading normal, > 0
  double distance = 0;  ///< mm
};
/// Nothing when the sample faces away from the projector or lies outside its panel.
[[nodiscard]] std::optional<Incidence> incidence(const Device& projector, const Vec3& center,
                                                 const SightedPoint& sample);

}  // namespace pencilscan
