#pragma once

// Correspondences for tests and benchmarks of calibration, made without images.

#include <cmath>
#include <string>
#include <vector>

#include "pencilscan/calibration/calibrate.h"
#include "pencilscan/calibration/pair_matches.h"
#include "pencilscan/calibration/structure.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/random.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan::sample {

/// A ring of cameras and projectors in turn, 30 degrees apart, that look at the middle.
inline Rig ring(int cameras, int projectors) {
  Rig rig;
  const int total = cameras + projectors;
  for (int i = 0; i < total; ++i) {
    const bool is_camera = i % 2 == 0 && i / 2 < cameras;
    Device device;
    const double azimuth = i * M_PI / 6;
    const double elevation = is_camera ? 0.26 : (i % 4 == 1 ? 0.14 : 0.59);
    const double distance = 1000 + 60.0 * (i % 3);
    const Vec3 eye(distance * std::cos(azimuth) * std::cos(elevation),
                   distance * std::sin(azimuth) * std::cos(elevation),
                   distance * std::sin(elevation));
    device.device_from_world = look_at(eye, Vec3(10.0 * (i % 2), 15.0 * (i % 3), 0));
    device.width = 1280;
    device.height = is_camera ? 960 : 1024;
    const double focal = (is_camera ? 2250 : 2400) + 20 * (i % 4);
    device.K << focal, 0, 645 - 3 * (i % 4), 0, focal, is_camera ? 470 : 700, 0, 0, 1;
    device.distortion = {is_camera ? -0.1 : -0.05, is_camera ? 0.1 : 0, 0, 0, 0};
    if (is_camera) {
      device.name = "cam" + std::to_string(rig.cameras.size());
      rig.cameras.emplace_back();
      static_cast<Device&>(rig.cameras.back()) = device;
    } else {
      device.name = "proj" + std::to_string(rig.projectors.size());
      rig.projectors.emplace_back();
      static_cast<Device&>(rig.projectors.back()) = device;
    }
  }
  return rig;
}

struct TrackScene {
  int count = 900;
  double noise_px = 0.05;
  double outliers = 0;  ///< share of views anywhere in the image
  bool planar = false;
  double radius = 165;
  std::uint64_t seed = 3;        ///< of the points
  std::uint64_t noise_seed = 4;  ///< of errors and outliers
};

/// Tracks of points in the volume with normals; a device sees what faces it.
inline std::vector<Track> tracks_of(const Rig& rig, const TrackScene& scene) {
  Random random(scene.seed);
  Random noise(scene.noise_seed);
  std::vector<Track> tracks;
  const auto cameras = rig.cameras.size();
  while (tracks.size() < static_cast<std::size_t>(scene.count)) {
    const Vec3 normal = Vec3(random.normal(), random.normal(), 0.3 * random.normal()).normalized();
    Vec3 point = scene.radius * std::cbrt(random.uniform()) * normal;
    if (scene.planar) point = Vec3(0, random.uniform(-150, 150), random.uniform(-150, 150));
    std::vector<TrackView> views;
    for (std::size_t d = 0; d < device_count(rig); ++d) {
      const Device& device = device_at(rig, d);
      const Vec3 to_device = (device.center() - point).normalized();
      if (to_device.dot(scene.planar ? Vec3(Vec3::UnitX()) : normal) < 0.3) continue;
      const auto pixel = device.project(point);
      if (pixel && device.contains(*pixel)) views.push_back({d, *pixel, scene.noise_px});
    }
    // One hub, the others of the other kind.
    const bool camera_hub = random.below(2) == 0;
    std::vector<TrackView> hubs;
    for (const TrackView& view : views)
      if ((view.device < cameras) == camera_hub) hubs.push_back(view);
    if (hubs.empty()) continue;
    Track track{{hubs[random.below(static_cast<std::uint32_t>(hubs.size()))]}, 0};
    track.views[0].sigma_px = 0.02;
    for (TrackView view : views) {
      if ((view.device < cameras) == camera_hub) continue;
      view.pixel += Vec2(noise.normal(0, scene.noise_px), noise.normal(0, scene.noise_px));
      if (noise.uniform() < scene.outliers)
        view.pixel = Vec2(noise.uniform(0, 1279), noise.uniform(0, 959));
      track.views.push_back(view);
    }
    if (track.views.size() > 1) tracks.push_back(track);
  }
  return tracks;
}

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

/// Distances of projections of points in the volume, median, px. Free of gauge: the similarity that
/// takes the points to where the found rig measures them comes first.
inline double projection_error(const Rig& truth, const BundleProblem& found) {
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
