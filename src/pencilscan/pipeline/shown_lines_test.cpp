#include "pencilscan/pipeline/shown_lines.h"

#include <gtest/gtest.h>

#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

constexpr double kBallShown = 60;

/// Two cameras before a ball. The first measured points of it; what the second one shows is drawn.
class ShownLinesTest : public testing::Test {
 protected:
  ShownLinesTest() : rig_(sample::small_rig(480, 360, 110)), families_(color_families(rig_)) {
    points_.resize(rig_.cameras.size());
    const PatternRef pattern = families_[0].patterns[0];
    const Vec3 light = rig_.projector(pattern.projector).center();
    for (int i = 0; i < 60; ++i) {
      for (int k = 0; k < 120; ++k) {
        const double a = M_PI * (i + 0.5) / 60;
        const double b = 2 * M_PI * k / 120;
        const Vec3 normal(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
        const Vec3 x = kBallShown * normal;
        if (normal.dot(rig_.cameras[0].center() - x) <= 0 || normal.dot(light - x) <= 0) continue;
        MeasuredPoint p;
        set_position(x, p);
        p.projector = static_cast<std::uint8_t>(pattern.projector);
        p.pattern = static_cast<std::uint8_t>(pattern.pattern);
        p.sigma = 0.01F;
        points_[0].push_back(p);
      }
    }
  }

  /// Curves of the second camera through the points that it sees, off by `shift`.
  [[nodiscard]] GridGraph curves(const Vec2& shift, int family = 0) const {
    GridGraph graph;
    graph.camera = 1;
    for (const MeasuredPoint& p : points_[0]) {
      const Vec3 x = position_of(p);
      if (x.dot(rig_.cameras[1].center() - x) <= 0) continue;
      Curve curve;
      curve.family = family;
      curve.points.resize(1);
      curve.points[0].position = (*rig_.cameras[1].project(x) + shift).cast<float>();
      graph.curves.push_back(std::move(curve));
    }
    return graph;
  }
  [[nodiscard]] ShownLines shown(const GridGraph& graph) const {
    return shown_lines(rig_, families_, graph, points_);
  }

  Rig rig_;
  std::vector<ColorFamily> families_;
  std::vector<std::vector<MeasuredPoint>> points_;
};

TEST_F(ShownLinesTest, LinesThroughOtherCamerasPointsFit) {
  const ShownLines right = shown(curves(Vec2::Zero()));
  EXPECT_TRUE(right.fits());
  EXPECT_EQ(right.on, right.near);
}

TEST_F(ShownLinesTest, LinesBesideThemDoNot) {
  const ShownLines moved = shown(curves({0, 2}));
  EXPECT_TRUE(moved.misfits());
}

TEST_F(ShownLinesTest, OtherColorsAndBlurredPlacesSayNothing) {
  ASSERT_GT(families_.size(), 1U);
  EXPECT_EQ(shown(curves(Vec2::Zero(), 1)).near, 0U);
  GridGraph none;
  none.camera = 1;
  EXPECT_EQ(shown(none).near, 0U);
  EXPECT_FALSE(shown(none).fits() || shown(none).misfits());
  for (MeasuredPoint& p : points_[0]) p.sigma = 10;
  EXPECT_EQ(shown(curves(Vec2::Zero())).near, 0U);
}

}  // namespace
}  // namespace pencilscan
