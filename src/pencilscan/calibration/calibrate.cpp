#include "pencilscan/calibration/calibrate.h"

#include <algorithm>

#include "pencilscan/calibration/calibrate_once.h"
#include "pencilscan/calibration/mirrored.h"
#include "pencilscan/calibration/scene_moves.h"
#include "pencilscan/calibration/suspects.h"

namespace pencilscan {
namespace {

/// Without what some devices saw in some captures.
CalibrationInput without_moved(CalibrationInput input, const std::vector<CaptureMove>& moves) {
  input.tracks = without_moved(input.tracks, moves);
  for (auto* corners : {&input.board_views, &input.projected_corners})
    std::erase_if(*corners, [&](const BoardView& seen) {
      return has_moved(moves, seen.view.device, seen.board);
    });
  return input;
}

bool places_as_many(const CalibrationResult& as, const CalibrationResult& result) {
  return result.solved && present_devices(result.problem) >= present_devices(as.problem);
}

/// What contradicts may have drawn a device to a wrong place, from where right pairs contradict.
/// Without all of them the rig may tell which are wrong.
CalibrationResult solve_without_wrong_pairs(const CalibrationInput& input,
                                            const CalibrateOptions& options,
                                            const Progress& progress) {
  CalibrationResult first = calibrate_once(input, options, progress);
  const Contradictions contradictions = find_contradictions(input, first);
  if (contradictions.unexplained.empty()) return first;
  CalibrationInput rest = input;
  rest.tracks = without_pairs(input.tracks, contradictions.unexplained);
  if (rest.tracks.empty()) return first;
  CalibrationResult again = calibrate_once(rest, options, progress);
  if (!places_as_many(first, again)) return first;
  again.pairs = first.pairs;
  if (find_contradictions(input, again).unexplained.size() >= contradictions.unexplained.size())
    return first;
  return again;
}

}  // namespace

CalibrationResult calibrate(const CalibrationInput& input, const CalibrateOptions& options,
                            const Progress& progress) {
  constexpr int kMostMoves = 4;  // more is no rig
  CalibrationResult best = solve_without_wrong_pairs(input, options, progress);
  best.mirrored = find_mirrored(input, best, options, progress);
  if (best.mirrored) return best;
  // A device that moved between captures has several places. One capture of one device is left out
  // at a time; the rig that results counts where it shows clearly that all of these had moved.
  std::vector<CaptureMove> moved;
  Contradictions contradictions = find_contradictions(input, best);
  std::optional<CaptureMove> next = contradictions.moves.likeliest;
  while (next && moved.size() < kMostMoves) {
    moved.push_back(*next);
    const CalibrationInput rest = without_moved(input, moved);
    if (rest.tracks.empty()) break;
    CalibrationResult without = solve_without_wrong_pairs(rest, options, progress);
    if (!places_as_many(best, without)) break;
    without.pairs = best.pairs;
    Contradictions of_all = find_contradictions(input, without);
    next = find_contradictions(rest, without).moves.likeliest;
    const bool shows_all = std::all_of(moved.begin(), moved.end(), [&](const CaptureMove& m) {
      return has_moved(of_all.moves.clear, m.device, m.capture);
    });
    if (!shows_all) continue;
    best = std::move(without);
    contradictions = std::move(of_all);
  }
  // What explains a rig that contradicts itself explains this too.
  if (contradictions.findings.empty())
    best.scene_moves = moved_within_captures(input, best, options);
  return best;
}

}  // namespace pencilscan
