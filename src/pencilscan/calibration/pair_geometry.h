#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "pencilscan/calibration/pair_fit.h"
#include "pencilscan/calibration/tracks.h"

namespace pencilscan {

/// How a camera and a projector see each other through their correspondences of all captures,
/// before anything is calibrated.
struct PairGeometry {
  std::size_t camera = 0;     ///< device
  std::size_t projector = 0;  ///< device
  std::size_t matches = 0;
  std::size_t inliers = 0;          ///< agree with one fundamental matrix
  double planar_share = 0;          ///< of the inliers that one homography explains as well
  Mat3 fundamental = Mat3::Zero();  ///< x_projector' F x_camera = 0; pixels
  [[nodiscard]] double inlier_share() const {
    return matches == 0 ? 0 : static_cast<double>(inliers) / static_cast<double>(matches);
  }
};

struct PairGeometryOptions {
  double tolerance = 0.003;  ///< distance to the epipolar line over the image width: lenses bend it
  std::size_t least_matches = 24;
  /// A homography that misses by less than this share of the width explains a match, too.
  double planar_tolerance = 0.0015;
};

/// RANSAC of the fundamental matrix (seven points; Hartley and Zisserman, "Multiple View Geometry",
/// alg. 11.4) for every pair. Where a plane explains most matches, any epipole suits these: then
/// also that of the plane's homography and of two matches off it (Chum, Werner and Matas, "Two-view
/// geometry estimation unaffected by a dominant plane", 2005), if more matches agree with it.
[[nodiscard]] std::vector<PairGeometry> pair_geometries(const Rig& rig,
                                                        std::span<const Track> tracks,
                                                        const PairGeometryOptions& options = {});

/// Drops the views that disagree with their pair's fundamental matrix, and with the rig where there
/// is one already, and tracks left with one view. Pairs without a trusted matrix (fewer inliers
/// than least_share) lose all views.
void drop_epipolar_outliers(const Rig& rig, std::span<const PairGeometry> pairs, double least_share,
                            std::vector<Track>& tracks, const PairFit* fit = nullptr,
                            const PairGeometryOptions& options = {});

/// Inner parameters guessed from the fundamental matrices alone.
struct FocalGuess {
  double camera_scale = 0;  ///< focal length / width of cameras without a known one
  double projector_scale = 0;
  double lens_shift = 0;  ///< principal point of projectors below the centre / height
  double cost = 0;
};
/// Guesses, the most plausible first. An essential matrix has two equal singular values: the cost
/// is the mean of how unequal those of K_p' F K_c are (Mendonca and Cipolla, "A simple technique
/// for self-calibration", 1999), over a grid of shared values, plus how unusual these are.
/// `known[d]`: the device's K is given and stays.
[[nodiscard]] std::vector<FocalGuess> guess_focal_lengths(const Rig& rig,
                                                          std::span<const PairGeometry> pairs,
                                                          const std::vector<char>& known);
/// The rig with K of the unknown devices as guessed.
[[nodiscard]] Rig rig_with_guess(const Rig& rig, const FocalGuess& guess,
                                 const std::vector<char>& known);

}  // namespace pencilscan
