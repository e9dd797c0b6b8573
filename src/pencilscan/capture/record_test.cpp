#include "pencilscan/capture/record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "pencilscan/capture/camera_picture.h"
#include "pencilscan/capture/file_cameras.h"
#include "pencilscan/capture/live_cameras.h"
#include "pencilscan/capture/scripted_camera.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/recording/recording.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;
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

void start_with_software_triggers(LiveCameras& cameras) {
  CameraSettings settings = fast();
  settings.trigger = Trigger::kSoftware;
  for (std::size_t c = 0; c < cameras.group().size(); ++c) cameras.group().configure(c, settings);
  cameras.start();
}

/// A rig of these cameras.
Rig rig_of(const LiveCameras& cameras) {
  Rig rig;
  for (std::size_t c = 0; c < cameras.group().size(); ++c)
    rig.cameras.emplace_back().name = cameras.group().name(c);
  return rig;
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
  start_with_software_triggers(cameras);
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
  const RecordReport report =
      record(cameras, rig_of(cameras), folder.path() / "recording.zarr", options);
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
  EXPECT_EQ(record(cameras, rig_of(cameras), folder.path() / "recording.zarr" / "", options).frames,
            2U);
  EXPECT_TRUE(Recording::is_one(folder.path() / "recording.zarr"));
}

/// A camera that delivers a red surface behind a mosaic, in frames or a recording.
class RawCamera {
 public:
  RawCamera()
      : cameras_(scripted(1, [](std::size_t, CameraScript& script) {
          script.mosaic = "RGGB";
          script.expose = [](std::int64_t, double, double) {
            cv::Mat raw(6, 8, CV_8UC1, cv::Scalar(0));
            for (int y = 0; y < raw.rows; y += 2)
              for (int x = 0; x < raw.cols; x += 2) raw.at<std::uint8_t>(y, x) = 200;
            return raw;
          };
        })) {
    CameraSettings settings = fast();
    settings.pixel_format = "BayerRG8";
    cameras_.group().configure(0, settings);
    cameras_.start();
  }

  void take(const std::string& mosaic, const std::filesystem::path& out) {
    Rig rig = rig_of(cameras_);
    rig.cameras[0].mosaic = Mosaic::from_name(mosaic);
    RecordOptions options;
    options.rate_hz = 50;
    options.frames = 2;
    EXPECT_EQ(record(cameras_, rig, out, options).frames, 2U);
  }

 private:
  LiveCameras cameras_;
};

TEST(Record, AMosaicThatTheRigDoesNotStateIsMadeColour) {
  const TemporaryFolder folder("record_mosaic");
  RawCamera camera;
  camera.take("", folder.path() / "frames");
  const cv::Mat picture = read_image(folder.path() / "frames" / "000001" / "cam0.png");
  ASSERT_EQ(picture.channels(), 3);
  EXPECT_NEAR(picture.at<cv::Vec3f>(3, 4)[0], 200.0 / 255, 0.01);
  EXPECT_EQ(picture.at<cv::Vec3f>(3, 4)[2], 0);
  camera.take("", folder.path() / "recording.zarr");
  const cv::Mat stored = Recording::open(folder.path() / "recording.zarr").read(1, 0);
  EXPECT_EQ(stored.at<cv::Vec3b>(3, 4), cv::Vec3b(200, 0, 0));
}

TEST(Record, AMosaicThatTheRigStatesStaysRaw) {
  const TemporaryFolder folder("record_raw");
  RawCamera camera;
  camera.take("RGGB", folder.path() / "frames");
  EXPECT_EQ(read_stored_image(folder.path() / "frames" / "000001" / "cam0.png").channels(), 1);
  camera.take("RGGB", folder.path() / "recording.zarr");
  const cv::Mat stored = Recording::open(folder.path() / "recording.zarr").read(1, 0);
  ASSERT_EQ(stored.type(), CV_8UC1);
  EXPECT_EQ(stored.at<std::uint8_t>(2, 4), 200);
}

TEST(Record, AnotherMosaicThanTheRigStatesIsNoSuccess) {
  const TemporaryFolder folder("record_other_mosaic");
  RawCamera camera;
  try {
    camera.take("BGGR", folder.path() / "frames");
    FAIL();
  } catch (const StageError& error) {
    EXPECT_STREQ(error.what(), "cam0 delivers RGGB; the rig states the mosaic BGGR");
  }
}

