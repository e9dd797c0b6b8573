#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "pencilscan/pipeline/run_folder.h"

namespace pencilscan {

inline constexpr double kUnknownFigure = std::numeric_limits<double>::quiet_NaN();

/// What one frame's report says of a camera. Figures may be kUnknownFigure.
struct CameraRow {
  double labelled_share = kUnknownFigure;  ///< of its curve points
  double labelled_points = kUnknownFigure;
  double shift_x_px = kUnknownFigure;  ///< with which its crossings meet best: it was turned
  double shift_y_px = kUnknownFigure;
  double line_width_px = kUnknownFigure;    ///< standard deviation of the lines' profiles
  double line_height = kUnknownFigure;      ///< of the lines above their surroundings, linear light
  std::vector<double> height_of_projector;  ///< the same of the lines of each projector
  double image_level = kUnknownFigure;      ///< mean of its picture, in [0, 1]
  double saturated_pixels = kUnknownFigure;
  double time_offset_us = kUnknownFigure;
  bool is_late = false;
  std::uint64_t picture = 0;  ///< hash of its picture's bytes; 0: not known
};

/// What a frame's report says in words.
struct FindingRow {
  std::string code;  ///< of WarningCode
  std::string device;
  std::string text;
};

/// What one frame's folder says.
struct FrameRow {
  std::string name;
  FrameStatus status;
  double points = kUnknownFigure;
  double labelled_share = kUnknownFigure;        ///< of the curve points of all cameras
  double crossing_px = kUnknownFigure;           ///< median disagreement of crossings
  double crossing_expected_px = kUnknownFigure;  ///< that noise explains
  double measured_share = kUnknownFigure;        ///< of the closed mesh
  double line_width_px = kUnknownFigure;         ///< median of the cameras
  double line_height = kUnknownFigure;           ///< the same
  double saturated_pixels = kUnknownFigure;      ///< sum of the cameras
  double time_spread_us = kUnknownFigure;
  double motion_mm = kUnknownFigure;  ///< way within the exposure; 0: none was seen
  std::vector<CameraRow> cameras;
  std::vector<double> device_crossing_px;           ///< cameras, then projectors
  std::vector<double> device_crossing_expected_px;  ///< that noise explains
  /// How bright lines are in each camera and of each projector, over what they are in the middle of
  /// the sequence (device_light.h).
  std::vector<double> device_light;
  std::vector<double> projector_points;
  std::vector<double> projector_height;  ///< of its lines, the median of the cameras
  std::vector<std::string> warnings;
  std::vector<FindingRow> findings;
};

/// Names of what a sequence was taken with.
struct SequenceDevices {
  std::vector<std::string> cameras;
  std::vector<std::string> projectors;
};

/// The rows of all frames that `out`/inputs.json names.
[[nodiscard]] std::vector<FrameRow> read_frame_rows(const std::filesystem::path& out,
                                                    const RunInputs& inputs,
                                                    const SequenceDevices& devices);

}  // namespace pencilscan
