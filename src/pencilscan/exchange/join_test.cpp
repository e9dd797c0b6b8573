#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pencilscan/core/error.h"
#include "pencilscan/exchange/colmap_model.h"
#include "pencilscan/exchange/exchanged_device.h"
#include "pencilscan/exchange/unheld.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/rig/device_list.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kRounding = 1e-9;  // mm, of lengths near 1000

/// A base in millimetres and files that describe some of its devices.
class Joining : public ::testing::Test {
 protected:
  void SetUp() override {
    rig_ = sample::small_rig(640, 480, 100);
    rig_.floor = Floor{Vec3(0, 0, -50)};
  }

  UncalibratedRig base() const {
    return {rig_, std::vector<GivenCalibration>(4, {true, true, true})};
  }

  const Device& device(const std::string& name) const {
    for (std::size_t d = 0; d < device_count(rig_); ++d)
      if (device_at(rig_, d).name == name) return device_at(rig_, d);
    throw std::runtime_error(name);
  }
  ExchangedDevice described(const std::string& name, const std::string& source) const {
    ExchangedDevice d;
    d.device = device(name);
    d.given = {true, true, true};
    d.source = source;
    d.is_projector = name.starts_with("proj");
    return d;
  }
  /// The devices in a world of its own, and in metres.
  ExchangedRig model(const std::vector<std::string>& names,
                     const RigidTransform& base_from_model = {}) const {
    ExchangedRig files;
    files.world_is_arbitrary = true;
    for (const std::string& name : names) {
      RigidTransform& pose =
          files.devices.emplace_back(described(name, "images.txt")).device.device_from_world;
      pose = pose * base_from_model;
      pose.translation /= 1000;
    }
    return files;
  }
  /// A pair as a stereo calibration has it: no poses.
  void add_pair(const std::string& first, const std::string& second, const std::string& source,
                ExchangedRig& files) const {
    for (const std::string& name : {first, second})
      files.devices.emplace_back(described(name, source)).given.pose = false;
    files.relative.push_back(
        {first, second,
         device(second).device_from_world * device(first).device_from_world.inverse(), source});
  }
  static RigidTransform other_world() {
    return {Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix(),
            {100, -200, 300}};
  }

  /// All devices stand where the base has them.
  void expect_as_base(const JoinedRig& found) const {
    ASSERT_EQ(device_count(found.rig), 4U);
    for (std::size_t d = 0; d < 4; ++d) {
      EXPECT_TRUE(found.given[d].pose);
      EXPECT_LT((device_at(found.rig, d).center() - device_at(rig_, d).center()).norm(), kRounding);
      EXPECT_LT((device_at(found.rig, d).device_from_world.rotation -
                 device_at(rig_, d).device_from_world.rotation)
                    .norm(),
                1e-12);
    }
    ASSERT_TRUE(found.rig.volume && found.rig.floor);
    EXPECT_EQ(found.rig.volume->radius, 100);
    EXPECT_EQ(found.rig.floor->point, Vec3(0, 0, -50));
    EXPECT_TRUE(found.rig.unit_known);
  }
  template <class Call>
  static void expect_refused(Call call, const std::string& part) {
    try {
      static_cast<void>(call());
      ADD_FAILURE() << "accepted; expected: " << part;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(part));
    }
  }

  Rig rig_;
};

ExchangeOptions no_unit() {
  ExchangeOptions options;
  options.unit_known = false;
  return options;
}

TEST_F(Joining, KnownDistanceScalesWhatTheFilesPlaceAlone) {
  ExchangeOptions options = no_unit();
  options.known_distance = {"cam0", "cam1",
                            (device("cam0").center() - device("cam1").center()).norm()};
  for (const RigidTransform& world : {RigidTransform(), other_world()}) {
    const JoinedRig found = join_rig(model({"cam0", "cam1"}, world), base(), options);
    expect_as_base(found);
    EXPECT_THAT(found.warnings, IsEmpty());
  }
}

TEST_F(Joining, KnownDistanceGivesTheScaleWithoutABase) {
  ExchangeOptions options = no_unit();
  options.known_distance = {"cam0", "proj1", 321};
  const ExchangedRig files = model({"cam0", "cam1", "proj0", "proj1"});
  const JoinedRig found = join_rig(files, {}, options);
  EXPECT_TRUE(found.rig.unit_known);
  EXPECT_NEAR((found.rig.cameras[0].center() - found.rig.projectors[1].center()).norm(), 321,
              kRounding);
  options.known_distance->second = "nobody";
  expect_refused([&] { return join_rig(files, {}, options); }, "nobody");
  options.known_distance->second = "cam0";
  expect_refused([&] { return join_rig(files, {}, options); }, "must not stand at cam0");
}

