#include "pencilscan/lab/virtual_objects.h"

#include <cmath>

#include "pencilscan/core/random.h"
#include "pencilscan/simulation/placement.h"

namespace pencilscan {
namespace {

constexpr int kBalls = 40;
// Shares of the volume's radius. Balls of these sizes fill about half of what the volume shows from
// any side, so that near and far ones are seen everywhere.
constexpr double kSmallestBall = 0.10;
constexpr double kLargestBall = 0.22;

void append(TriangleMesh& mesh, const TriangleMesh& part) {
  const auto first = static_cast<int>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), part.vertices.begin(), part.vertices.end());
  for (const auto& face : part.faces)
    mesh.faces.push_back({face[0] + first, face[1] + first, face[2] + first});
}

}  // namespace

TriangleMesh make_heap(const Sphere& volume, std::uint64_t seed) {
  Random random(seed, 0x68656170);
  TriangleMesh heap;
  for (int i = 0; i < kBalls; ++i) {
    const double radius = volume.radius * random.uniform(kSmallestBall, kLargestBall);
    Vec3 direction(random.normal(), random.normal(), random.normal());
    direction.normalize();
    // Evenly in the ball that keeps this one within the volume.
    const double distance = (volume.radius - radius) * std::cbrt(random.uniform());
    append(heap, make_sphere(radius, 24, volume.center + distance * direction));
  }
  return heap;
}

TriangleMesh make_pebble(const Sphere& volume) {
  TriangleMesh mesh = make_sphere(1, 96);
  for (Vec3& v : mesh.vertices) {
    const double bumps = 0.16 * std::sin(3 * v.x() + 1) * std::sin(2.5 * v.y()) +
                         0.10 * std::cos(4 * v.z() + 2 * v.x()) +
                         0.05 * std::sin(9 * v.y() + 4 * v.z());
    v *= 1 + bumps;
  }
  return fitted(std::move(mesh), volume, 0.8);
}

}  // namespace pencilscan
