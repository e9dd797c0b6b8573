// The operations that every stage repeats per pixel, by Google Benchmark.

#include <benchmark/benchmark.h>

#include "pencilscan/geometry/device.h"
#include "pencilscan/geometry/light_sheet.h"

namespace pencilscan {
namespace {

Device device_at(const Vec3& eye, bool distorted) {
  Device device;
  device.width = 1280;
  device.height = 960;
  device.K << 1500, 0, 640, 0, 1500, 480, 0, 0, 1;
  if (distorted) device.distortion = {-0.12, 0.03, 0.001, -0.001, 0.0};
  device.device_from_world = look_at(eye, Vec3::Zero());
  return device;
}

/// Argument 0: 1 with lens distortion, 0 without.
void project_point(benchmark::State& state) {
  const Device camera = device_at({1500, 0, 300}, state.range(0) != 0);
  Vec3 point(10, 20, 30);
  for (auto _ : state) {
    benchmark::DoNotOptimize(point);
    benchmark::DoNotOptimize(camera.project(point));
  }
}
BENCHMARK(project_point)->Arg(0)->Arg(1);

void depth_on_light_sheet(benchmark::State& state) {
  const Device camera = device_at({1500, 0, 300}, state.range(0) != 0);
  const Device projector = device_at({1300, 750, 300}, state.range(0) != 0);
  Vec2 pixel(700, 500);
  for (auto _ : state) {
    benchmark::DoNotOptimize(pixel);
    const RayInProjector ray(camera, projector, pixel);
    benchmark::DoNotOptimize(ray.depth(640, Axis::kColumn));
  }
}
BENCHMARK(depth_on_light_sheet)->Arg(0)->Arg(1);

}  // namespace
}  // namespace pencilscan