TEST(Mosaics, AFormatThatContradictsTheRigIsRefused) {
  Camera camera;
  camera.name = "cam0";
  CameraSettings made;
  made.pixel_format = "BayerRG8";
  EXPECT_NO_THROW(check_mosaic(camera, made, "lab.json"));
  camera.mosaic = Mosaic::from_name("RGGB");
  EXPECT_NO_THROW(check_mosaic(camera, made, "lab.json"));
  camera.mosaic = Mosaic::from_name("BGGR");
  try {
    check_mosaic(camera, made, "lab.json");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("lab.json: cameras.cam0.pixel_format = BayerRG8: must"));
    EXPECT_THAT(error.what(), HasSubstr("BGGR; the camera delivers RGGB"));
  }
  made.pixel_format = "RGB8";
  EXPECT_THROW(check_mosaic(camera, made, "lab.json"), InputError);
  made.pixel_format = "BayerRG8Packed";  // of unknown layout
  EXPECT_NO_THROW(check_mosaic(camera, made, "lab.json"));
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
  const RecordReport report = record(cameras, rig_of(cameras), folder.path() / "frames", options);
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
  start_with_software_triggers(cameras);
  RecordOptions options;
  options.rate_hz = 20;
  options.seconds = 1;
  options.software_trigger = true;
  const RecordReport report = record(cameras, rig_of(cameras), folder.path() / "frames", options);
  EXPECT_THAT(report.faults, IsEmpty());
  EXPECT_NEAR(static_cast<double>(report.frames), 20, 3);
  EXPECT_EQ(report.whole, report.frames);
}

TEST(Record, OnePicturePerFolderIsAFrameOfWhatDoesNotMove) {
  const TemporaryFolder folder("record_folders");
  std::vector<NamedCamera> named;
  for (const char* name : {"cam0", "cam1"}) {
    std::filesystem::create_directories(folder.path() / name);
    named.push_back({name, open_folder_camera(folder.path() / name)});
  }
  LiveCameras cameras(std::move(named));
  cameras.start();
  std::thread other_program([&] {
    for (const char* name : {"cam0", "cam1"}) {
      std::this_thread::sleep_for(std::chrono::milliseconds(400));  // by hand, one after the other
      write_image(folder.path() / name / "shot.png", cv::Mat(6, 8, CV_32FC3, cv::Scalar::all(1)));
    }
  });
  RecordOptions options;
  options.frames = 1;
  options.still_s = 3;
  const RecordReport report = record(cameras, rig_of(cameras), folder.path() / "out", options);
  other_program.join();
  EXPECT_THAT(report.faults, IsEmpty());
  EXPECT_EQ(report.whole, 1U);
}

TEST(Record, ASlowCameraIsWaitedForWhereNothingMoves) {
  const TemporaryFolder folder("record_still");
  LiveCameras cameras(scripted(2, [](std::size_t c, CameraScript& script) {
    script.expose = [c](std::int64_t, double, double) {
      if (c == 1) std::this_thread::sleep_for(std::chrono::milliseconds(1200));
      return cv::Mat(6, 8, CV_8UC1, cv::Scalar(9));
    };
  }));
  start_with_software_triggers(cameras);
  RecordOptions options;
  options.frames = 2;
  options.software_trigger = true;
  options.still_s = 10;
  const RecordReport report = record(cameras, rig_of(cameras), folder.path() / "out", options);
  EXPECT_THAT(report.faults, IsEmpty());
  EXPECT_EQ(report.whole, 2U);
  EXPECT_EQ(report.frames, 2U);
}

TEST(Record, WhatIsWrongWithFilesIsSaidInsteadOfANetwork) {
  const TemporaryFolder folder("record_command");
  std::vector<NamedCamera> named;
  named.push_back({"cam0", open_command_camera({"false", "{file}"})});
  LiveCameras cameras(std::move(named));
  start_with_software_triggers(cameras);
  RecordOptions options;
  options.seconds = 0.5;
  options.software_trigger = true;
  const RecordReport report = record(cameras, rig_of(cameras), folder.path() / "out", options);
  ASSERT_EQ(report.faults.size(), 1U);
  EXPECT_THAT(to_string(report.faults[0]),
              HasSubstr("cam0: its program ended with 1 and made no file ("));
}

TEST(Record, AnOldFolderIsRefused) {
  const TemporaryFolder folder("record_old");
  write_text(folder.path() / "frames" / "old.txt", "x");
  LiveCameras cameras(scripted(1));
  cameras.group().configure(0, fast());
  cameras.start();
  RecordOptions options;
  options.frames = 1;
  EXPECT_THROW((void)record(cameras, rig_of(cameras), folder.path() / "frames", options),
               InputError);
}

}  // namespace
}  // namespace pencilscan
