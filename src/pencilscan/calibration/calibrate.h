#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pencilscan/bundle/bundle.h"
#include "pencilscan/bundle/priors.h"
#include "pencilscan/calibration/pair_geometry.h"
#include "pencilscan/core/progress.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Distance of the centres of two devices.
struct KnownDistance {
  std::size_t a = 0;  ///< device
  std::size_t b = 0;
  double mm = 0;  ///< > 0
};

struct CalibrationInput {
  Rig rig;  ///< names, sizes, patterns; K, distortion and poses where known
  std::vector<GivenCalibration> known;  ///< per device, cameras first
  std::vector<Track> tracks;            ///< of all captures
  std::optional<KnownDistance> distance;
  std::vector<BoardView> board_views;        ///< corners of a board; their mm give the scale
  std::vector<BoardView> projected_corners;  ///< the same of projectors, by what cameras see
  std::size_t boards = 0;                    ///< placings of the board
};

struct CalibrateOptions {
  std::size_t hypotheses = 5;        ///< guesses of unknown focal lengths that are tried, >= 1
  double least_inlier_share = 0.35;  ///< of a pair that is used at all
  double held_out_share = 0.1;       ///< of the tracks, kept to check, in [0, 0.5]
  double outlier_deviations = 4;     ///< views beyond are dropped
  std::size_t stage_tracks = 3000;   ///< of all stages but the last
  GivenTolerance tolerance{};        ///< of given inner parameters
};

/// What became of given inner parameters.
enum class GivenUse {
  kNone,         ///< none were given
  kTolerance,    ///< kept within their tolerance
  kExact,        ///< stated without a tolerance, and kept to the last digit
  kContradicted  ///< the data know better: they were a start only
};

/// Reprojection errors of one device's views, hubs left out, of used tracks.
struct DeviceResiduals {
  std::size_t views = 0;
  double rms_px = 0;
  double median_px = 0;
  double p95_px = 0;
};

/// The scene moved while a capture was taken: most between the pictures of two projectors.
struct SceneMove {
  std::size_t capture = 0;
  std::size_t a = 0;  ///< device: a projector
  std::size_t b = 0;
  double shift = 0;       ///< of surface along the cameras' rays, median, rig units
  double deviations = 0;  ///< the same over what single views let expect, median
};

/// Devices whose pictures are mirrored, and the shares of all correspondences that fit one rig.
struct Mirroring {
  std::vector<std::size_t> devices;  ///< one; or all cameras, which says the same of all projectors
  double as_they_are = 0;
  double other_way = 0;  ///< the devices' pictures turned round
};

struct CalibrationResult {
  Rig rig;                   ///< every placed device; see `placed`
  std::vector<char> placed;  ///< per device
  BundleProblem problem;     ///< at the solution, in the rig's frame and scale; tracks as used
  std::vector<Track> held_out;
  std::vector<PairGeometry> pairs;
  std::vector<GivenUse> given;  ///< per device: what became of its given inner parameters
  /// What the known distance or the board makes of millimetres that given poses contradict; the
  /// rig's volume and floor were multiplied by it.
  std::optional<double> given_times;
  /// What the known distance makes of the board's millimetres, which contradict it.
  std::optional<double> board_times;
  bool has_lost_volume = false;  ///< the stated one was of a frame that too few given poses tell
  bool has_lost_floor = false;
  GivenTolerance tolerance;  ///< of them
  BundleOptions adjustment;  ///< of the last stage
  double board_rms_px = 0;   ///< of the corners of boards; 0 without
  double rms_px = 0;         ///< over all views of used tracks but the hubs, which are exact
  double held_out_rms_px = 0;
  std::size_t views = 0;
  std::size_t views_dropped = 0;
  std::vector<DeviceResiduals> residuals;  ///< per device
  bool solved = false;
  std::optional<Mirroring> mirrored;   ///< then nothing else of the result counts
  std::vector<SceneMove> scene_moves;  ///< at most one per capture
};

/// From correspondences, and corners of boards if any, to a rig (calibrate_once.h). Where pairs
/// contradict it, once more without these, which counts if fewer then do (but for swapped folders);
/// where devices moved between captures, without what they saw of these. A device whose pictures
/// are mirrored ends the search (mirrored.h).
[[nodiscard]] CalibrationResult calibrate(const CalibrationInput& input,
                                          const CalibrateOptions& options = {},
                                          const Progress& progress = {});

}  // namespace pencilscan
