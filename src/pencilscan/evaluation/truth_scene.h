#pragma once

#include <optional>
#include <vector>

#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// One pattern of one projector: what a line index counts within.
struct PatternChannel {
  int projector = 0;
  int pattern = 0;
  friend bool operator==(const PatternChannel&, const PatternChannel&) = default;
};

/// Every (projector, pattern) of the rig, projectors first.
[[nodiscard]] std::vector<PatternChannel> pattern_channels(const Rig& rig);

/// True when the two channels draw with the same set of colours, so that one image channel holds
/// the lines of both.
[[nodiscard]] bool same_color_family(const Rig& rig, PatternChannel a, PatternChannel b);

/// What a camera ray meets.
struct SurfaceHit {
  Vec3 point = Vec3::Zero();   ///< world, mm
  Vec3 normal = Vec3::Zero();  ///< unit normal of the facet, towards the camera
  double distance = 0;         ///< mm along the ray
  double cos_camera = 0;       ///< cosine of the incidence to the camera, > 0
};

/// How a projector lights a surface point.
struct Lighting {
  Vec2 pixel = Vec2::Zero();  ///< of the projector
  double cos_projector = 0;   ///< cosine of the incidence to the projector, > 0
};

/// The true surface under a rig's devices, ray traced: the oracle of all line figures. The surface
/// is that of the facets themselves. A point is lit by a projector when the segment to it is free,
/// the facet faces it and the point projects into its panel. Immutable, queries are thread safe.
class TruthScene {
 public:
  /// The mesh is in the rig's world frame. Closed parts of it that point inwards are turned, and
  /// vertices without faces left out.
  TruthScene(const TriangleMesh& mesh, const Rig& rig);

  [[nodiscard]] const Rig& rig() const { return rig_; }
  [[nodiscard]] const RayScene& scene() const { return scene_; }
  [[nodiscard]] const Vec3& normal(std::size_t face) const { return normals_[face]; }
  /// Of a part that is not closed, or whose faces do not agree: it is seen from both sides.
  [[nodiscard]] bool is_two_sided(std::size_t face) const { return two_sided_[face] != 0; }
  [[nodiscard]] double diameter_mm() const { return diameter_mm_; }
  /// Distance that keeps a segment's ends off the surface they lie on, mm.
  [[nodiscard]] double margin_mm() const { return 2e-4 * diameter_mm_; }

  /// First surface point on the ray of a camera pixel.
  [[nodiscard]] std::optional<SurfaceHit> hit(int camera, const Vec2& pixel) const;
  /// Lighting of a surface point with the given normal, without the shadow test.
  [[nodiscard]] std::optional<Lighting> facing(int projector, const Vec3& point,
                                               const Vec3& normal) const;
  /// Lighting of a surface point with the given normal; nothing in the dark.
  [[nodiscard]] std::optional<Lighting> lighting(int projector, const Vec3& point,
                                                 const Vec3& normal) const;
  /// Continuous line coordinate at a projector pixel; nothing beyond the first and last line by
  /// more than half a pitch.
  [[nodiscard]] std::optional<double> line_coordinate(PatternChannel channel,
                                                      const Vec2& projector_pixel) const;
  /// Gradient of the line coordinate over the camera image (lines per pixel) on the tangent plane
  /// of the hit: its norm is 1 / (image spacing of the lines).
  [[nodiscard]] Vec2 line_gradient(int camera, PatternChannel channel, const Vec2& pixel,
                                   const SurfaceHit& hit) const;

 private:
  Rig rig_;
  RayScene scene_;
  std::vector<Vec3> normals_;            ///< per face
  std::vector<char> two_sided_;          ///< per face
  std::vector<Vec3> projector_centers_;  ///< world, mm
  double diameter_mm_ = 0;               ///< diagonal of the bounding box
};

/// All that the figures need to know about one channel at one camera pixel.
struct LineSample {
  SurfaceHit hit;
  Lighting light;
  double coordinate = 0;         ///< continuous line coordinate
  Vec2 gradient = Vec2::Zero();  ///< lines per camera pixel
};

/// Traces one pixel for one channel; nothing when nothing is hit or the hit is dark.
[[nodiscard]] std::optional<LineSample> sample_line(const TruthScene& truth, int camera,
                                                    PatternChannel channel, const Vec2& pixel);

}  // namespace pencilscan
