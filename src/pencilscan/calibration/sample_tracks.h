#pragma once

// Correspondences for tests and benchmarks of calibration, made without images.

#include <cmath>
#include <string>
#include <vector>

#include "pencilscan/calibration/calibrate.h"
#include "pencilscan/core/random.h"

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

}  // namespace pencilscan::sample
