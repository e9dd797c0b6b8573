#include "pencilscan/capture/record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "pencilscan/capture/live_cameras.h"
#include "pencilscan/capture/scripted_camera.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/recording/recording.h"

namespace pencilscan {
namespace {

using ::testing::IsEmpty;

/// Cameras whose pictures hold their number.
std::vector<NamedCamera> scripted(
    std::size_t count, const std::function<void(std::size_t, CameraScript&)>& change = {}) {
  std::vector<NamedCamera> cameras;
  for (std::size_t c = 0; c < count; ++c) {
    CameraScript script;
    script.name = "cam" + std::to_string(c);
    script.expose = [](std::int64_t begin, double, double) {
      return cv::Mat(6, 8, CV_8UC1, cv::Scalar(static_cast<double>(begin / 20'000'000 % 256)));
    };
    script.first_number = static_cast<std::int64_t>(100 * c);
    script.clock_start_ns = static_cast<std::int64_t>(c) * 77'000'000'000;
    if (change) change(c, script);
    cameras.push_back({script.name, make_scripted_camera(script)});
  }
  return cameras;
}

CameraSettings fast() {
  CameraSettings settings;
  settings.width = 8;
  settings.height = 6;
  settings.rate_hz = 50;
  settings.exposure_us = 2000;
  settings.pixel_format = "Mono8";
  return settings;
}

TEST(LiveCameras, APictureAnswersItsTriggerHoweverLongItTook) {
  // The computer becomes less busy: transfers take less from picture to picture, and the line
  // through the soonest of each block (ClockFit) leads below all of them.
  const std::vector<int> delays_ms{900, 700, 500, 300, 100, 0, 0, 0};
  std::size_t taken = 0;
  LiveCameras cameras(scripted(1, [&](std::size_t, CameraScript& script) {
    script.expose = [&](std::int64_t, double, double) {
      std::this_thread::sleep_for(std::chrono::milliseconds(delays_ms[taken++]));
      return cv::Mat(6, 8, CV_8UC1, cv::Scalar(0));
    };
  }));
  CameraSettings settings = fast();
  settings.trigger = Trigger::kSoftware;
  cameras.group().configure(0, settings);
  cameras.start();
  for (const int delay_ms : delays_ms) {
    const std::int64_t since = host_now_ns();
    ASSERT_TRUE(cameras.trigger(2).front().frame) << "after " << taken << " pictures";
    EXPECT_LT(static_cast<double>(host_now_ns() - since), 1e6 * (delay_ms + 300));
    std::this_thread::sleep_for(std::chrono::milliseconds(std::max(0, 600 - delay_ms)));
  }
}

TEST(Record, FramesOfOneMomentGoToARecording) {
  const TemporaryFolder folder("record_zarr");
  LiveCameras cameras(scripted(3));
  for (std::size_t c = 0; c < 3; ++c) cameras.group().configure(c, fast());
  cameras.start();
  RecordOptions options;
  options.rate_hz = 50;
  options.frames = 20;
  const RecordReport report = record(cameras, folder.path() / "recording.zarr", options);
  EXPECT_EQ(report.frames, 20U);
  EXPECT_EQ(report.whole, 20U);
  EXPECT_THAT(report.faults, IsEmpty());
  const Recording recording = Recording::open(folder.path() / "recording.zarr");
  ASSERT_EQ(recording.row_count(), 20U);
  EXPECT_TRUE(recording.is_closed());
  for (std::size_t row = 0; row < 20; ++row) {
    const int content = recording.read(row, 0).at<std::uint8_t>(2, 2);
    for (std::size_t c = 0; c < 3; ++c) {
      ASSERT_TRUE(recording.valid(row, c));
      EXPECT_EQ(recording.read(row, c).at<std::uint8_t>(2, 2), content);
    }
    const int before = row == 0 ? content - 1 : recording.read(row - 1, 0).at<std::uint8_t>(2, 2);
    EXPECT_EQ(content, (before + 1) % 256);
  }
}

TEST(Record, ANameThatEndsWithASlashIsThatOfARecordingToo) {
  const TemporaryFolder folder("record_slash");
  LiveCameras cameras(scripted(1));
  cameras.group().configure(0, fast());
  cameras.start();
  RecordOptions options;
  options.rate_hz = 50;
  options.frames = 2;
  EXPECT_EQ(record(cameras, folder.path() / "recording.zarr" / "", options).frames, 2U);
  EXPECT_TRUE(Recording::is_one(folder.path() / "recording.zarr"));
}

TEST(Record, LostPicturesAreNamedAndNoFrame) {
  const TemporaryFolder folder("record_lost");
  LiveCameras cameras(scripted(2, [](std::size_t c, CameraScript& script) {
    if (c != 1) return;
    script.expose = [](std::int64_t begin, double, double) {
      return begin / 20'000'000 % 5 == 0 ? cv::Mat() : cv::Mat(6, 8, CV_8UC1, cv::Scalar(9));
    };
  }));
  for (std::size_t c = 0; c < 2; ++c) cameras.group().configure(c, fast());
  cameras.start();
  RecordOptions options;
  options.rate_hz = 50;
  options.frames = 20;
  const RecordReport report = record(cameras, folder.path() / "frames", options);
  EXPECT_EQ(report.frames, 20U);
  EXPECT_EQ(report.whole, 16U);
  ASSERT_EQ(report.faults.size(), 1U);
  EXPECT_EQ(report.faults[0].kind, "lost_packets");
  EXPECT_EQ(report.faults[0].device, "cam1");
  std::size_t pictures = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder.path() / "frames"))
    pictures += entry.is_regular_file();
  EXPECT_EQ(pictures, 36U);
}

TEST(Record, SoftwareTriggersSetThePace) {
  const TemporaryFolder folder("record_software");
  LiveCameras cameras(scripted(2));
  CameraSettings settings = fast();
  settings.trigger = Trigger::kSoftware;
  for (std::size_t c = 0; c < 2; ++c) cameras.group().configure(c, settings);
  cameras.start();
  RecordOptions options;
  options.rate_hz = 20;
  options.seconds = 1;
  options.software_trigger = true;
  const RecordReport report = record(cameras, folder.path() / "frames", options);
  EXPECT_THAT(report.faults, IsEmpty());
  EXPECT_NEAR(static_cast<double>(report.frames), 20, 3);
  EXPECT_EQ(report.whole, report.frames);
}

TEST(Record, AnOldFolderIsRefused) {
  const TemporaryFolder folder("record_old");
  write_text(folder.path() / "frames" / "old.txt", "x");
  LiveCameras cameras(scripted(1));
  cameras.group().configure(0, fast());
  cameras.start();
  RecordOptions options;
  options.frames = 1;
  EXPECT_THROW((void)record(cameras, folder.path() / "frames", options), InputError);
}

}  // namespace
}  // namespace pencilscan
