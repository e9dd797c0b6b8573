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

TEST(Fitted, VerticesWithoutFacesDoNotCount) {
  TriangleMesh box = make_box({1, 2, 3});
  const Sphere volume{{10, -20, 30}, 150};
  const TriangleMesh alone = fitted(box, volume);
  box.vertices.insert(box.vertices.begin(), Vec3(900, 900, 900));
  box.color.assign(box.vertices.size(), {0.5F, 0.5F, 0.5F});
  box.color[0] = {1, 0, 0};
  for (auto& face : box.faces)
    for (int& corner : face) ++corner;
  const TriangleMesh mesh = fitted(box, volume);
  EXPECT_EQ(mesh.vertices, alone.vertices);
  EXPECT_EQ(mesh.faces, alone.faces);
  EXPECT_EQ(mesh.color, (std::vector<std::array<float, 3>>(8, {0.5F, 0.5F, 0.5F})));
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
