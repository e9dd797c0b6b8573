#include "pencilscan/capture/projector_tests.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pencilscan/capture/sample_room.h"
#include "pencilscan/capture/scripted_camera.h"

namespace pencilscan {
namespace {

using sample::Room;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kPeriodMs = 1000.0 / 60;

class ProjectorTests : public ::testing::Test {
 protected:
  [[nodiscard]] ProjectorTestReport test(Trigger trigger = Trigger::kFree,
                                         double exposure_ms = kPeriodMs) {
    std::vector<NamedCamera> named;
    for (std::size_t c = 0; c < 2; ++c) {
      CameraScript script;
      script.name = "cam" + std::to_string(c);
      script.phase_s = 0.007 * static_cast<double>(c);
      script.expose = [this, c](std::int64_t begin, double exposure_us, double) {
        return room_.seen(c, begin, exposure_us);
      };
      named.push_back({script.name, make_scripted_camera(script)});
    }
    LiveCameras cameras(std::move(named));
    CameraSettings settings;
    settings.rate_hz = 47;  // no multiple of the refresh
    settings.exposure_us = 1000 * exposure_ms;
    settings.trigger = trigger;
    for (std::size_t c = 0; c < 2; ++c) cameras.group().configure(c, settings);
    cameras.start();
    ProjectorTestOptions options;
    options.flashes = 4;
    return test_projectors(cameras, room_, options);
  }

  static std::vector<std::string> kinds(const ProjectorTestReport& report) {
    std::vector<std::string> result;
    for (const Fault& fault : report.faults) result.push_back(fault.device + " " + fault.kind);
    return result;
  }

  Room room_;
};

TEST_F(ProjectorTests, DelaysAreBoundedFromBothSides) {
  room_.delay_ns[1] = 15'000'000 + static_cast<std::int64_t>(2e6 * kPeriodMs);  // two frames more
  const ProjectorTestReport report = test();
  // Pictures arrive when their exposure is over: that is a part of the delay.
  const double expected = 15 + kPeriodMs;
  const ProjectorTiming& fast = report.projectors[0];
  EXPECT_LT(fast.least_ms, expected + 15);
  EXPECT_GT(fast.most_ms, expected - 5);
  EXPECT_LT(fast.most_ms - fast.least_ms, 25);
  EXPECT_NEAR(report.projectors[1].frames_behind, 2, 0.8);
  EXPECT_THAT(kinds(report), ::testing::ElementsAre("proj1 late"));
  EXPECT_THAT(report.faults[0].what, HasSubstr("after that of proj0"));
}

TEST_F(ProjectorTests, APauseOfTheComputerIsNoDelayOfTheProjector) {
  // Shows are of black and white to look at, then eight flashes, for one projector after the other.
  room_.pause_ns = [](int show) { return show == 7 ? 130'000'000 : 0; };
  const ProjectorTestReport report = test();
  EXPECT_THAT(report.faults, IsEmpty());
  EXPECT_LT(report.projectors[0].most_ms, 100);
}

TEST_F(ProjectorTests, DelaysThatChangeAreJitter) {
  room_.pause_ns = [](int show) { return show % 2 == 0 ? 130'000'000 : 0; };
  const ProjectorTestReport report = test();
  EXPECT_THAT(kinds(report), Contains("proj0 jitter"));
  EXPECT_GT(report.projectors[0].use_ms, 130);
}

TEST_F(ProjectorTests, SoftwareTriggersFindTheDelayItself) {
  room_.delay_ns[0] = room_.delay_ns[1] = 60'000'000;
  const ProjectorTestReport report = test(Trigger::kSoftware);
  EXPECT_THAT(report.faults, IsEmpty());
  for (const ProjectorTiming& timing : report.projectors) {
    EXPECT_NEAR(timing.least_ms, 58, 8);
    EXPECT_NEAR(timing.most_ms, 62, 8);
  }
}

TEST_F(ProjectorTests, FlickerIsNamedUnlessTheExposureIsWholePeriods) {
  room_.flicker[0] = 0.5;
  const ProjectorTestReport whole = test();
  EXPECT_LT(whole.projectors[0].flicker, 0.02);
  EXPECT_THAT(whole.faults, IsEmpty());
  const ProjectorTestReport part = test(Trigger::kFree, 5);
  EXPECT_GT(part.projectors[0].flicker, 0.1);
  EXPECT_LT(part.projectors[1].flicker, 0.02);
  EXPECT_THAT(kinds(part), Contains("proj0 flicker"));
  EXPECT_THAT(kinds(part), Contains("cam1 exposure"));
}

TEST_F(ProjectorTests, WhoSeesWhomIsFound) {
  room_.blind = [](std::size_t camera, std::size_t projector) {
    return camera == 0 || projector == 1;
  };
  const ProjectorTestReport report = test();
  EXPECT_THAT(kinds(report), ::testing::UnorderedElementsAre("proj1 unseen", "cam0 blind"));
  EXPECT_EQ(report.projectors[0].views[0].share, 0);
  EXPECT_GT(report.projectors[0].views[1].share, 0.9);
}

}  // namespace
}  // namespace pencilscan
