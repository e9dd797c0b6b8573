#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// What a rig can measure, computed by sampling: points on concentric spheres in the working volume
/// with their outward normals stand for surfaces of every place and direction. (No occlusion but
/// the sphere's own: this judges the rig, not an object.)
///
/// **Depth sensitivity** of a camera-projector pair at a point at camera depth z and projector
/// depth z_p: with the projector coordinate c across the lines, s = |dc / dz| z_p / f_p, near the
/// devices' axes. It is the sine of the triangulation angle times the sine of the angle between
/// line and epipolar line: 0 means that moving along the camera ray stays on the same line, so the
/// line says nothing about depth.
///
/// **Skewness** of two pencils of planes. The planes of a projector's lines share an axis through
/// its centre, parallel to the lines. With axes c + t d, the volume's centre at mean distance D,
/// skewness = |(c_2 - c_1) . (d_1 x d_2)| / D: 0 for axes in one plane. Then that plane belongs to
/// both pencils, v_0 = h_0 can be chosen, and equation (6) of the paper keeps a null space of
/// dimension one whatever is observed, as for a grid from a single projector.
///
/// **Told apart.** The lines of a family that look alike are a period of its code apart. To take
/// one for another moves a point by the depth of that period, and the lines of another family that
/// cross there by so many of theirs. From half a line on, another line is nearer than its own, and
/// the crossing says which of the alike is right. Lines that hardly move with depth can tell those
/// of others apart all the same.
///
/// **Same-colour ambiguity**: two line sets that share a colour cross at a small angle in an image,
/// where a curve cannot be assigned to one of them by its direction.
struct RigCheckOptions {
  int points_per_sphere = 400;                       ///< >= 1
  std::vector<double> spheres = {0.35, 0.65, 0.95};  ///< radii, in radii of the volume
  double min_camera_cosine = 0.3;                    ///< visible when cos(incidence) is above
  double min_projector_cosine = 0.25;                ///< lit when cos(incidence) is above
  double min_sensitivity = 0.25;                     ///< usable when s is above
  double min_spacing_px = 3;        ///< usable when lines are this far apart in the image
  double min_crossing_rad = 0.384;  ///< 22 degrees: line sets are told apart above
  double min_skewness = 0.05;       ///< axes count as coplanar below
};

/// One pattern of one projector.
struct LineFamily {
  std::size_t projector = 0;
  std::size_t pattern = 0;
};

/// Camera and line family over the samples that both reach ("shared").
struct PairCheck {
  std::size_t camera = 0;
  LineFamily family;
  std::size_t shared = 0;         ///< samples seen by the camera and lit by the lines
  double usable_share = 0;        ///< of `shared`: enough sensitivity and spacing
  double sensitive_share = 0;     ///< of `shared`: enough sensitivity
  double sensitivity_median = 0;  ///< s
  double px_per_mm_median = 0;    ///< projector px per mm of camera depth
  double spacing_median_px = 0;   ///< of neighbouring lines in the image
};

/// Two line families: the axes of their pencils and how they meet in the images.
struct AxesCheck {
  LineFamily first, second;
  double angle_rad = 0;    ///< between the axes, 0..pi/2
  double distance_mm = 0;  ///< between the axes
  double skewness = 0;
  bool same_color = false;    ///< some colour is in both
  std::size_t shared = 0;     ///< (camera, sample) that show both
  double crossing_share = 0;  ///< of `shared`: wide crossings where each tells the other's apart
  double parallel_share = 0;  ///< of `shared`: crossing at less than min_crossing_rad
};

/// Shares of all samples, 0..1.
struct CoverageCheck {
  double seen = 0;          ///< by >= 1 camera
  double lit = 0;           ///< by >= 1 line family
  double seen_and_lit = 0;  ///< by some pair
  double usable = 0;        ///< by some pair with enough sensitivity and spacing
  double grid = 0;  ///< some camera sees families of two projectors cross and tell each other apart
  double skew_grid = 0;  ///< the same with axes that are not coplanar (equation (6))
  double two_views = 0;  ///< two cameras see the same usable family
  double ambiguous = 0;  ///< of (camera, sample) with light: some same-colour ambiguity
};

struct RigWarning {
  bool severe = false;  ///< this rig cannot work well like that
  std::string kind;     ///< "no_depth", "coplanar_axes", ...: stable, for programs
  std::string text;     ///< what is wrong and what to do, one line
};

struct RigCheck {
  Sphere volume;
  std::size_t samples = 0;
  std::vector<double> camera_view_share;     ///< of all samples inside the image, per camera
  std::vector<double> projector_view_share;  ///< likewise, per projector
  std::vector<PairCheck> pairs;
  std::vector<AxesCheck> axes;
  CoverageCheck coverage;
  std::vector<RigWarning> warnings;  ///< severe ones first
};

/// Every camera but those for texture, every line family, and every two of these families, over
/// options.points_per_sphere points on each of options.spheres. Poses and volume in mm.
[[nodiscard]] RigCheck check_rig(const Rig& rig, const RigCheckOptions& options = {});

/// The warnings for finished figures, severe ones first.
[[nodiscard]] std::vector<RigWarning> rig_warnings(const Rig& rig, const RigCheck& check,
                                                   const RigCheckOptions& options);

}  // namespace pencilscan
