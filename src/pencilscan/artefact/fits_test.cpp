#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "pencilscan/artefact/find_shapes.h"
#include "pencilscan/artefact/plane_fit.h"
#include "pencilscan/artefact/sphere_fit.h"
#include "pencilscan/artefact/trimmed.h"
#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

/// Even directions (normalised normal deviates), above `least_z`.
std::vector<Vec3> directions(std::size_t count, double least_z, std::uint64_t seed) {
  Random random(seed);
  std::vector<Vec3> result;
  while (result.size() < count) {
    const Vec3 d = Vec3(random.normal(), random.normal(), random.normal()).normalized();
    if (d.z() >= least_z) result.push_back(d);
  }
  return result;
}

TEST(SphereFit, GivesBackTheSphereOfExactPoints) {
  const Sphere truth{{120.5, -30.25, 700}, 25.001};
  for (const double least_z : {-1.0, 0.0, 0.8}) {
    std::vector<Vec3> points;
    for (const Vec3& d : directions(300, least_z, 7))
      points.push_back(truth.center + truth.radius * d);
    const auto fit = fit_sphere(points, {points[0], 1});
    ASSERT_TRUE(fit);
    // A cap of 37 degrees tells centre from radius a thousand times worse than its points.
    EXPECT_LT((fit->center - truth.center).norm(), 1e-9);
    EXPECT_NEAR(fit->radius, truth.radius, 1e-9);
  }
}

TEST(SphereFit, OfSixPointsHasItsClosedForm) {
  // On the axes with radial errors e: to first order the centre moves by half the difference of
  // opposite errors, the radius by their mean.
  constexpr double kSmall = 1e-6;
  const double e[6] = {3, -1, 0.5, 2.5, -2, 4};
  std::vector<Vec3> points;
  double mean = 0;
  for (int i = 0; i < 6; ++i) {
    Vec3 axis = Vec3::Zero();
    axis(i / 2) = i % 2 == 0 ? 1 : -1;
    points.push_back((10 + kSmall * e[i]) * axis);
    mean += e[i] / 6;
  }
  const auto fit = fit_sphere(points, {Vec3(1, -1, 0.5), 8});
  ASSERT_TRUE(fit);
  for (int axis = 0; axis < 3; ++axis)
    EXPECT_NEAR(fit->center(axis) / kSmall, (e[2 * axis] - e[2 * axis + 1]) / 2, 1e-4);
  EXPECT_NEAR((fit->radius - 10) / kSmall, mean, 1e-4);
}

TEST(SphereFit, IsAStationaryPointOfTheSumOfSquares) {
  Random random(3);
  std::vector<Vec3> points;
  for (const Vec3& d : directions(200, -0.2, 5))
    points.push_back(Vec3(5, 6, 7) + (20 + random.normal(0, 0.5)) * d);
  points.push_back({90, 0, 0});  // far off: nothing is removed
  for (const bool held : {false, true}) {
    const auto fit =
        fit_sphere(points, {Vec3::Zero(), 10}, held ? std::optional(20.0) : std::nullopt);
    ASSERT_TRUE(fit);
    Vec3 by_center = Vec3::Zero();
    double by_radius = 0;
    for (const Vec3& point : points) {
      const double r = signed_distance(*fit, point);
      by_center += r * (point - fit->center).normalized();
      by_radius += r;
    }
    EXPECT_LT(by_center.norm(), 1e-7);
    EXPECT_TRUE(held || std::abs(by_radius) < 1e-7) << by_radius;
  }
}

TEST(SphereFit, ScattersAsItsNormalEquationsSay) {
  constexpr double kSigma = 0.02;
  constexpr int kDraws = 600;
  const auto dirs = directions(150, 0.3, 11);
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  for (const Vec3& d : dirs) {
    Eigen::Vector4d row;
    row << d, 1;
    normal += row * row.transpose();
  }
  const Eigen::Matrix4d expected = kSigma * kSigma * normal.inverse();
  Eigen::Matrix4d found = Eigen::Matrix4d::Zero();
  Random random(13);
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<Vec3> points;
    for (const Vec3& d : dirs) points.push_back((15 + random.normal(0, kSigma)) * d);
    const auto fit = fit_sphere(points, {Vec3::Zero(), 15});
    ASSERT_TRUE(fit);
    Eigen::Vector4d error;
    error << fit->center, fit->radius - 15;
    found += error * error.transpose() / kDraws;
  }
  // A variance of 600 draws scatters by sqrt(2 / 600) = 6 %: four times that.
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(found(i, i) / expected(i, i), 1, 0.24) << i;
}