TEST_F(Joining, DevicesInBothGiveTheScaleAndTheWorld) {
  const JoinedRig found =
      join_rig(model({"cam0", "cam1", "proj0"}, other_world()), base(), no_unit());
  expect_as_base(found);
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("a unit of the files is 1000 mm"),
                                       HasSubstr("the files have another world than --base")));
}

TEST_F(Joining, LengthsWithoutAUnitDoNotMixWithThoseOfTheBase) {
  const auto join = [&] { return join_rig(model({"cam0"}), base(), no_unit()); };
  expect_refused(join,
                 "one must be given: the files' lengths have no unit, and cam1, proj0, proj1, "
                 "volume, floor of --base keep theirs");
  // Nothing of a base without poses, volume and floor keeps lengths.
  UncalibratedRig bare{rig_, std::vector<GivenCalibration>(4)};
  bare.rig.volume.reset();
  bare.rig.floor.reset();
  EXPECT_FALSE(join_rig(model({"cam0"}), bare, no_unit()).rig.unit_known);
}

TEST_F(Joining, AUnitThatTheBaseContradictsIsRefused) {
  const auto join = [&] { return join_rig(model({"cam0", "cam1"}), base()); };
  expect_refused(join, "a unit of the files is 1000 mm");
  ExchangeOptions options;
  options.mm_per_unit = 1050;
  EXPECT_THAT(join_rig(model({"cam0", "cam1"}), base(), options).warnings,
              ::testing::Contains(HasSubstr("a unit of the files is 1000 mm, not 1050 mm")));
}

TEST_F(Joining, ABaseWithoutUnitTakesThatOfTheFiles) {
  UncalibratedRig unknown = base();
  unknown.rig = scaled(unknown.rig, 0.1);
  unknown.rig.unit_known = false;
  ExchangeOptions metres;
  metres.mm_per_unit = 1000;
  const JoinedRig found = join_rig(model({"cam0", "cam1"}), unknown, metres);
  EXPECT_TRUE(found.rig.unit_known);
  EXPECT_NEAR(found.rig.volume->radius, 100, kRounding);
  EXPECT_LT((found.rig.projectors[1].center() - rig_.projectors[1].center()).norm(), kRounding);
  expect_refused([&] { return join_rig(model({"cam0"}), unknown, metres); },
                 "two devices with poses in both");
}

TEST_F(Joining, PairsHoldOnToTheBase) {
  ExchangedRig files;
  add_pair("cam0", "proj0", "a.yml", files);
  add_pair("cam1", "proj0", "b.yml", files);
  expect_as_base(join_rig(files, base()));
}

TEST_F(Joining, ADeviceThatMovedTakesNoOtherWithIt) {
  UncalibratedRig before = base();
  before.rig.projectors[0].device_from_world.translation.x() += 100;
  ExchangedRig pair;
  add_pair("cam0", "proj0", "a.yml", pair);
  for (const ExchangedRig& files :
       {pair, model({"cam0", "cam1", "proj0"}), model({"cam0", "proj0", "cam1"}, other_world())}) {
    ExchangeOptions options;
    options.mm_per_unit = files.world_is_arbitrary ? 1000 : 1;
    const JoinedRig found = join_rig(files, before, options);
    expect_as_base(found);
    EXPECT_THAT(found.warnings,
                ::testing::Contains(HasSubstr("proj0 stands 100 mm and 0 degrees from where")));
  }
}

TEST_F(Joining, StatedPosesStayWhereOneDeviceMoved) {
  ExchangedRig files;
  files.devices.push_back(described("cam0", "cam0.yml"));
  files.devices[0].device.device_from_world.translation.x() += 40;
  const JoinedRig found = join_rig(files, base());
  EXPECT_EQ(found.rig.cameras[0].device_from_world.translation,
            files.devices[0].device.device_from_world.translation);
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("cam0 stands 40 mm and 0 degrees from where")));
}

TEST_F(Joining, PairsThatNothingJoinsHaveNoPose) {
  UncalibratedRig half = base();
  half.given[1].pose = half.given[3].pose = false;
  ExchangedRig files;
  add_pair("cam1", "proj1", "a.yml", files);
  const JoinedRig found = join_rig(files, half);
  EXPECT_FALSE(found.given[1].pose);
  EXPECT_TRUE(found.given[0].pose);
  EXPECT_THAT(found.warnings, ElementsAre(HasSubstr("nothing says where cam1, proj1 stand")));
}

