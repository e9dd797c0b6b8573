#pragma once

// What calibration takes in, for tests and benchmarks, made without images.

#include <utility>
#include <vector>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/sample_tracks.h"
#include "pencilscan/bundle/triangulation.h"
#include "pencilscan/calibration/calibrate.h"
#include "pencilscan/calibration/pair_matches.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/random.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan::sample {

/// What two pairs (camera, projector) saw, each taken as the other's.
inline std::vector<Track> with_exchanged(const std::vector<Track>& tracks, const DevicePair& a,
                                         const DevicePair& b) {
  std::vector<Track> mixed;
  for (const Track& track : tracks) {
    Track rest{{track.views[0]}, track.capture};
    for (std::size_t i = 1; i < track.views.size(); ++i) {
      const DevicePair pair = pair_of(track, track.views[i]);
      if (pair != a && pair != b) {
        rest.views.push_back(track.views[i]);
        continue;
      }
      const DevicePair& other = pair == a ? b : a;
      Track exchanged{{track.views[0], track.views[i]}, track.capture};
      for (TrackView& view : exchanged.views)
        view.device = view.device == pair.first ? other.first : other.second;
      mixed.push_back(exchanged);
    }
    if (rest.views.size() > 1) mixed.push_back(rest);
  }
  return mixed;
}

/// All devices of a rig, where it has them.
inline std::vector<BundleDevice> placed_devices(const Rig& rig) {
  std::vector<BundleDevice> devices;
  for (std::size_t d = 0; d < device_count(rig); ++d) {
    devices.push_back(bundle_device(device_at(rig, d)));
    devices.back().present = true;
  }
  return devices;
}

inline CalibrationInput input_of(const Rig& truth, std::vector<Track> tracks, bool cameras_known) {
  CalibrationInput input;
  input.rig = truth;
  input.known.resize(device_count(truth));
  for (std::size_t d = 0; d < input.known.size(); ++d) {
    Device& device = device_at(input.rig, d);
    const bool known = cameras_known && d < truth.cameras.size();
    input.known[d].K = input.known[d].distortion = known;
    device.device_from_world = {};
    if (known) continue;
    device.K = Mat3::Identity();
    device.distortion = {};
  }
  input.tracks = std::move(tracks);
  input.distance =
      KnownDistance{0, 1, (truth.cameras[0].center() - device_at(truth, 1).center()).norm()};
  return input;
}

/// Points in the volume, and where the found rig measures them, 3 x 100 each.
inline std::pair<Eigen::Matrix3Xd, Eigen::Matrix3Xd> points_of_both(const Rig& truth,
                                                                    const BundleProblem& found) {
  Random random(1);
  Eigen::Matrix3Xd a(3, 100);
  Eigen::Matrix3Xd b(3, 100);
  for (Eigen::Index i = 0; i < a.cols(); ++i) {
    a.col(i) << random.uniform(-90, 90), random.uniform(-90, 90), random.uniform(-90, 90);
    Track track;
    for (std::size_t d = 0; d < device_count(truth); ++d)
      track.views.push_back({d, *device_at(truth, d).project(a.col(i)), 1});
    b.col(i) = triangulate(found, track, 0.01).value_or(Vec3::Constant(1e6));
  }
  return {a, b};
}

/// Distances of projections of points in the volume, median, px. Free of gauge: the similarity that
/// takes the points to where the found rig measures them comes first.
inline double projection_error(const Rig& truth, const BundleProblem& found) {
  const auto [a, b] = points_of_both(truth, found);
  const Eigen::Matrix4d S = fit_similarity(a, b, true);
  std::vector<double> errors;
  for (Eigen::Index i = 0; i < a.cols(); ++i) {
    const Vec3 moved = (S * a.col(i).homogeneous()).head<3>();
    for (std::size_t d = 0; d < device_count(truth); ++d) {
      const auto p = device_at(truth, d).project(a.col(i));
      if (const auto e = p ? view_error(found.devices[d], moved, {d, *p, 1}) : std::nullopt)
        errors.push_back(e->norm());
    }
  }
  if (errors.empty()) return 1e6;
  return upper_median(std::move(errors));
}

}  // namespace pencilscan::sample
