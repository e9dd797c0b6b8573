#pragma once

// Devices for tests: pinholes that look at the origin.

#include <string>

#include "pencilscan/rig/rig.h"

namespace pencilscan::sample {

template <class DeviceKind>
DeviceKind device_at(const Vec3& eye, const std::string& name, int width, int height,
                     double focal_px) {
  DeviceKind device;
  device.name = name;
  device.width = width;
  device.height = height;
  device.K << focal_px, 0, width / 2, 0, focal_px, height / 2, 0, 0, 1;
  device.device_from_world = look_at(eye, Vec3::Zero());
  return device;
}

/// Two cameras at `right` and its mirror image in y, and two projectors with skew axes: the first
/// shows columns in blue and cyan, the second rows in red and yellow.
inline Rig two_by_two(const Camera& right, const Projector& columns, const Projector& rows,
                      double volume_radius_mm) {
  Rig rig;
  Vec3 eye = right.center();
  eye.y() = -eye.y();
  rig.cameras = {right, device_at<Camera>(eye, "cam1", right.width, right.height, right.K(0, 0))};
  rig.projectors = {columns, rows};
  LinePattern pattern;
  pattern.axis = Axis::kColumn;
  rig.projectors[0].patterns = {pattern};
  pattern.axis = Axis::kRow;
  pattern.colors = {"red", "yellow"};
  rig.projectors[1].patterns = {pattern};
  rig.volume = Sphere{Vec3::Zero(), volume_radius_mm};
  return rig;
}

/// A small rig of cameras of this size before a small object.
inline Rig small_rig(int width, int height, double volume_radius_mm) {
  return two_by_two(device_at<Camera>({560, -110, 80}, "cam0", width, height, 900),
                    device_at<Projector>({450, 225, 45}, "proj0", 640, 512, 1000),
                    device_at<Projector>({386, -140, 277}, "proj1", 640, 512, 1000),
                    volume_radius_mm);
}

}  // namespace pencilscan::sample
