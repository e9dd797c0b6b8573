#include "pencilscan/refinement/moved_devices.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "pencilscan/refinement/crossing_tracks.h"
#include "pencilscan/refinement/ring_scene.h"

namespace pencilscan {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

/// The rig as its file says it, when `device` has been turned by so many pixels.
Rig stated_rig(const RingScene& scene, std::size_t device, double rotation_px, std::uint64_t seed) {
  Random random(seed);
  RigCorrection correction(device_count(scene.rig));
  Vec3 axis = Vec3(random.normal(), random.normal(), 0).normalized();
  // Of a projector only what moves its lines across shows.
  if (device >= scene.rig.cameras.size()) {
    const Axis across =
        scene.rig.projectors[device - scene.rig.cameras.size()].patterns.front().axis;
    axis = across == Axis::kColumn ? Vec3::UnitY() : Vec3::UnitX();
  }
  correction[device].rotation_px = rotation_px * axis;
  return corrected_rig(scene.rig, correction);
}

TEST(MovedDevices, ATrueRigIsNotAccused) {
  RingScene scene;
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
    EXPECT_THAT(find_moved_devices(scene.rig, scene.tracks(3, 0.1, seed)).moved, IsEmpty());
}

TEST(MovedDevices, ABumpedOneIsNamedWithHowFar) {
  RingScene scene;
  const auto tracks = scene.tracks(3, 0.1, 1);
  for (std::size_t device = 0; device < 8; ++device) {
    const Rig stated = stated_rig(scene, device, 0.5, device + 1);
    const MovedDevices found = find_moved_devices(stated, tracks);
    ASSERT_THAT(found.moved, SizeIs(1)) << device_at(stated, device).name;
    EXPECT_EQ(found.moved[0].device, device);
    EXPECT_NEAR(found.moved[0].shift_px, 0.5, 0.1);
    EXPECT_LT(found.moved[0].sigma_px, 0.1);
  }
}

TEST(MovedDevices, TwoThatMovedAreBothNamed) {
  RingScene scene;
  const auto tracks = scene.tracks(3, 0.1, 1);
  Rig stated = stated_rig(scene, 1, 1.0, 3);
  const Rig other = stated_rig(scene, 2, 0.7, 4);
  stated.cameras[2] = other.cameras[2];
  const MovedDevices found = find_moved_devices(stated, tracks);
  ASSERT_THAT(found.moved, SizeIs(2));
  EXPECT_EQ(found.moved[0].device, 1U);
  EXPECT_EQ(found.moved[1].device, 2U);
}

TEST(MovedDevices, OneThatMovedFarIsNotSharedByTheOthersOfARefinement) {
  RingScene scene;
  const auto tracks = scene.tracks(3, 0.1, 1);
  constexpr std::size_t kMoved = 1;
  RigCorrection correction(device_count(scene.rig));
  correction[kMoved].translation_mm = Vec3(0, 0, 20);  // what a zoom looks like
  const Rig stated = corrected_rig(scene.rig, correction);
  const MovedDevices found = find_moved_devices(stated, tracks);
  ASSERT_THAT(found.moved, SizeIs(1));
  EXPECT_EQ(found.moved[0].device, kMoved);
  RigCorrection start(device_count(stated));
  start[kMoved] = found.moved[0].correction;
  RefineRigOptions options;
  const auto farthest_other = [](const RefineRigReport& report) {
    double farthest = 0;
    for (std::size_t d = 0; d < report.devices.size(); ++d)
      if (d != kMoved) farthest = std::max(farthest, report.devices[d].translation_mm);
    return farthest;
  };
  const double shared = farthest_other(refine_rig(stated, tracks, start, options).report);
  options.moved = {kMoved};
  const RefineRigResult refined = refine_rig(stated, tracks, start, options);
  ASSERT_TRUE(refined.report.refined) << refined.report.reason;
  EXPECT_GT(shared, 1);
  EXPECT_LT(farthest_other(refined.report), 0.3);
  EXPECT_NEAR(refined.correction[kMoved].translation_mm.z(), -20, 2);
}

TEST(MovedDevices, TooFewCrossingsAccuseNobody) {
  RingScene scene;
  const Rig stated = stated_rig(scene, 0, 2, 1);
  auto tracks = scene.tracks(3, 0.1, 1);
  tracks.resize(20);
  const MovedDevices found = find_moved_devices(stated, tracks);
  EXPECT_THAT(found.moved, IsEmpty());
  EXPECT_LE(found.alone[0].tracks, 20U);
}

std::vector<std::size_t> all_devices(const Rig& rig) {
  std::vector<std::size_t> devices(device_count(rig));
  std::iota(devices.begin(), devices.end(), 0);
  return devices;
}

/// Crossings of some frames; from frame `moved_at` on, `device` stands elsewhere by half a pixel
/// than the rig has it.
std::vector<std::vector<CrossingTrack>> film(std::size_t device, std::size_t moved_at,
                                             std::size_t count = 6) {
  std::vector<std::vector<CrossingTrack>> frames;
  for (std::size_t f = 0; f < count; ++f) {
    RingScene scene;
    if (f >= moved_at) scene.rig = stated_rig(scene, device, 0.5, device + 1);
    frames.push_back(scene.tracks(3, 0.1, f + 1));
  }
  return frames;
}

TEST(MoveBetweenFrames, ARigThatStandsStillHasNone) {
  const RingScene scene;
  EXPECT_FALSE(find_move_between(scene.rig, film(0, 6), all_devices(scene.rig)));
  // Nor has one that is off alike in all frames.
  EXPECT_FALSE(find_move_between(scene.rig, film(0, 0), all_devices(scene.rig)));
}

TEST(MoveBetweenFrames, TheDeviceAndTheFrameAreFound) {
  const RingScene scene;
  for (std::size_t device = 0; device < 8; ++device) {
    const std::size_t at = 1 + device % 5;
    const auto move = find_move_between(scene.rig, film(device, at), all_devices(scene.rig));
    ASSERT_TRUE(move) << device;
    EXPECT_EQ(move->device, device);
    EXPECT_EQ(move->frame, at);
    EXPECT_NEAR(move->shift_px, 0.5, 0.1);
    EXPECT_LT(move->sigma_px, 0.1);
  }
}

TEST(MoveBetweenFrames, IsFoundAmongManyFrames) {
  const RingScene scene;
  const auto move = find_move_between(scene.rig, film(5, 70, 120), all_devices(scene.rig));
  ASSERT_TRUE(move);
  EXPECT_EQ(move->device, 5U);
  EXPECT_EQ(move->frame, 70U);
}

TEST(MoveBetweenFrames, OnlyStatedDevicesAndThoseWithEnoughCrossingsAreAccused) {
  const RingScene scene;
  auto frames = film(2, 3);
  const auto move = find_move_between(scene.rig, frames, std::vector<std::size_t>{0, 1});
  EXPECT_TRUE(!move || move->device != 2);
  for (auto& tracks : frames) tracks.resize(20);
  EXPECT_FALSE(find_move_between(scene.rig, frames, all_devices(scene.rig)));
}

TEST(DeviceDisagreements, ATurnedCameraHasAShiftAndNoOtherHas) {
  RingScene scene;
  const auto tracks = scene.tracks(3, 0.3, 1);
  for (std::size_t turned = 0; turned < 4; ++turned) {
    const auto found = device_disagreements(stated_rig(scene, turned, 0.5, turned + 1), tracks);
    for (std::size_t c = 0; c < 4; ++c) {
      ASSERT_TRUE(found[c].shift_px);
      EXPECT_NEAR(found[c].shift_px->norm(), c == turned ? 0.5 : 0, 0.1) << turned << " " << c;
    }
  }
}

TEST(DeviceDisagreements, ATurnedProjectorIsNotTheShiftOfOneCamera) {
  RingScene scene;
  const auto tracks = scene.tracks(3, 0.3, 1);
  for (std::size_t p = 4; p < 8; ++p) {
    std::vector<double> shifts;
    const auto found = device_disagreements(stated_rig(scene, p, 0.5, 1), tracks);
    for (std::size_t c = 0; c < 4; ++c) shifts.push_back(found[c].shift_px->norm());
    std::sort(shifts.begin(), shifts.end());
    EXPECT_LT(shifts[3], 2 * shifts[2]) << device_at(scene.rig, p).name;
  }
}

}  // namespace
}  // namespace pencilscan
