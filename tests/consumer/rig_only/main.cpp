// A program that only reads rigs: it needs no Ceres.
//   rig_only <rig.json>

#include <pencilscan/rig/rig.h>

#include <cstdio>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const pencilscan::Rig rig = pencilscan::read_rig(argv[1]);
  const pencilscan::Sphere volume = pencilscan::working_volume(rig);
  for (const pencilscan::Camera& camera : rig.cameras) {
    const auto pixel = camera.project(volume.center);
    if (!pixel) return 1;
    std::printf("%s sees the volume's centre at %.1f, %.1f\n", camera.name.c_str(), pixel->x(),
                pixel->y());
  }
  return rig.cameras.empty() ? 1 : 0;
}
