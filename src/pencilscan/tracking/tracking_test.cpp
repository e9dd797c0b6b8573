#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "pencilscan/core/random.h"
#include "pencilscan/geometry/as_floats.h"
#include "pencilscan/io/file.h"
#include "pencilscan/tracking/registration.h"
#include "pencilscan/tracking/steady.h"
#include "pencilscan/tracking/tracked_surface.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

constexpr double kRadius = 50;
constexpr double kSpacing = 1;
constexpr double kEdge = 2;  // of the ball's triangles: coarse meshes have a vertex a node

/// A ball with hills, so that turning it shows.
TriangleMesh hilly_ball() {
  TriangleMesh mesh = make_sphere(kRadius, 80);
  for (Vec3& x : mesh.vertices) {
    const Vec3 n = x.normalized();
    x *= 1 + 0.15 * std::sin(5 * n.x() + 1) * std::cos(4 * n.y()) + 0.1 * n.z();
  }
  return mesh;
}

/// What cameras around would measure of a mesh: its vertices, noise along their normals.
std::vector<SurfaceSample> measured(const TriangleMesh& mesh, double noise) {
  Random random(3);
  const std::vector<Vec3> normals = vertex_normals(mesh);
  std::vector<SurfaceSample> samples;
  for (std::size_t v = 0; v < normals.size(); ++v) {
    if (!(normals[v].squaredNorm() > 0.5)) continue;
    SurfaceSample s;
    s.normal = normals[v];
    s.position = mesh.vertices[v] + noise * random.normal() * s.normal;
    samples.push_back(s);
  }
  return samples;
}

/// Root mean square distance of moved vertices from where they are, along the normals there.
double off_surface(const std::vector<Vec3>& moved, const TriangleMesh& truth) {
  const std::vector<Vec3> normals = vertex_normals(truth);
  double sum = 0;
  for (std::size_t v = 0; v < moved.size(); ++v) {
    const double off = normals[v].dot(moved[v] - truth.vertices[v]);
    sum += off * off;
  }
  return std::sqrt(sum / static_cast<double>(moved.size()));
}

TEST(RegisterSurface, FindsHowTheWholeMoved) {
  const TriangleMesh before = hilly_ball();
  const RigidTransform motion{
      Eigen::AngleAxisd(0.06, Vec3(1, 2, 3).normalized()).toRotationMatrix(), {2, -1, 1.5}};
  const TriangleMesh after = transformed(before, motion);
  const Registration found = register_surface(before, measured(after, 0.1), kSpacing);
  EXPECT_LT(Eigen::AngleAxisd(found.motion.rotation * motion.rotation.transpose()).angle(), 0.002);
  EXPECT_LT((found.motion.translation - motion.translation).norm(), 0.1);
  EXPECT_LT(off_surface(found.vertices, after), 0.1);
}

TEST(RegisterSurface, FollowsWhatBends) {
  const TriangleMesh before = hilly_ball();
  TriangleMesh after = before;
  for (Vec3& x : after.vertices) {
    const double angle = 0.0015 * x.z();  // 13 degrees from end to end
    x = Eigen::AngleAxisd(angle, Vec3::UnitX()) * x;
  }
  ASSERT_GT(off_surface(before.vertices, after), 0.5);
  const Registration found = register_surface(before, measured(after, 0.1), kSpacing);
  EXPECT_LT(off_surface(found.vertices, after), 0.1);
}

TEST(RegisterSurface, StaysWhereNothingWasMeasuredNearBy) {
  const TriangleMesh before = hilly_ball();
  const TriangleMesh far = transformed(before, {Mat3::Identity(), {500, 0, 0}});
  const Registration found = register_surface(before, measured(far, 0), kSpacing);
  for (std::size_t v = 0; v < before.vertices.size(); ++v)
    EXPECT_LT((found.vertices[v] - before.vertices[v]).norm(), 1e-9);
}

/// The ball with noise of one moment.
TriangleMesh noisy(Random& random, double sigma) {
  TriangleMesh mesh = hilly_ball();
  const std::vector<Vec3> normals = vertex_normals(mesh);
  for (std::size_t v = 0; v < normals.size(); ++v)
    mesh.vertices[v] += sigma * random.normal() * normals[v];
  mesh.sigma.assign(mesh.vertices.size(), static_cast<float>(sigma));
  mesh.confidence.assign(mesh.vertices.size(), 1.F);
  return mesh;
}

TrackedSurface tracked(const TriangleMesh& mesh, std::vector<float> variance) {
  TrackedSurface surface;
  surface.mesh = mesh;
  surface.coarse_faces = mesh.faces;
  surface.variance = std::move(variance);
  return surface;
}

TEST(SteadySurface, WhatRestsFlickersLessThanHalfItsNoise) {
  constexpr double kSigma = 0.1;
  Random random(1);
  TriangleMesh mesh = noisy(random, kSigma);
  TrackedSurface before = tracked(mesh, first_variance(mesh));
  const TriangleMesh truth = hilly_ball();
  const std::vector<Vec3> normals = vertex_normals(truth);
  double flicker = 0;
  for (int moment = 0; moment < 12; ++moment) {
    mesh = noisy(random, kSigma);
    std::vector<float> variance = steady_surface(before, kEdge, mesh.faces, mesh).variance;
    flicker = 0;
    for (std::size_t v = 0; v < normals.size(); ++v) {
      const double change = normals[v].dot(mesh.vertices[v] - before.mesh.vertices[v]);
      flicker += change * change;
    }
    before = tracked(mesh, std::move(variance));
  }
  EXPECT_LT(std::sqrt(flicker / static_cast<double>(normals.size())), 0.5 * kSigma);
  EXPECT_LT(off_surface(mesh.vertices, truth), 0.6 * kSigma);
}

