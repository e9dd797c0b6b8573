#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <set>
#include <thread>

#include "pencilscan/capture/aravis_cameras.h"
#include "pencilscan/capture/fake_cameras.h"
#include "pencilscan/capture/record.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/core/private_network.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;

/// GigE Vision cameras in a network of this test's own.
class GigE : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!has_aravis()) GTEST_SKIP() << "built without Aravis";
    static const std::string refused = [] {
      try {
        enter_private_network(3);
        return std::string();
      } catch (const StageError& error) {
        return std::string(error.what());
      }
    }();
    if (!refused.empty()) GTEST_SKIP() << refused;
  }

  FakeCamera& add_camera(const std::function<void(FakeCameraScript&)>& change = {}) {
    FakeCameraScript script;
    script.address = "127.0.0." + std::to_string(cameras_.size() + 1);
    script.serial = "PS" + std::to_string(cameras_.size());
    script.expose = [](cv::Mat& picture, std::uint32_t, std::int64_t begin, double exposure_us,
                       double) {
      std::this_thread::sleep_for(std::chrono::microseconds(static_cast<int>(exposure_us)));
      const auto level = static_cast<double>(begin / 100'000'000 % 200);
      picture.setTo(cv::Scalar::all(level));
      picture.at<std::uint8_t>(0, 0) = 250;
    };
    if (change) change(script);
    cameras_.push_back(std::make_unique<FakeCamera>(script));
    return *cameras_.back();
  }

  static CameraSettings settings() {
    CameraSettings settings;
    settings.width = 320;
    settings.height = 240;
    settings.exposure_us = 5000;
    settings.rate_hz = 10;
    settings.pixel_format = "BayerRG8";
    return settings;
  }

  /// All of them, opened and configured.
  [[nodiscard]] std::unique_ptr<LiveCameras> open_all(
      const CameraSettings& all = settings()) const {
    std::vector<NamedCamera> named;
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      named.push_back(
          {"cam" + std::to_string(c), open_aravis_camera("Aravis-Fake-PS" + std::to_string(c))});
    auto live = std::make_unique<LiveCameras>(std::move(named));
    for (std::size_t c = 0; c < cameras_.size(); ++c) live->group().configure(c, all);
    return live;
  }

  /// A rig of these cameras, whose pictures are raw.
  static Rig rig_of(const LiveCameras& live) {
    Rig rig;
    for (std::size_t c = 0; c < live.group().size(); ++c) {
      rig.cameras.emplace_back().name = live.group().name(c);
      rig.cameras.back().mosaic = Mosaic::from_name("RGGB");
    }
    return rig;
  }

  [[nodiscard]] RecordReport record_frames(LiveCameras& live, std::size_t frames,
                                           RecordOptions options = {}) const {
    options.frames = frames;
    live.start();
    return record(live, rig_of(live), temporary_.path() / "frames", options);
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  std::vector<std::unique_ptr<FakeCamera>> cameras_;
};

TEST_F(GigE, CamerasAreListed) {
  add_camera();
  add_camera();
  const auto found = list_aravis_cameras();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].address, "aravis:Aravis-Fake-PS0");
  EXPECT_EQ(found[1].serial, "PS1");
}

