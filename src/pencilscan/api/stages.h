#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "pencilscan/api/reconstruct.h"

namespace pencilscan {

/// What the grid says of one curve before its line is known.
struct GridCurve {
  std::uint8_t camera = 0;
  std::uint32_t curve = 0;      ///< index within the camera, as in CurveSample
  std::int32_t component = -1;  ///< of the camera's grid graph; -1: nothing crosses it
  // With identities only:
  std::int16_t projector = -1;  ///< -1: not decided, as the next two
  std::int16_t pattern = -1;
  std::int32_t local_id = -1;  ///< line modulo the pattern's period
  float id_probability = 0;
};

/// The line of one curve point, as a method or the caller decides.
struct PointLabel {
  std::int16_t projector = -1;  ///< -1: none
  std::int16_t pattern = -1;
  std::int32_t line = -1;
  float confidence = 1;  ///< 0..1
  /// Line coordinate that is triangulated; NaN: that of the line.
  double plane = std::numeric_limits<double>::quiet_NaN();
};

/// One frame up to its grid graphs: curves without labels. A value; copies share their curves.
class DetectedFrame {
 public:
  /// Its state is `curves()[i].state` kUndecided everywhere.
  [[nodiscard]] const CurveFile& curves() const;
  /// One per curve, in the order of curves().
  [[nodiscard]] const std::vector<GridCurve>& grid() const;
  [[nodiscard]] const Rig& rig() const;

  /// Only detect() makes them.
  struct Inner;
  explicit DetectedFrame(std::shared_ptr<const Inner> inner);
  [[nodiscard]] const Inner& inner() const { return *inner_; }

 private:
  std::shared_ptr<const Inner> inner_;
};

/// Detection and grid. Of the options, plain pictures, frame, threads and progress count, and the
/// method: those that need identities (linear, multiview, single-projector) get them. `identities`:
/// in any case. The pictures are not used after the call.
[[nodiscard]] DetectedFrame detect(const Rig& rig, const Images& images,
                                   const ReconstructionOptions& options = {},
                                   bool identities = false);

/// The labels that options.method gives, one per sample of detected.curves(). What a method leaves
/// undecided, and guided matching would find, has none.
[[nodiscard]] std::vector<PointLabel> label(const DetectedFrame& detected,
                                            const ReconstructionOptions& options = {});

/// The rest of the way, from `labels`: one per sample of detected.curves(). Of options.method only
/// counts whether surfaces may confirm and complete the labels, and dense depth may follow (joint),
/// or not (the others). InputError for labels that name no line of the rig, StageError when no
/// point results.
[[nodiscard]] Reconstruction reconstruct(const DetectedFrame& detected,
                                         std::span<const PointLabel> labels,
                                         const ReconstructionOptions& options = {});

}  // namespace pencilscan
