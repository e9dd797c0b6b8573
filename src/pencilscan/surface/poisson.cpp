#include "pencilscan/surface/poisson.h"

#include <open3d/geometry/PointCloud.h>
#include <open3d/geometry/TriangleMesh.h>
#include <open3d/utility/Logging.h>

#include <mutex>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/core/memory.h"

namespace pencilscan {

TriangleMesh poisson_surface(std::span<const SurfaceSample> samples, int depth, double scale) {
  // Open3D's threads and its level of messages are the process's, not the caller's.
  static std::mutex one_at_a_time;
  const std::lock_guard lock(one_at_a_time);
  const open3d::utility::VerbosityContextManager quiet(open3d::utility::VerbosityLevel::Error);
  open3d::geometry::PointCloud cloud;
  cloud.points_.reserve(samples.size());
  cloud.normals_.reserve(samples.size());
  for (const SurfaceSample& sample : samples) {
    cloud.points_.push_back(sample.position);
    cloud.normals_.push_back(sample.normal);
  }
  TriangleMesh mesh;
  try {
    const auto result = open3d::geometry::TriangleMesh::CreateFromPointCloudPoisson(
        cloud, static_cast<std::size_t>(depth), 0.0F, static_cast<float>(scale), false, 1);
    const open3d::geometry::TriangleMesh& made = *std::get<0>(result);
    mesh.vertices.assign(made.vertices_.begin(), made.vertices_.end());
    mesh.faces.reserve(made.triangles_.size());
    for (const Eigen::Vector3i& t : made.triangles_) mesh.faces.push_back({t[0], t[1], t[2]});
  } catch (const std::runtime_error& error) {
    if (is_of_memory(error)) throw;
    throw StageError(std::string("surface: Poisson reconstruction failed: ") + error.what());
  }
  return mesh;
}

}  // namespace pencilscan
