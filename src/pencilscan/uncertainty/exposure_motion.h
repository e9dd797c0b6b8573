#pragma once

#include <span>
#include <vector>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

// What moves while the shutters are open blurs its lines. A projected line stays on its sheet of
// light; where the surface goes through the sheet by d along its normal, the line goes over the
// picture by g d, g (px per length) being how far the line coordinate at a fixed pixel changes with
// the surface's place along its normal, over the coordinate's slope in the picture. What goes along
// its own surface changes nothing. At even speed the profile is convolved with a box of length g d,
// which adds (g d)^2 / 12 to its variance and leaves its middle where half of the exposure has the
// line.
//
// The whole object moves rigidly: d = n . (s + w x (X - p)), with the normal n at X, shift s and
// turn w about p. What cameras, projectors and surface blur by themselves is a baseline, linear in
// unknowns that have nothing of the direction of normals: per camera a constant and a slope in
// depth (lens, its defocus), per projector the same times the squared px per line, and shared ones
// of the line spacing (two powers), the cosines of incidence, g^2 (relief within a window moves
// lines whichever way it faces), and the cosine of four times the lines' direction: a pixel is a
// square, whose fourth cumulant along a direction t is -(3 + cos 4t) / 480, and a Gaussian takes it
// for variance. So the variances of all lines give s s', s w' and w w': the sign
// of the motion stays unknown.

/// How blurred the lines of one pattern are around one place of the surface. Lengths: any unit.
struct LineBlur {
  int camera = 0;
  int projector = 0;
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();  ///< unit
  double direction = 0;         ///< across the lines in the picture, rad from a row
  double px_per_line = 1;       ///< their spacing there
  double px_per_length = 0;     ///< g
  double camera_cosine = 1;     ///< of the incidence
  double projector_cosine = 1;  ///< likewise
  double camera_depth = 1;      ///< along its axis
  double projector_depth = 1;   ///< likewise
  double variance_px2 = 0;      ///< of the blur across the lines
  double deviation_px2 = 1;     ///< of that number, > 0
  double overlap = 1;  ///< >= 1: so many lines of its camera see the same pixel and count as one
};

/// The rigid motion of the object from the beginning of an exposure to its end.
struct ExposureMotion {
  bool is_judged = false;     ///< enough lines, cameras and projectors; else nothing is known
  bool is_seen = false;       ///< beyond doubt; else shift and turn are zero, `way` says nothing
  Vec3 shift = Vec3::Zero();  ///< up to its sign, that of `turn` alike
  Vec3 turn = Vec3::Zero();   ///< axis times angle, rad
  Vec3 pivot = Vec3::Zero();  ///< what `shift` is the way of
  double way = 0;             ///< length that the places go, root of the mean square
  double way_deviation = 0;   ///< of it
  double at_most = 0;         ///< what it may have gone, two deviations up

  /// Where a point goes.
  [[nodiscard]] Vec3 way_of(const Vec3& point) const { return shift + turn.cross(point - pivot); }
};

/// Robust least squares over the lines' variances. `unknown_px2`: variance that pictures may have
/// along some of their directions beyond the baseline. `expected`, if given, becomes the variance
/// that the fit has at each place. Motion counts as seen where it makes the fit better than chance
/// does, is several deviations long by jackknives over pairs of camera and projector, over cameras
/// and over projectors, and adds more than a share of the blur itself, as which the baseline is not
/// believed. A turn is taken in where it is needed.
[[nodiscard]] ExposureMotion exposure_motion(std::span<const LineBlur> lines,
                                             double unknown_px2 = 0,
                                             std::vector<double>* expected = nullptr);

/// What motion adds to the deviation of a place that goes `way` within the exposure: along its
/// `normal`, or along a camera's `ray` (unit), where there is one.
[[nodiscard]] double motion_sigma(const Vec3& way, const Vec3& normal, const Vec3* ray);

}  // namespace pencilscan
