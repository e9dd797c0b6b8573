#pragma once

// Correspondences for tests and benchmarks, made without images.

#include <cmath>
#include <vector>

#include "pencilscan/bundle/observations.h"
#include "pencilscan/core/random.h"
#include "pencilscan/rig/device_list.h"
#include "pencilscan/rig/sample_ring.h"

namespace pencilscan::sample {

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

}  // namespace pencilscan::sample