TEST_F(GigE, PicturesArriveWithStatusTimeAndMosaic) {
  add_camera([](FakeCameraScript& script) { script.clock_start_ns = 5'000'000'000; });
  (void)list_aravis_cameras();
  const auto camera = open_aravis_camera("Aravis-Fake-PS0");
  const CameraSettings made = camera->configure(settings());
  EXPECT_EQ(made.width, 320);
  EXPECT_EQ(made.pixel_format, "BayerRG8");
  camera->start();
  const auto frame = camera->next(Seconds(3));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->status, PictureStatus::kComplete);
  EXPECT_EQ(frame->mosaic, "RGGB");
  EXPECT_EQ(frame->image.size(), cv::Size(320, 240));
  EXPECT_EQ(frame->image.at<std::uint8_t>(0, 0), 250);
  const double delay_ms =
      static_cast<double>(frame->arrival_ns - (frame->timestamp_ns - 5'000'000'000)) / 1e6;
  EXPECT_GT(delay_ms, 5 - 0.1);  // the exposure
  EXPECT_LT(delay_ms, 500);
}

TEST_F(GigE, SettingsArePutBack) {
  add_camera();
  (void)list_aravis_cameras();
  const auto exposure = [] {
    const auto camera = open_aravis_camera("Aravis-Fake-PS0");
    return camera->configure({}).exposure_us;
  };
  const auto before = exposure();
  {
    const auto camera = open_aravis_camera("Aravis-Fake-PS0");
    CameraSettings other = settings();
    other.exposure_us = 7777;
    EXPECT_EQ(camera->configure(other).exposure_us, 7777);
    camera->start();
  }
  EXPECT_EQ(exposure(), before);
}

TEST_F(GigE, WhatTheCameraRefusesIsNamed) {
  add_camera();
  (void)list_aravis_cameras();
  const auto camera = open_aravis_camera("Aravis-Fake-PS0");
  CameraSettings bad = settings();
  bad.pixel_format = "BayerRG8Packed";
  EXPECT_THROW(camera->configure(bad), InputError);
  bad = settings();
  bad.width = 4000;
  try {
    camera->configure(bad);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("size"));
  }
  bad = settings();
  bad.exposure_us = 1e11;  // more than 32 bits hold
  try {
    camera->configure(bad);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("exposure = 100000000000 us: must be"));
  }
  EXPECT_THROW((void)open_aravis_camera("Aravis-Fake-PS9"), StageError);
}

TEST_F(GigE, SoftwareTriggersTakeOnePictureEach) {
  add_camera();
  (void)list_aravis_cameras();
  const auto camera = open_aravis_camera("Aravis-Fake-PS0");
  CameraSettings triggered = settings();
  triggered.trigger = Trigger::kSoftware;
  camera->configure(triggered);
  camera->start();
  EXPECT_FALSE(camera->next(Seconds(0.4)));
  camera->trigger();
  EXPECT_TRUE(camera->next(Seconds(3)));
  EXPECT_FALSE(camera->next(Seconds(0.3)));
}

TEST_F(GigE, AWireTriggersAllAtOnce) {
  add_camera();
  add_camera([](FakeCameraScript& script) { script.clock_start_ns = -900'000'000; });
  (void)list_aravis_cameras();
  CameraSettings wired = settings();
  wired.trigger = Trigger::kWire;
  const auto live = open_all(wired);
  std::atomic<bool> over = false;
  std::thread wire([&] {
    while (!over) {
      for (auto& camera : cameras_) camera->pulse();
      std::this_thread::sleep_for(std::chrono::milliseconds(250));
    }
  });
  RecordOptions options;
  options.rate_hz = 4;
  options.one_trigger = true;
  const RecordReport report = record_frames(*live, 8, options);
  over = true;
  wire.join();
  EXPECT_GE(report.whole, 6U);  // of 8: a busy machine misses pulses
  EXPECT_TRUE(report.whole == report.frames || !report.faults.empty());  // nothing is lost unsaid
  EXPECT_LT(report.spread.median_ms, 40);
}

TEST_F(GigE, FramesAreOfOneMomentWhateverTheNumbers) {
  for (int i = 0; i < 3; ++i) add_camera();
  (void)list_aravis_cameras();
  const auto live = open_all();
  const RecordReport report = record_frames(*live, 15);
  // A busy machine may keep a fake camera from taking a picture at all, which is then named.
  EXPECT_GE(report.whole, 10U);
  EXPECT_TRUE(report.whole == report.frames || !report.faults.empty());  // nothing is lost unsaid
  // The pictures hold the moment at which they were taken.
  std::size_t compared = 0;
  for (const auto& frame : std::filesystem::directory_iterator(temporary_.path() / "frames")) {
    std::set<int> moments;
    for (const auto& file : std::filesystem::directory_iterator(frame)) {
      moments.insert(cvRound(255 * read_image(file.path()).at<cv::Vec3f>(9, 9)[0]));
      ++compared;
    }
    EXPECT_EQ(moments.size(), 1U) << frame.path();
  }
  EXPECT_GE(compared, 3 * report.whole);
}

TEST_F(GigE, LostPacketsAreNamed) {
  add_camera();
  add_camera([](FakeCameraScript& script) { script.lost_packets = 0.01; });
  (void)list_aravis_cameras();
  const auto live = open_all();
  const RecordReport report = record_frames(*live, 12);
  EXPECT_LT(report.whole, 12U);
  // A busy machine may add faults of other kinds, also of the other camera.
  std::size_t lost = 0;
  for (const Fault& fault : report.faults) {
    if (fault.kind != "lost_packets") continue;
    ++lost;
    EXPECT_EQ(fault.device, "cam1") << fault;
  }
  EXPECT_GT(lost, 0U);
}

TEST_F(GigE, APulledCableIsNamed) {
  add_camera();
  add_camera();
  (void)list_aravis_cameras();
  const auto live = open_all();
  live->start();
  RecordOptions options;
  options.seconds = 5;
  const RecordReport report = record(*live, rig_of(*live), temporary_.path() / "frames", options,
                                     [&](const RecordReport& so_far) {
                                       if (so_far.frames >= 5 && cameras_.size() == 2)
                                         cameras_.pop_back();
                                       return true;
                                     });
  EXPECT_TRUE(std::any_of(report.faults.begin(), report.faults.end(), [](const Fault& fault) {
    return fault.kind == "dead" && fault.device == "cam1";
  }));
  EXPECT_LT(report.whole, report.frames);
}

TEST_F(GigE, ACameraThatComesBackIsTakenUpAgain) {
  add_camera();
  (void)list_aravis_cameras();
  const auto live = open_all();
  live->start();
  const auto wait_for = [](const std::function<bool()>& what) {
    const std::int64_t until = host_now_ns() + 20'000'000'000;
    while (!what() && host_now_ns() < until)
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    return what();
  };
  ASSERT_TRUE(wait_for([&] { return live->count(0).whole > 0; }));
  cameras_.clear();
  ASSERT_TRUE(wait_for([&] { return !live->group().faults().empty(); }));
  const std::size_t before = live->count(0).whole;
  add_camera();
  EXPECT_TRUE(wait_for([&] { return live->count(0).whole > before + 2; }));
  EXPECT_TRUE(live->group().faults().empty());
  EXPECT_EQ(live->latest(0).frame->image.size(), cv::Size(320, 240));  // as it was set
}

TEST_F(GigE, ACameraOfAnotherProgramIsSaidToBeHeld) {
  add_camera();
  (void)list_aravis_cameras();
  const auto holder = open_aravis_camera("Aravis-Fake-PS0");
  try {
    (void)open_aravis_camera("Aravis-Fake-PS0");
    FAIL();
  } catch (const StageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("another program holds it"));
  }
}

}  // namespace
}  // namespace pencilscan
