#pragma once

#include <span>
#include <string>
#include <vector>

#include "pencilscan/refinement/correction.h"
#include "pencilscan/refinement/crossing_tracks.h"

namespace pencilscan {

/// Poses of all devices from the crossings of labelled lines, by bundle adjustment.
///
/// Minimised over the corrections of all devices and the points X of all tracks:
///   sum over tracks  rho( sum over sightings |W (pi_c(X) - u)|^2
///                         + sum over its two lines ((pi_p(X)_axis - coordinate) / sigma_line)^2 )
///   + sum over devices |rotation_px|^2 / sigma_rotation^2 + |translation_mm|^2 /
///   sigma_translation^2
/// with exact projections pi, lens distortion included. A track seen by k cameras gives 2k + 2
/// equations for three unknowns. Points are eliminated (variable projection, Golub and Pereyra
/// 1973): each is solved for within its own residual. rho is Cauchy's loss, its scale that of the
/// residuals as found, so that wrong labels lose their say as the others come to agree. The last
/// sums say how well devices were calibrated; they also choose, among the motions and scales of the
/// whole rig that no picture can tell apart, the one that moves the devices least. Once the tracks
/// have settled, they say how large calibration errors are (likely_prior_scale), and settle again.
struct RefineRigOptions {
  /// Largest expected calibration error per axis, at the image centre; > 0.
  double rotation_sigma_px = 1;
  /// Likewise of the translation, as the shift of the volume's centre in the image; > 0. At 1.1 m
  /// and f = 2300 px, 1 px is 0.48 mm.
  double translation_sigma_px = 1;
  /// Devices that moved after the calibration (find_moved_devices), cameras, then projectors: both
  /// deviations are kMovedFarther times as wide for them, so that others do not share what they
  /// did.
  std::vector<std::size_t> moved;
  double line_sigma_px = 0.05;  ///< of a projected line's coordinate, projector px; > 0
  double loss_scale = 3;        ///< of Cauchy's loss, in deviations of the residuals as found; > 0
  int max_stages = 5;           ///< the deviation is found anew before each
  /// Errors of neighbouring crossings are alike: their information counts as if there were so many
  /// times fewer; >= 1.
  double correlated_crossings = 4;
  int min_tracks = 30;         ///< of a device; with fewer it keeps its pose
  double min_redundancy = 3;   ///< equations left over after the points, per pose parameter
  double max_remaining = 0.5;  ///< share of the expected error of lines that may stay undetermined
  std::size_t max_tracks = 20000;  ///< an even subset of the tracks is used
  int max_iterations = 30;
};

inline constexpr double kMovedFarther = 10;  ///< than calibrations err

struct DeviceRefinement {
  std::string name;
  std::size_t tracks = 0;
  bool refined = false;    ///< false: too few tracks, pose kept
  double rotation_px = 0;  ///< how far it moved
  double translation_mm = 0;
  double translation_px = 0;  ///< the same as shift of the volume's centre in the image, at most
};

struct RefineRigReport {
  bool refined = false;
  std::string reason;  ///< why not, in plain words
  std::size_t tracks = 0;
  std::size_t sightings = 0;
  CrossingDisagreement before;
  CrossingDisagreement after;
  /// Expected error of the line coordinate at the crossings, projector px (root mean square): from
  /// the calibration as given, and what of it the crossings leave undetermined.
  double expected_error_px = 0;
  double remaining_error_px = 0;
  double residual_scale = 0;  ///< median deviation of the residuals over the predicted one; ideal 1
  std::vector<DeviceRefinement> devices;  ///< cameras, then projectors
};

struct RefineRigResult {
  RigCorrection correction;  ///< to the calibrated rig; all zero where it was not refined
  RefineRigReport report;
};

/// `start` is empty or a correction found earlier; tracks hold points of the rig with it.
[[nodiscard]] RefineRigResult refine_rig(const Rig& calibrated,
                                         std::span<const CrossingTrack> tracks,
                                         const RigCorrection& start = {},
                                         const RefineRigOptions& options = {});

}  // namespace pencilscan
