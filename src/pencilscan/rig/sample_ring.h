#pragma once

// A ring of devices for tests and benchmarks.

#include <cmath>
#include <string>

#include "pencilscan/rig/rig.h"

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

}  // namespace pencilscan::sample
