#pragma once

#include <numbers>
#include <string>
#include <vector>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A ring of cameras and projectors in turn that look at the origin, world z up: the arrangement of
/// the paper (Section 5), with the projectors of horizontal lines raised, because at the cameras'
/// own height the planes of their lines hold the camera centres and give no depth.
struct RingOptions {
  int cameras = 6;                               ///< >= 1
  int projectors = 6;                            ///< >= 1
  double distance_mm = 1100;                     ///< of every device to the origin, > volume radius
  double arc_rad = 2 * std::numbers::pi;         ///< in (0, 2 pi]: how much of the circle is used
  double camera_elevation_rad = 0.262;           ///< 15 degrees
  double vertical_elevation_rad = 0.140;         ///< 8 degrees: projectors of vertical lines
  double horizontal_elevation_rad = 0.593;       ///< 34 degrees: projectors of horizontal lines
  double volume_radius_mm = 170;                 ///< > 0
  int camera_width = 1280, camera_height = 960;  ///< px
  double camera_focal_px = 2300;                 ///< > 0
  int projector_width = 1280, projector_height = 1024;
  double projector_focal_px = 2430;
  double pitch_px = 12;      ///< > 0
  double line_width_px = 4;  ///< in (0, pitch_px]
  double offset_px = 6;      ///< of line 0
  int order = 3;             ///< of the code, >= 1; nothing to a pattern of one colour

  // What differs from projector to projector: projector i has entry i mod size, none may be empty.
  std::vector<Axis> axes{Axis::kColumn, Axis::kRow};  ///< vertical and horizontal lines
  std::vector<std::vector<PatternColor>> colors{{"blue", "cyan"}, {"red", "yellow"}};
  std::vector<double> rolls_rad{0};  ///< about its optical axis: its lines are tilted by so much
};

/// Cameras cam0, cam1, ... and projectors proj0, proj1, ..., each with one pattern. Azimuths grow
/// from x towards y: from cam0 at 0 all around, projectors half a step of theirs further, or
/// over an arc with 0 in its middle. The volume's centre is the origin. InputError for an option
/// out of its range.
[[nodiscard]] Rig make_ring(const RingOptions& options = {});

}  // namespace pencilscan