TEST(SphereFit, RefusesPointsThatDetermineNone) {
  std::vector<Vec3> flat;
  for (int i = 0; i < 20; ++i) flat.emplace_back(i % 5, i / 5, 0);
  EXPECT_FALSE(fit_sphere(flat, {Vec3(2, 2, 0), 3}));
  EXPECT_FALSE(fit_sphere(std::span<const Vec3>(flat).first(3), {Vec3(2, 2, 1), 3}));
  EXPECT_FALSE(sphere_through(flat[0], flat[1], flat[5], flat[6]));
  EXPECT_FALSE(fit_sphere(std::vector<Vec3>(9, Vec3(1, 2, 3)), {Vec3::Zero(), 1}));
}

TEST(PlaneFit, GivesBackThePlaneOfExactPoints) {
  const Plane truth{{10, 20, 900}, Vec3(1, 2, 3).normalized()};
  const Vec3 e1 = truth.normal.unitOrthogonal(), e2 = truth.normal.cross(e1);
  std::vector<Vec3> points;
  for (int i = 0; i < 40; ++i) points.push_back(truth.point + (i % 8) * e1 + (i / 8) * 3.0 * e2);
  const auto fit = fit_plane(points);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(std::abs(fit->normal.dot(truth.normal)), 1, 1e-12);
  for (const Vec3& point : points) EXPECT_NEAR(fit->signed_distance(point), 0, 1e-11);
}

TEST(PlaneFit, OfASaddleIsItsMiddle) {
  constexpr double kBend = 0.25;
  const std::vector<Vec3> corners = {
      {1, 1, kBend}, {-1, 1, -kBend}, {-1, -1, kBend}, {1, -1, -kBend}};
  const auto fit = fit_plane(corners);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(std::abs(fit->normal.z()), 1, 1e-12);
  EXPECT_NEAR(fit->point.z(), 0, 1e-12);
}

TEST(PlaneFit, ScattersAsTheSpreadOfItsPointsSays) {
  // The tilt about y has the standard deviation sigma / sqrt(sum x^2).
  constexpr double kSigma = 0.05;
  constexpr int kDraws = 600;
  Random random(17);
  double found = 0, expected = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<Vec3> points;
    double squares = 0;
    for (int i = 0; i < 100; ++i) {
      const Vec3 point(i % 10 - 4.5, i / 10 - 4.5, random.normal(0, kSigma));
      squares += point.x() * point.x();
      points.push_back(point);
    }
    const auto fit = fit_plane(points);
    ASSERT_TRUE(fit);
    const double tilt = fit->normal.x() / fit->normal.z();
    found += tilt * tilt / kDraws;
    expected = kSigma * kSigma / squares;
  }
  EXPECT_NEAR(found / expected, 1, 0.24);
}

TEST(PlaneFit, RefusesPointsThatDetermineNone) {
  EXPECT_FALSE(fit_plane(std::vector<Vec3>{{0, 0, 0}, {1, 1, 1}}));
  EXPECT_FALSE(fit_plane(std::vector<Vec3>{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {5, 5, 5}}));
}

TEST(FindSphere, FindsABallAmongOtherThings) {
  Random random(19);
  std::vector<Vec3> points;
  const Sphere ball{{40, 0, 10}, 12};
  for (const Vec3& d : directions(300, -0.5, 23))
    points.push_back(ball.center + (ball.radius + random.normal(0, 0.02)) * d);
  for (int i = 0; i < 600; ++i)
    points.emplace_back(random.uniform(-80, 80), random.uniform(-80, 80), random.uniform(-20, 60));
  const auto found = find_sphere(points, {12.0, {}, 1});
  ASSERT_TRUE(found);
  EXPECT_LT((found->center - ball.center).norm(), 1);
  EXPECT_NEAR(found->radius, 12, 1);
  EXPECT_FALSE(find_sphere(std::vector<Vec3>(50, Vec3(1, 1, 1)), {12.0, {}, 1}));
}

TEST(TrimmedFit, RemovesTheFarPointsThoughTheyBendTheFirstFit) {
  Random random(29);
  std::vector<Vec3> points;
  for (int i = 0; i < 1000; ++i)
    points.emplace_back(random.uniform(-10, 10), random.uniform(-10, 10), random.normal(0, 0.01));
  for (int i = 0; i < 3; ++i) points.emplace_back(10, 10, 400 + i);
  const auto fit = fit_trimmed(
      std::span<const Vec3>(points), 3, std::vector<Plane>{*fit_plane(points), *find_plane(points)},
      [](std::span<const Vec3> rest, const Plane&) { return fit_plane(rest); },
      [](const Plane& plane, const Vec3& point) { return plane.signed_distance(point); });
  ASSERT_TRUE(fit);
  ASSERT_EQ(fit->kept.size(), 1000U);
  for (std::size_t i = 0; i < 1000; ++i) EXPECT_EQ(fit->kept[i], i);
}

}  // namespace
}  // namespace pencilscan
