#include <cmath>

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {
namespace {

float widened(float sigma, double by) {
  return static_cast<float>(std::hypot(static_cast<double>(sigma), by));
}

}  // namespace

FrameResult count_motion(const Rig& rig, FrameResult result) {
  const ExposureMotion& motion = result.shape.motion;
  if (!motion.is_seen) return result;
  for (MeasuredPoint& p : result.points.points) {
    const Vec3 x = position_of(p);
    const Vec3 ray = (x - rig.cameras[p.camera].center()).normalized();
    p.sigma = widened(p.sigma, motion_sigma(motion.way_of(x), normal_of(p), &ray));
  }
  for (TriangleMesh* mesh : {&result.shape.surface.mesh, &result.shape.surface.measured}) {
    const std::vector<Vec3> normals = vertex_normals(*mesh);
    for (std::size_t v = 0; v < mesh->sigma.size(); ++v)
      mesh->sigma[v] = widened(mesh->sigma[v],
                               motion_sigma(motion.way_of(mesh->vertices[v]), normals[v], nullptr));
  }
  return result;
}

}  // namespace pencilscan