TEST(SteadySurface, OtherTrianglesOfTheSameSurfaceAreNoMotion) {
  constexpr double kSigma = 0.1;
  // Faces of four degrees: chords are up to 0.03 inside of a ball of 50.
  TriangleMesh ball = make_sphere(kRadius, 45);
  const auto known = [&](TriangleMesh mesh) {
    mesh.sigma.assign(mesh.vertices.size(), static_cast<float>(kSigma));
    mesh.confidence.assign(mesh.vertices.size(), 1.F);
    return mesh;
  };
  const TriangleMesh first = known(ball);
  TrackedSurface before = tracked(first, first_variance(first));
  for (int moment = 1; moment < 12; ++moment) {
    const Mat3 turn = Eigen::AngleAxisd(0.7 * moment, Vec3(1, 2, 3).normalized()).matrix();
    TriangleMesh mesh = known(transformed(ball, {turn, Vec3::Zero()}));
    std::vector<float> variance = steady_surface(before, kEdge, mesh.faces, mesh).variance;
    double mean = 0;
    for (const Vec3& x : mesh.vertices)
      mean += (x.norm() - kRadius) / static_cast<double>(mesh.vertices.size());
    EXPECT_LT(std::abs(mean), 0.02 * kSigma) << moment;
    before = tracked(mesh, std::move(variance));
  }
}

TEST(SteadySurface, WhatMovesIsLeftAlone) {
  constexpr double kSigma = 0.1;
  Random random(2);
  TriangleMesh mesh = noisy(random, kSigma);
  const TrackedSurface before = tracked(mesh, first_variance(mesh));
  // Its parts that slide along themselves, too, lie on the surface of the moment before.
  const RigidTransform motion{Eigen::AngleAxisd(0.04, Vec3::UnitZ()).toRotationMatrix(), {4, 0, 0}};
  mesh = transformed(noisy(random, kSigma), motion);
  const std::vector<Vec3> measured = mesh.vertices;
  const Steadied steadied = steady_surface(before, kEdge, mesh.faces, mesh);
  EXPECT_LT((steadied.motion.translation - motion.translation).norm(), 0.1);
  std::size_t untouched = 0;
  for (std::size_t v = 0; v < measured.size(); ++v) {
    EXPECT_LT((mesh.vertices[v] - measured[v]).norm(), 0.1 * kSigma);
    untouched += mesh.vertices[v] == measured[v] ? 1 : 0;
  }
  // The mean has nothing to say there, so that the mesh need not be untangled once more.
  EXPECT_GT(untouched, measured.size() * 9 / 10);
}

TEST(SteadySurface, AShiftOfAllTogetherIsMotion) {
  constexpr double kSigma = 0.1;
  Random random(4);
  TriangleMesh mesh = noisy(random, kSigma);
  const TrackedSurface before = tracked(mesh, first_variance(mesh));
  mesh = noisy(random, kSigma);
  TriangleMesh truth = hilly_ball();
  const std::vector<Vec3> normals = vertex_normals(truth);
  for (std::size_t v = 0; v < normals.size(); ++v) {
    mesh.vertices[v] += 0.3 * normals[v];
    truth.vertices[v] += 0.3 * normals[v];
  }
  static_cast<void>(steady_surface(before, kEdge, mesh.faces, mesh));
  double bias = 0;
  for (std::size_t v = 0; v < normals.size(); ++v)
    bias += normals[v].dot(mesh.vertices[v] - truth.vertices[v]);
  EXPECT_LT(std::abs(bias) / static_cast<double>(normals.size()), 0.5 * kSigma);
}

TEST(TrackedSurfaceFile, GivesBackTheSameOrNothing) {
  const fs::path file =
      fs::temp_directory_path() / ("tracked_surface_" + std::to_string(::getpid()));
  Random random(5);
  TriangleMesh mesh = noisy(random, 0.1);
  for (Vec3& x : mesh.vertices) x = as_floats(x);
  TrackedSurface surface = tracked(mesh, first_variance(mesh));
  surface.motion.translation = {1, 2, 3.25};
  write_tracked_surface(file, surface, "key");
  const auto read = read_tracked_surface(file, "key");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->mesh.vertices, surface.mesh.vertices);
  EXPECT_EQ(read->mesh.faces, surface.mesh.faces);
  EXPECT_EQ(read->mesh.sigma, surface.mesh.sigma);
  EXPECT_EQ(read->coarse_faces, surface.coarse_faces);
  EXPECT_EQ(read->variance, surface.variance);
  EXPECT_EQ(read->motion.translation, surface.motion.translation);
  EXPECT_FALSE(read_tracked_surface(file, "other"));
  const std::string bytes = read_file(file);
  write_text(file, bytes.substr(0, bytes.size() / 2));
  EXPECT_FALSE(read_tracked_surface(file, "key"));
  fs::remove(file);
  EXPECT_FALSE(read_tracked_surface(file, "key"));
}

}  // namespace
}  // namespace pencilscan
