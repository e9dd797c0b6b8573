#include "pencilscan/simulation/placement.h"

#include <gtest/gtest.h>

namespace pencilscan {
namespace {

TEST(Fitted, FarthestVertexLiesAtItsShareOfTheRadius) {
  const Sphere volume{{10, -20, 30}, 150};
  const TriangleMesh mesh = fitted(make_box({1, 2, 3}, {7, 7, 7}), volume);
  for (const Vec3& v : mesh.vertices) EXPECT_NEAR((v - volume.center).norm(), 0.95 * 150, 1e-9);
  EXPECT_GT(signed_volume(mesh), 0);
}

TEST(TurnedUpright, IsARotationThatRaisesTheNamedAxis) {
  const TriangleMesh box = make_box({1, 2, 3});
  EXPECT_NEAR(bounding_box(turned_upright(box, UpAxis::kY)).high.z(), 1.0, 1e-12);
  EXPECT_NEAR(bounding_box(turned_upright(box, UpAxis::kX)).high.z(), 0.5, 1e-12);
  EXPECT_GT(signed_volume(turned_upright(box, UpAxis::kX)), 0);
  EXPECT_GT(signed_volume(turned_upright(box, UpAxis::kY)), 0);
}

TEST(Motion, KeepsThePivotUpToTheShift) {
  const Motion motion{0.1, {1, 2, 3}, {50, 60, 70}};
  EXPECT_LT((motion.at(4) * motion.pivot - motion.pivot - Vec3(4, 8, 12)).norm(), 1e-12);
  EXPECT_LT((motion.at(0) * Vec3(1, 1, 1) - Vec3(1, 1, 1)).norm(), 1e-12);
}

}  // namespace
}  // namespace pencilscan
