#include "pencilscan/calibration/mirrored.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "pencilscan/calibration/calibrate_once.h"
#include "pencilscan/calibration/pair_fit.h"
#include "pencilscan/calibration/suspects.h"
#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {
namespace {

constexpr double kExplainedPx = 1;  ///< off the epipolar plane, whatever the result's own errors
// Of correspondences that are not explained. Wrong codes are a few of a hundred; a mirrored device
// of twelve leaves a fourteenth of all and a quarter of its own, where its focal length is free.
constexpr double kMuchOfAll = 0.2;
constexpr double kMuchOfOne = 0.1;

/// Whether most pairs make sense by themselves, as mirrored pictures do and wrong codes do not.
bool are_pairs_sensible(const CalibrationResult& result) {
  constexpr double kSensible = 0.8;
  const auto sensible =
      std::count_if(result.pairs.begin(), result.pairs.end(),
                    [](const PairGeometry& pair) { return pair.inlier_share() > kSensible; });
  return 2 * static_cast<std::size_t>(sensible) > result.pairs.size();
}

double inlier_share(const CalibrationResult& result, const DevicePair& pair) {
  for (const PairGeometry& geometry : result.pairs)
    if (geometry.camera == pair.first && geometry.projector == pair.second)
      return geometry.inlier_share();
  return 1;
}

/// How many correspondences the result explains, of those that a device takes part in and that
/// their pair explains by itself: wrong codes and moves leave these out, mirrored pictures do not.
struct Explained {
  std::vector<double> of_device;  ///< shares
  double of_all = 0;
};

Explained explained(const CalibrationInput& input, const std::vector<Track>& tracks,
                    const CalibrationResult& result) {
  const std::size_t devices = device_count(input.rig);
  std::vector<double> good(devices, 0);
  std::vector<double> all(devices, 0);
  double good_sum = 0;
  double sum = 0;
  const PairFit fit(result.problem.devices, kExplainedPx);
  for (const auto& [pair, matches] : matches_by_pair(tracks)) {
    const auto count = static_cast<double>(matches.size());
    const bool is_placed = result.solved && fit.placed(pair.first) && fit.placed(pair.second);
    const double by_rig = is_placed ? fit.share(matches, pair.first, pair.second) : 0;
    const double by_pair = inlier_share(result, pair);
    const double share = by_rig < by_pair ? by_rig / by_pair : 1;
    for (const std::size_t d : {pair.first, pair.second}) {
      good[d] += share * count;
      all[d] += count;
    }
    good_sum += share * count;
    sum += count;
  }
  Explained shares;
  for (std::size_t d = 0; d < devices; ++d)
    shares.of_device.push_back(all[d] > 0 ? good[d] / all[d] : 1);
  shares.of_all = sum > 0 ? good_sum / sum : 1;
  return shares;
}

CalibrationInput mirrored(CalibrationInput input, const std::vector<std::size_t>& devices) {
  const auto is_one = [&](std::size_t d) {
    return std::find(devices.begin(), devices.end(), d) != devices.end();
  };
  for (Track& track : input.tracks) {
    for (TrackView& view : track.views) {
      if (is_one(view.device))
        view.pixel.x() = device_at(input.rig, view.device).width - 1 - view.pixel.x();
    }
  }
  for (auto* views : {&input.board_views, &input.projected_corners}) {
    for (BoardView& corner : *views) {
      if (is_one(corner.view.device))
        corner.view.pixel.x() =
            device_at(input.rig, corner.view.device).width - 1 - corner.view.pixel.x();
    }
  }
  return input;
}

/// Devices of which much is not explained, the worst first. Where that is so of the whole: all
/// cameras together after the first of them.
std::vector<std::vector<std::size_t>> suspects(const Rig& rig, const Explained& before) {
  std::vector<std::size_t> order(device_count(rig));
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return before.of_device[a] < before.of_device[b];
  });
  std::vector<std::vector<std::size_t>> result;
  const bool is_much_of_all = 1 - before.of_all >= kMuchOfAll;
  for (const std::size_t d : order) {
    if (1 - before.of_device[d] < kMuchOfOne) break;
    result.push_back({d});
    if (!is_much_of_all || result.size() > 1 || rig.cameras.size() == 1) continue;
    result.emplace_back(rig.cameras.size());
    std::iota(result.back().begin(), result.back().end(), std::size_t{0});
  }
  return result;
}

}  // namespace

std::optional<Mirroring> find_mirrored(const CalibrationInput& input,
                                       const CalibrationResult& result,
                                       const CalibrateOptions& options, const Progress& progress) {
  constexpr double kExplains = 0.5;  // of what was not, where the suspicion is right
  constexpr std::size_t kTracks = 1500;
  // Two devices see a mirrored object as well.
  if (device_count(input.rig) < 3 || !are_pairs_sensible(result)) return std::nullopt;
  std::vector<Track> tracks = input.tracks;
  Explained before = explained(input, tracks, result);
  if (suspects(input.rig, before).empty()) return std::nullopt;
  if (const auto swapped = find_contradictions(input, result).swapped; !swapped.empty()) {
    tracks = without_pairs(tracks, swapped);
    before = explained(input, tracks, result);
  }
  CalibrationInput some = input;
  some.tracks = evenly_picked(tracks, kTracks);
  const auto trials = suspects(input.rig, before);
  for (std::size_t i = 0; i < trials.size(); ++i) {
    if (progress)
      progress("looking for mirrored pictures",
               static_cast<double>(i) / static_cast<double>(trials.size()));
    const CalibrationInput changed = mirrored(some, trials[i]);
    const CalibrationResult again = calibrate_once(changed, options, {});
    if (!again.solved) continue;
    const Explained after = explained(changed, changed.tracks, again);
    const bool is_better = 1 - after.of_all < (1 - kExplains) * (1 - before.of_all);
    const bool fits = std::all_of(trials[i].begin(), trials[i].end(), [&](std::size_t d) {
      return 1 - after.of_device[d] < kMuchOfOne;
    });
    if (!is_better || !fits) continue;
    return Mirroring{trials[i], before.of_all, after.of_all};
  }
  return std::nullopt;
}

Finding mirrored_finding(const Rig& rig, const Mirroring& mirrored) {
  const std::size_t first = mirrored.devices.front();
  const std::string who =
      mirrored.devices.size() > 1
          ? "the pictures of all cameras, or of all projectors, are mirrored"
      : first < rig.cameras.size()
          ? "the pictures of camera " + device_at(rig, first).name + " are mirrored"
          : "projector " + device_at(rig, first).name + " mirrors its picture";
  return {Grade::kUnusable,
          who + ": the other way round, " + std::to_string(std::lround(100 * mirrored.other_way)) +
              " % of the correspondences fit one rig, as they are " +
              std::to_string(std::lround(100 * mirrored.as_they_are)) + " %",
          "switch off mirroring (of a camera in its driver, of a projector in its menu: "
          "ceiling and rear projection), and take the captures again"};
}

}  // namespace pencilscan