TEST_F(Joining, LensesThatDifferAreToldOnceADevice) {
  ExchangedRig files;
  files.devices = {described("cam0", "a.yml"), described("cam0", "b.yml"),
                   described("cam0", "c.yml"), described("proj0", "a.yml")};
  EXPECT_THAT(join_rig(files, {}).warnings, IsEmpty());
  for (const std::size_t i : {1U, 2U}) {
    files.devices[i].device.K(0, 0) = 930;
    files.devices[i].device.distortion[0] = -0.2;
  }
  const JoinedRig found = join_rig(files, {});
  EXPECT_EQ(found.rig.cameras[0].K(0, 0), 900);
  EXPECT_THAT(found.warnings,
              ElementsAre(AllOf(HasSubstr("cam0 differs: fx fy cx cy = 900 900 320 240 in a.yml, "
                                          "which is used, fx fy cx cy = 930 900 320 240 in b.yml"),
                                HasSubstr("[-0.2, 0, 0, 0, 0] in b.yml"))));
}

TEST_F(Joining, ADistortionJoinsTheSameK) {
  ExchangedRig files;
  files.devices = {described("cam0", "a.yml"), described("cam0", "b.yml")};
  files.devices[0].given.distortion = false;
  files.devices[1].device.distortion[0] = -0.2;
  const JoinedRig found = join_rig(files, {});
  EXPECT_EQ(found.rig.cameras[0].distortion[0], -0.2);
  EXPECT_THAT(found.warnings, IsEmpty());
}

TEST_F(Joining, ImageSizesThatDifferAreRefused) {
  ExchangedRig files;
  files.devices = {described("cam0", "a.yml"), described("cam0", "b.yml")};
  files.devices[1].device.width = 1280;
  files.devices[1].device.height = 960;
  expect_refused([&] { return join_rig(files, {}); },
                 "b.yml: image size of cam0 = 1280 x 960: must be that of a.yml, 640 x 480");
}

TEST_F(Joining, PairsThatDoNotCloseAreTold) {
  ExchangedRig files;
  add_pair("cam0", "proj0", "a.yml", files);
  add_pair("proj0", "cam1", "b.yml", files);
  add_pair("cam1", "cam0", "c.yml", files);
  EXPECT_THAT(join_rig(files, {}).warnings, IsEmpty());
  // The bound is one per cent of their distance, 220 mm.
  RigidTransform& last = files.relative[2].second_from_first;
  last.translation.x() += 2;
  EXPECT_THAT(join_rig(files, {}).warnings, IsEmpty());
  last.translation.x() += 10;
  EXPECT_THAT(join_rig(files, {}).warnings,
              ElementsAre("c.yml has cam0, seen from cam1, 12 mm and 0 degrees from where the "
                          "other files have it, which is used"));
  last.translation.x() -= 12;
  last.rotation = Eigen::AngleAxisd(0.02, Vec3::UnitX()).toRotationMatrix() * last.rotation;
  EXPECT_THAT(join_rig(files, {}).warnings, ElementsAre(HasSubstr("and 1.15 degrees from")));
}

TEST_F(Joining, PosesThatTwoFilesStateAreCompared) {
  ExchangedRig files;
  files.devices = {described("cam0", "a.yml"), described("cam0", "b.yml")};
  files.devices[1].device.device_from_world.translation.x() += 30;
  EXPECT_THAT(join_rig(files, {}).warnings,
              ElementsAre("b.yml has cam0, seen from the world, 30 mm and 0 degrees from where "
                          "a.yml has it, which is used"));
}

TEST_F(Joining, AStatedSizeMustBeThatOfTheFile) {
  ExchangedRig files;
  files.devices = {described("cam0", "a.yml"), described("cam0", "b.yml")};
  files.devices[0].device.width = files.devices[0].device.height = 0;
  expect_refused(
      [&] {
        state_size("cam0", 960, 720, files);
        return 0;
      },
      "--size = cam0=960x720: must be that of b.yml, 640x480");
  EXPECT_EQ(files.devices[0].device.width, 0);
  state_size("cam0", 640, 480, files);
  EXPECT_EQ(files.devices[0].device.width, 640);
  expect_refused(
      [&] {
        state_size("cam7", 640, 480, files);
        return 0;
      },
      "no device of this name");
}

TEST_F(Joining, WhatFilesDoNotHoldIsListed) {
  EXPECT_THAT(unheld_values(rig_), ElementsAre("pattern", "volume", "floor"));
  rig_.cameras[1].gamma = 2.2;
  rig_.cameras[1].mosaic = Mosaic::from_name("RGGB");
  rig_.cameras[1].sees_texture_only = true;
  rig_.projectors[0].color_registration.colors[0].scale = 1.001;
  rig_.projectors[1].output = "HDMI-1";
  EXPECT_THAT(unheld_values(rig_), ElementsAre("pattern", "output", "gamma", "mosaic", "role",
                                               "color_registration", "volume", "floor"));
}

TEST_F(Joining, DevicesOfOneNameAreNotExported) {
  rig_.projectors[0].name = "cam0";
  const TemporaryFolder folder("devices_of_one_name");
  expect_refused(
      [&] {
        write_colmap(rig_, {}, folder.path());
        return 0;
      },
      "name = cam0: must be that of one device");
}

}  // namespace
}  // namespace pencilscan
