#include "pencilscan/calibration/scene_moves.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/triangulation.h"
#include "pencilscan/calibration/calibrate_once.h"
#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

constexpr std::size_t kFewest = 24;  ///< pixels: of them a median is known to a quarter

/// Depth on the hub's ray by one view, and what it is known to.
struct RayDepth {
  double depth = 0;
  double sigma = 0;
};

std::optional<RayDepth> depth_by(const CalibrationResult& result, const TrackView& hub,
                                 const TrackView& view) {
  const BundleProblem& problem = result.problem;
  const Track pair{{hub, view}};
  const auto point = triangulate(problem, pair, kLeastAngle);
  if (!point) return std::nullopt;
  const Vec3 center = center_of(problem.devices[hub.device]);
  const double depth = (*point - center).norm();
  const double step = 1e-4 * depth;  // far above rounding, far below what bends the way
  const auto here = view_error(problem.devices[view.device], *point, view);
  const auto there =
      view_error(problem.devices[view.device], *point + step / depth * (*point - center), view);
  if (!here || !there) return std::nullopt;
  const double px_per_length = (*there - *here).norm() / step;
  return RayDepth{depth,
                  std::hypot(view.sigma_px, result.adjustment.extra_sigma_px) / px_per_length};
}

/// Camera pixels' rays that two projectors' codes give a depth each, and projector pixels' rays
/// that two cameras do.
struct SceneShifts {
  std::vector<SceneMove> pairs;  ///< of projectors, per capture
  /// What two cameras differ by, over what single views let expect, median: their pictures of a
  /// projector were taken at once.
  double usual_deviations = 0;
};

SceneShifts scene_shifts(const CalibrationResult& result, const std::vector<Track>& tracks) {
  const BundleProblem& problem = result.problem;
  using CaptureAndPair = std::tuple<std::size_t, std::size_t, std::size_t>;
  struct Apart {
    std::vector<double> shifts;
    std::vector<double> deviations;
  };
  std::map<CaptureAndPair, Apart> apart;
  std::vector<double> usual;
  for (const Track& track : tracks) {
    const TrackView& hub = track.views[0];
    if (!problem.devices[hub.device].present) continue;
    std::vector<std::pair<std::size_t, RayDepth>> depths;
    for (std::size_t i = 1; i < track.views.size(); ++i)
      if (const auto depth = depth_by(result, hub, track.views[i]))
        depths.emplace_back(track.views[i].device, *depth);
    for (std::size_t i = 0; i < depths.size(); ++i) {
      for (std::size_t j = i + 1; j < depths.size(); ++j) {
        const double shift = std::abs(depths[i].second.depth - depths[j].second.depth);
        const double deviations =
            shift / std::hypot(depths[i].second.sigma, depths[j].second.sigma);
        if (hub.device >= result.rig.cameras.size()) {
          usual.push_back(deviations);
          continue;
        }
        Apart& pair = apart[{track.capture, std::min(depths[i].first, depths[j].first),
                             std::max(depths[i].first, depths[j].first)}];
        pair.shifts.push_back(shift);
        pair.deviations.push_back(deviations);
      }
    }
  }
  SceneShifts all;
  if (usual.size() < kFewest) return all;
  all.usual_deviations = upper_median(std::move(usual));
  for (auto& [key, pair] : apart) {
    if (pair.shifts.size() < kFewest) continue;
    const auto [capture, a, b] = key;
    all.pairs.push_back({capture, a, b, upper_median(std::move(pair.shifts)),
                         upper_median(std::move(pair.deviations))});
  }
  return all;
}

/// Of each capture the two projectors that lie most apart, by so many times what is usual.
std::vector<SceneMove> most_apart(const SceneShifts& shifts, double times) {
  std::map<std::size_t, SceneMove> most;
  for (const SceneMove& pair : shifts.pairs) {
    if (pair.deviations <= times * shifts.usual_deviations) continue;
    SceneMove& of_capture = most[pair.capture];
    if (pair.deviations > of_capture.deviations) of_capture = pair;
  }
  std::vector<SceneMove> moves;
  for (const auto& [capture, pair] : most) moves.push_back(pair);
  return moves;
}

/// Tracks each of which holds what was seen of one projector alone.
std::vector<Track> apart_by_projector(const std::vector<Track>& tracks, std::size_t cameras) {
  std::vector<Track> apart;
  for (const Track& track : tracks) {
    if (track.views[0].device >= cameras) {
      apart.push_back(track);
      continue;
    }
    for (std::size_t i = 1; i < track.views.size(); ++i)
      apart.push_back({{track.views[0], track.views[i]}, track.capture});
  }
  return apart;
}

}  // namespace

std::vector<SceneMove> moved_within_captures(const CalibrationInput& input,
                                             const CalibrationResult& result,
                                             const CalibrateOptions& options) {
  constexpr double kDoubtedTimes = 1.2;  // at rest .6: what joins projectors was fitted
  constexpr double kMovedTimes = 4;      // at rest 1.2 at most; moved by half a millimetre 7
  if (!result.solved || most_apart(scene_shifts(result, input.tracks), kDoubtedTimes).empty())
    return {};
  CalibrationInput rest = input;
  rest.tracks = apart_by_projector(input.tracks, input.rig.cameras.size());
  const CalibrationResult apart = calibrate_once(rest, options, {}, &result);
  if (present_devices(apart.problem) < present_devices(result.problem)) return {};
  return most_apart(scene_shifts(apart, input.tracks), kMovedTimes);
}

}  // namespace pencilscan
