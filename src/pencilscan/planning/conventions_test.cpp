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
    const auto flipped = [](Device& device) {
      const Mat3 flip = Vec3(1, -1, -1).asDiagonal();
      RigidTransform& pose = device.device_from_world;
      pose = {flip * pose.rotation, flip * pose.translation};
    };
    EXPECT_THAT(pose_convention_warning(changed(flipped, has_volume)).value_or(""),
                HasSubstr("if devices look along -z"));
    const auto of_blender = [](Device& device) {
      const Mat3 flip = Vec3(1, -1, -1).asDiagonal();
      const RigidTransform pose = device.device_from_world;
      device.device_from_world = {pose.rotation.transpose() * flip, device.center()};
    };
    EXPECT_THAT(pose_convention_warning(changed(of_blender, has_volume)).value_or(""),
                HasSubstr("camera-to-world and devices look along -z"));
  }
}

TEST(SharedPose, OfTwoDevicesIsNamed) {
  Rig rig = make_ring({});
  EXPECT_FALSE(shared_pose_warning(rig));
  rig.cameras[3].device_from_world = rig.cameras[1].device_from_world;
  EXPECT_THAT(shared_pose_warning(rig).value_or(""), HasSubstr("cam1 and cam3 have the same R"));
  rig.cameras[3].device_from_world.translation.x() += 0.1;
  EXPECT_FALSE(shared_pose_warning(rig));
  rig.cameras[3].device_from_world = rig.projectors[0].device_from_world;
  EXPECT_THAT(shared_pose_warning(rig).value_or(""), HasSubstr("cam3 and proj0"));
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

TEST(IntrinsicsConvention, LensesThatAreNoneAreNamed) {
  Rig rig = make_ring({});
  rig.cameras[1].distortion = {-0.25, 0.1, 1e-3, -5e-4, -0.02};
  EXPECT_FALSE(intrinsics_convention_warning(rig));
  Camera wide = rig.cameras[1];
  wide.K(0, 0) = wide.K(1, 1) = 0.6 * wide.width;
  wide.distortion = {-0.3, 0.1, 0, 0, -0.015};
  rig.cameras[4] = wide;
  EXPECT_FALSE(intrinsics_convention_warning(rig));
  rig.cameras[1].distortion = {-0.25, 0.1, -0.05, 1e-3, -5e-4};  // k3 third
  EXPECT_THAT(intrinsics_convention_warning(rig).value_or(""), HasSubstr("as no lens has"));
  rig.cameras[1].distortion = {-12, 5, 0, 0, 0};
  EXPECT_THAT(intrinsics_convention_warning(rig).value_or(""), HasSubstr("folds"));
}

}  // namespace
}  // namespace pencilscan
