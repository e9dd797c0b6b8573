#include "pencilscan/planning/conventions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pencilscan/planning/ring.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;

Rig changed(void (*change)(Device&), bool has_volume) {
  Rig rig = make_ring({});
  if (!has_volume) rig.volume.reset();
  for (Camera& camera : rig.cameras) change(camera);
  for (Projector& projector : rig.projectors) change(projector);
  return rig;
}

TEST(PoseConvention, OtherReadingsAreNamed) {
  for (const bool has_volume : {false, true}) {
    EXPECT_FALSE(pose_convention_warning(changed([](Device&) {}, has_volume)));
    const auto inverse = [](Device& device) {
      const RigidTransform pose = device.device_from_world;
      device.device_from_world = {pose.rotation.transpose(), device.center()};
    };
    EXPECT_THAT(pose_convention_warning(changed(inverse, has_volume)).value_or(""),
                HasSubstr("camera-to-world"));
    const auto center = [](Device& device) {
      device.device_from_world.translation = device.center();
    };
    EXPECT_THAT(pose_convention_warning(changed(center, has_volume)).value_or(""),
                HasSubstr("centre"));
  }
}

TEST(IntrinsicsConvention, OtherUnitsAreNamed) {
  EXPECT_FALSE(intrinsics_convention_warning(make_ring({})));
  Rig rig = make_ring({});
  rig.cameras[2].K(0, 0) = rig.cameras[2].K(1, 1) = 8;
  EXPECT_THAT(intrinsics_convention_warning(rig).value_or(""), HasSubstr("K of cam2"));
  rig = make_ring({});
  rig.cameras[3].K(0, 2) = rig.cameras[3].K(1, 2) = 0;
  EXPECT_THAT(intrinsics_convention_warning(rig).value_or(""), HasSubstr("principal point"));
  rig = make_ring({});
  rig.projectors[1].K(1, 2) = 1.1 * rig.projectors[1].height;  // a projector on a table
  EXPECT_FALSE(intrinsics_convention_warning(rig));
}

}  // namespace
}  // namespace pencilscan
