#include "pencilscan/planning/units.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/planning/ring.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;

/// A cube of this side around `center`.
TriangleMesh cube(double side, const Vec3& center) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.vertices.push_back(
        center +
        0.5 * side * Vec3((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1));
  return mesh;
}

const Rig& ring() {
  static const Rig rig = make_ring({});
  return rig;
}

TEST(ObjectUnit, ObjectsThatFitAreLeftInPeace) {
  const Sphere volume = working_volume(ring());
  for (const double share : {0.12, 0.3, 0.9, 1.0, 1.5}) {
    const double side = share * volume.radius * 2 / std::sqrt(3.0);
    EXPECT_FALSE(object_unit_warning(cube(side, volume.center), ring())) << share;
  }
}

TEST(ObjectUnit, AForeignUnitIsNamedWithItsFactor) {
  const Sphere volume = working_volume(ring());
  const double side = volume.radius;
  struct Case {
    double factor;
    const char* unit;
    const char* remedy;
  };
  for (const Case& c : {Case{1e-3, "metres instead of millimetres", "--scale 1000 "},
                        Case{1 / 25.4, "inches instead of millimetres", "--scale 25.4 "},
                        Case{1 / 304.8, "feet instead of millimetres", "--scale 304.8 "},
                        Case{0.01, "decimetres instead of millimetres", "--scale 100 "},
                        Case{1000, "micrometres instead of millimetres", "--scale 0.001 "}}) {
    const auto warning = object_unit_warning(cube(c.factor * side, volume.center), ring());
    ASSERT_TRUE(warning) << c.unit;
    EXPECT_THAT(*warning, HasSubstr(c.unit));
    EXPECT_THAT(*warning, HasSubstr(c.remedy));
    EXPECT_THAT(*warning, HasSubstr("--fit"));
  }
}

TEST(ObjectUnit, BeforeARigOfUnknownUnitItMayBeEitherOfTwo) {
  Rig rig = scaled(ring(), 0.001);
  rig.unit_known = false;
  const Sphere volume = working_volume(rig);
  EXPECT_THAT(object_unit_warning(cube(1000 * volume.radius, volume.center), rig).value_or(""),
              HasSubstr("millimetres instead of metres. --scale 0.001 "));
}

TEST(ObjectUnit, TheAdviceIsTheSameWhateverTheScaleInUse) {
  // 2.69 units, as large as a bunny that is often met: neither metres nor inches.
  const double side = 2.69 / std::sqrt(3.0);
  const Vec3 center = working_volume(ring()).center;
  for (const double scale : {1.0, 0.1, 39.37 / 4, 1000.0}) {
    const auto warning = object_unit_warning(cube(scale * side, center), ring(), scale);
    ASSERT_TRUE(warning) << scale;
    EXPECT_THAT(*warning,
                HasSubstr("decimetres instead of millimetres. --scale 100 makes it right"))
        << scale;
  }
  EXPECT_FALSE(object_unit_warning(cube(100 * side, center), ring(), 100));
  EXPECT_THAT(object_unit_warning(cube(1000 * 200, center), ring(), 1000).value_or(""),
              HasSubstr("the rig's unit already. --scale 1 makes it right"));
}

TEST(ObjectUnit, WhatNoUnitExplainsIsStillToldToFit) {
  const auto warning = object_unit_warning(cube(1e7, Vec3::Zero()), ring());
  ASSERT_TRUE(warning);
  EXPECT_THAT(*warning, ::testing::Not(HasSubstr("probably")));
  EXPECT_THAT(*warning, HasSubstr("--fit"));
}

TEST(PoseUnit, MetresAndMicrometresAreNamedWhereTheRigSaysMillimetres) {
  EXPECT_FALSE(pose_unit_warning(ring()));
  EXPECT_FALSE(pose_unit_warning(scaled(ring(), 0.03)));
  EXPECT_FALSE(pose_unit_warning(scaled(ring(), 30)));
  EXPECT_THAT(pose_unit_warning(scaled(ring(), 0.001)).value_or(""), HasSubstr("metres"));
  EXPECT_THAT(pose_unit_warning(scaled(ring(), 1000)).value_or(""), HasSubstr("micrometres"));
  Rig of_unknown_unit = scaled(ring(), 0.001);
  of_unknown_unit.unit_known = false;
  EXPECT_FALSE(pose_unit_warning(of_unknown_unit));
}

TEST(VolumeUnit, RingsAndTheirScaledCopiesArePlausible) {
  EXPECT_FALSE(volume_unit_warning(ring()));
  for (const double factor : {1e-3, 1 / 25.4, 30.0})
    EXPECT_FALSE(volume_unit_warning(scaled(ring(), factor))) << factor;
}

TEST(VolumeUnit, AVolumeInAnotherUnitThanTheDevicesIsNamed) {
  for (const double factor : {1000.0, 0.001}) {
    Rig rig = scaled(ring(), factor);
    rig.volume = ring().volume;
    const auto warning = volume_unit_warning(rig);
    ASSERT_TRUE(warning) << factor;
    EXPECT_THAT(*warning,
                HasSubstr("multiply it by " + std::string(factor > 1 ? "1000" : "0.001")));
  }
}

TEST(VolumeUnit, AVolumeBehindTheCamerasIsNamed) {
  Rig rig = ring();
  rig.volume = Sphere{{0, 0, 5000}, 100};
  const auto warning = volume_unit_warning(rig);
  ASSERT_TRUE(warning);
  EXPECT_THAT(*warning, HasSubstr("leave it out"));
}

}  // namespace
}  // namespace pencilscan
