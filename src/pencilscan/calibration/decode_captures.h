#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/boards/board.h"
#include "pencilscan/calibration/calibration_report.h"
#include "pencilscan/calibration/finding.h"

namespace pencilscan {

/// What the pictures of Gray-code captures say, before anything is solved for.
struct DecodedCaptures {
  std::vector<DecodeSummary> pairs;  ///< of a camera and a projector, by capture
  std::vector<Track> tracks;         ///< of pairs in the right order
  ColorCalibration color;            ///< the same
  std::vector<BoardView> board_views;
  std::vector<BoardView> projected_corners;
  std::vector<Finding> findings;  ///< wrong orders of images, copies, boards unlike described
};

/// Decodes captures, one folder per pose of the object. `board` as board_from_text() reads it;
/// empty: none. Captures that are copies of one before are left out and named. InputError for
/// folders that do not fit the devices, and for one that is named twice.
[[nodiscard]] DecodedCaptures decode_captures(const Rig& rig,
                                              const std::vector<std::filesystem::path>& folders,
                                              const std::string& board, std::size_t max_tracks,
                                              const Progress& progress = {});

}  // namespace pencilscan
