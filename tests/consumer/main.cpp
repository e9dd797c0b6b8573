// A C++ program that uses pencilscan as an installed package: where does a projector's light sheet
// cross a camera's ray?

#include <pencilscan/geometry/light_sheet.h>
#include <pencilscan/pattern/line_pattern.h>

#include <cmath>
#include <cstdio>

int main() {
  namespace ps = pencilscan;

  ps::Device camera;
  camera.name = "cam0";
  camera.width = 1280;
  camera.height = 960;
  camera.K << 1500, 0, 640, 0, 1500, 480, 0, 0, 1;
  camera.device_from_world = ps::look_at({1000, 0, 0}, {0, 0, 0});

  ps::Device projector = camera;
  projector.name = "proj0";
  projector.device_from_world = ps::look_at({900, 500, 0}, {0, 0, 0});

  // Both devices look at the world's origin, which each sees at its principal point.
  const ps::LinePattern pattern;
  const ps::RayInProjector ray(camera, projector, {640, 480});
  const std::optional<double> depth = ray.depth(640, ps::Axis::kColumn);
  if (!depth) return 1;

  std::printf("depth %.6f mm on line %.3f of %d\n", *depth, pattern.coordinate(640),
              pattern.line_count(projector.width));
  return std::abs(*depth - 1000) < 1e-6 ? 0 : 1;  // the camera stands 1000 mm from the origin
}
