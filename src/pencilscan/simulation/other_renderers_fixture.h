#pragma once

#include "pencilscan/rig/rig.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {

// A scene that other renderers have to show as ours does.

/// A camera whose pixels are not square, its axis not in the middle; two projectors, one distorted.
inline Rig two_projectors() {
  Rig rig;
  Camera camera;
  camera.name = "cam0";
  camera.width = 200;
  camera.height = 150;
  camera.K << 400, 0, 93, 0, 410, 80, 0, 0, 1;
  camera.device_from_world = look_at({900, 100, 300}, Vec3::Zero(), 0.2);
  rig.cameras.push_back(camera);
  for (const double side : {-1.0, 1.0}) {
    Projector projector;
    projector.name = side < 0 ? "proj0" : "proj1";
    projector.width = 320;
    projector.height = 240;
    projector.K << 640, 0, 150, 0, 640, 118, 0, 0, 1;
    projector.device_from_world = look_at({800, 500 * side, 250}, Vec3::Zero(), 0.3 * side);
    LinePattern pattern;
    pattern.pitch_px = 24;
    pattern.line_width_px = 9;
    if (side > 0) {
      pattern.axis = Axis::kRow;
      pattern.colors = {"red", "yellow"};
      projector.distortion = {0.4, 0, 0.01, -0.02, 0};
    }
    projector.patterns = {pattern};
    rig.projectors.push_back(projector);
  }
  rig.volume = Sphere{Vec3::Zero(), 120};
  return rig;
}

/// A ball in front of a board, so that shadows fall.
inline SimulatedObject ball_and_board(Reflectance surface = {}) {
  TriangleMesh mesh = make_box({10, 500, 500}, {-80, 0, 0});
  const TriangleMesh ball = make_sphere(70, 40);
  const int base = static_cast<int>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), ball.vertices.begin(), ball.vertices.end());
  for (const auto& f : ball.faces) mesh.faces.push_back({f[0] + base, f[1] + base, f[2] + base});
  surface.smooth = false;
  return SimulatedObject(mesh, surface);
}

}  // namespace pencilscan
