#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <cerrno>
#include <fstream>
#include <map>
#include <thread>

#include "pencilscan/capture/file_cameras.h"
#include "pencilscan/capture/live_cameras.h"
#include "pencilscan/capture/record.h"
#include "pencilscan/capture/scripted_camera.h"
#include "pencilscan/capture/sensor_pixels.h"
#include "pencilscan/capture/v4l2_camera.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/recording/recording.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(SensorPixels, NamesOfGenicamAreUnderstood) {
  const auto bayer = layout_from_genicam("BayerGB12");
  ASSERT_TRUE(bayer);
  EXPECT_EQ(bayer->mosaic, "GBRG");
  EXPECT_EQ(bayer->bits, 12);
  EXPECT_EQ(layout_from_genicam("RGB8")->channels, 3);
  EXPECT_TRUE(layout_from_genicam("BGR8")->bgr);
  for (const char* name : {"Mono12Packed", "Mono10p", "BayerRG8Packed", "YUV422_8", "", "Mono"})
    EXPECT_FALSE(layout_from_genicam(name)) << name;
}

TEST(SensorPixels, FullScaleStaysFullScale) {
  const std::vector<std::uint16_t> values{0, 1, 2048, 4095};
  const cv::Mat picture =
      picture_from_bytes(values.data(), 8, 2, 2, *layout_from_genicam("Mono12"));
  EXPECT_EQ(picture.at<std::uint16_t>(0, 0), 0);
  EXPECT_EQ(picture.at<std::uint16_t>(0, 1), 16);
  EXPECT_EQ(picture.at<std::uint16_t>(1, 0), 2048 * 16 + 8);
  EXPECT_EQ(picture.at<std::uint16_t>(1, 1), 65535);
  EXPECT_TRUE(picture_from_bytes(values.data(), 7, 2, 2, *layout_from_genicam("Mono12")).empty());
}

TEST(SensorPixels, BlueFirstBecomesRedFirst) {
  const std::vector<std::uint8_t> bytes{1, 2, 3, 4, 5, 6, 0, 0};  // rows of two pixels, padded
  const cv::Mat picture =
      picture_from_bytes(bytes.data(), 6, 2, 1, *layout_from_genicam("BGR8"), 8);
  EXPECT_EQ(picture.at<cv::Vec3b>(0, 1), cv::Vec3b(6, 5, 4));
}

CameraSettings small_picture() {
  CameraSettings settings;
  settings.width = 8;
  settings.height = 6;
  return settings;
}

TEST(FolderCamera, GivesNewPicturesOnceWholeInOrder) {
  const TemporaryFolder folder("folder_camera");
  write_image(folder.path() / "old.png", cv::Mat(6, 8, CV_8UC1, cv::Scalar(1)));
  const auto camera = open_folder_camera(folder.path());
  camera->configure(small_picture());
  camera->start();
  EXPECT_FALSE(camera->next(Seconds(0.1)));
  write_image(folder.path() / "b.png", cv::Mat(6, 8, CV_8UC3, cv::Scalar(10, 20, 30)));
  const auto first = camera->next(Seconds(2));
  ASSERT_TRUE(first);
  EXPECT_EQ(first->status, PictureStatus::kComplete);
  EXPECT_EQ(first->image.at<cv::Vec3b>(0, 0), cv::Vec3b(10, 20, 30));
  EXPECT_NEAR(static_cast<double>(first->timestamp_ns), static_cast<double>(host_now_ns()), 1e9);
  // Half a file, and then the rest.
  write_image(folder.path() / ".c.png", cv::Mat(6, 8, CV_16UC1, cv::Scalar(5000)));
  const std::string bytes = read_file(folder.path() / ".c.png");
  std::ofstream(folder.path() / "c.PNG", std::ios::binary) << bytes.substr(0, bytes.size() / 2);
  EXPECT_FALSE(camera->next(Seconds(0.2)));
  std::ofstream(folder.path() / "c.PNG", std::ios::binary) << bytes;
  const auto second = camera->next(Seconds(2));
  ASSERT_TRUE(second);
  EXPECT_EQ(second->image.at<std::uint16_t>(0, 0), 5000);
  write_image(folder.path() / "d.png", cv::Mat(5, 8, CV_8UC1, cv::Scalar(1)));
  const auto third = camera->next(Seconds(2));
  ASSERT_TRUE(third);
  EXPECT_EQ(third->status, PictureStatus::kWrongSize);
  EXPECT_THAT(third->remark, HasSubstr("d.png has 8 x 5 px, not 8 x 6"));
}

TEST(FolderCamera, AsksForPicturesWhenTriggered) {
  const TemporaryFolder folder("folder_trigger");
  const auto camera = open_folder_camera(folder.path());
  CameraSettings settings;
  settings.trigger = Trigger::kSoftware;
  camera->configure(settings);
  camera->start();
  camera->trigger();
  camera->trigger();
  EXPECT_EQ(read_file(folder.path() / "request.txt"), "1\n");
}

TEST(CommandCamera, RunsAProgramPerPicture) {
  const TemporaryFolder folder("command_camera");
  write_image(folder.path() / "shot.png", cv::Mat(6, 8, CV_8UC1, cv::Scalar(77)));
  const auto camera = open_command_camera({"cp", (folder.path() / "shot.png").string(), "{file}"});
  CameraSettings settings = small_picture();
  EXPECT_THROW(camera->configure(settings), InputError);  // free
  settings.trigger = Trigger::kSoftware;
  camera->configure(settings);
  camera->start();
  EXPECT_FALSE(camera->next(Seconds(0.01)));
  camera->trigger();
  const auto frame = camera->next(Seconds(5));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->image.at<std::uint8_t>(3, 3), 77);
}

TEST(CommandCamera, NamesAProgramThatFails) {
  const auto camera = open_command_camera({"false", "{file}"});
  CameraSettings settings;
  settings.trigger = Trigger::kSoftware;
  camera->configure(settings);
  camera->start();
  camera->trigger();
  const auto frame = camera->next(Seconds(5));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->status, PictureStatus::kUnreadable);
  EXPECT_EQ(frame->remark, "false ended with 1");
  EXPECT_THROW((void)open_command_camera({"gphoto2", "--capture-image"}), InputError);
}

/// A driver that answers as the kernel would.
class FakeDriver {
 public:
  [[nodiscard]] VideoKernel kernel() {
    VideoKernel kernel;
    kernel.open = [](const std::string&) { return 3; };
    kernel.close = [this](int) { closed = true; };
    kernel.control = [this](int, unsigned long request, void* argument) {
      return answer(request, argument);
    };
    kernel.map = [this](int, std::size_t length, std::size_t offset) -> void* {
      memory[offset].resize(length);
      return memory[offset].data();
    };
    kernel.unmap = [](void*, std::size_t) {};
    kernel.wait = [this](int, Seconds) { return !queued.empty() && !unplugged; };
    return kernel;
  }

  std::map<std::uint32_t, std::int32_t> controls{
      {V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_APERTURE_PRIORITY},
      {V4L2_CID_EXPOSURE_ABSOLUTE, 156},
      {V4L2_CID_GAIN, 64}};
  std::vector<std::uint32_t> formats{V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_SGRBG8};
  v4l2_pix_format format{};
  std::map<std::size_t, std::vector<std::uint8_t>> memory;
  std::vector<std::uint32_t> queued;
  std::uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  std::uint32_t sequence = 0;
  bool streaming = false;
  bool unplugged = false;
  bool closed = false;

 private:
  template <typename T>
  static T& as(void* argument) {
    return *static_cast<T*>(argument);
  }
  int fail(int code) {
    errno = code;
    return -1;
  }
  int answer(unsigned long request, void* argument) {
    if (unplugged) return fail(ENODEV);
    switch (request) {
      case VIDIOC_QUERYCAP: {
        auto& capability = as<v4l2_capability>(argument);
        std::snprintf(reinterpret_cast<char*>(capability.card), 32, "Fake");
        capability.capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        return 0;
      }
      case VIDIOC_ENUM_FMT: {
        auto& entry = as<v4l2_fmtdesc>(argument);
        if (entry.index >= formats.size()) return fail(EINVAL);
        entry.pixelformat = formats[entry.index];
        return 0;
      }
      case VIDIOC_S_FMT: {
        auto& wanted = as<v4l2_format>(argument).fmt.pix;
        wanted.width = std::min(wanted.width, 64U);  // a small sensor
        wanted.bytesperline = wanted.width * (wanted.pixelformat == V4L2_PIX_FMT_YUYV ? 2 : 1);
        wanted.sizeimage = wanted.bytesperline * wanted.height;
        format = wanted;
        return 0;
      }
      case VIDIOC_G_FMT:
        as<v4l2_format>(argument).fmt.pix = format;
        return 0;
      case VIDIOC_G_CTRL: {
        auto& control = as<v4l2_control>(argument);
        if (!controls.contains(control.id)) return fail(EINVAL);
        control.value = controls[control.id];
        return 0;
      }
      case VIDIOC_S_CTRL: {
        const auto& control = as<v4l2_control>(argument);
        if (!controls.contains(control.id)) return fail(EINVAL);
        controls[control.id] = control.value;
        return 0;
      }
      case VIDIOC_S_PARM:
        return 0;
      case VIDIOC_REQBUFS:
        return 0;
      case VIDIOC_QUERYBUF: {
        auto& buffer = as<v4l2_buffer>(argument);
        buffer.length = format.sizeimage;
        buffer.m.offset = buffer.index * 4096;
        return 0;
      }
      case VIDIOC_QBUF:
        queued.push_back(as<v4l2_buffer>(argument).index);
        return 0;
      case VIDIOC_STREAMON:
        streaming = true;
        return 0;
      case VIDIOC_STREAMOFF:
        streaming = false;
        queued.clear();
        return 0;
      case VIDIOC_DQBUF: {
        auto& buffer = as<v4l2_buffer>(argument);
        buffer.index = queued.front();
        queued.erase(queued.begin());
        auto& bytes = memory[buffer.index * 4096];
        for (std::size_t i = 0; i < bytes.size(); ++i)
          bytes[i] = static_cast<std::uint8_t>(i + sequence);
        buffer.bytesused = static_cast<std::uint32_t>(bytes.size());
        buffer.flags = flags;
        buffer.timestamp = {12, 345};
        buffer.sequence = sequence++;
        return 0;
      }
      default:
        return fail(ENOTTY);
    }
  }
};

CameraSettings of_size(int width, int height) {
  CameraSettings settings;
  settings.width = width;
  settings.height = height;
  return settings;
}

TEST(VideoCamera, TakesTheRawMosaicBeforeWhatWasMadeOfIt) {
  FakeDriver driver;
  const auto camera = open_v4l2_camera("/dev/video7", driver.kernel());
  const CameraSettings made = camera->configure(of_size(64, 48));
  EXPECT_EQ(made.pixel_format, "BayerGR8");
  camera->start();
  const auto frame = camera->next(Seconds(1));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->status, PictureStatus::kComplete);
  EXPECT_EQ(frame->mosaic, "GRBG");
  EXPECT_EQ(frame->image.size(), cv::Size(64, 48));
  EXPECT_EQ(frame->image.at<std::uint8_t>(0, 5), 5);
  EXPECT_EQ(frame->timestamp_ns, 12'000'345'000LL);
  EXPECT_EQ(camera->next(Seconds(1))->number, 1);
  EXPECT_EQ(driver.queued.size(), 8U);  // every buffer went back
}

TEST(VideoCamera, SwitchesAutomaticsOffAndPutsThemBack) {
  FakeDriver driver;
  {
    const auto camera = open_v4l2_camera("/dev/video7", driver.kernel());
    CameraSettings settings = of_size(64, 48);
    settings.exposure_us = 33333;
    EXPECT_EQ(camera->configure(settings).exposure_us, 33300);
    EXPECT_EQ(driver.controls[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_MANUAL);
    EXPECT_EQ(driver.controls[V4L2_CID_EXPOSURE_ABSOLUTE], 333);
    camera->start();
  }
  EXPECT_EQ(driver.controls[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_APERTURE_PRIORITY);
  EXPECT_EQ(driver.controls[V4L2_CID_EXPOSURE_ABSOLUTE], 156);
  EXPECT_FALSE(driver.streaming);
  EXPECT_TRUE(driver.closed);
}

TEST(VideoCamera, RefusesOtherSizesAndTriggers) {
  FakeDriver driver;
  const auto camera = open_v4l2_camera("/dev/video7", driver.kernel());
  EXPECT_THROW(camera->configure(of_size(1280, 960)), InputError);
  CameraSettings wire = of_size(64, 48);
  wire.trigger = Trigger::kWire;
  EXPECT_THROW(camera->configure(wire), InputError);
}

TEST(VideoCamera, NamesDamagedPicturesAndAPulledPlug) {
  FakeDriver driver;
  const auto camera = open_v4l2_camera("/dev/video7", driver.kernel());
  camera->configure(of_size(64, 48));
  camera->start();
  driver.flags |= V4L2_BUF_FLAG_ERROR;
  EXPECT_EQ(camera->next(Seconds(1))->status, PictureStatus::kLostPackets);
  EXPECT_THAT(camera->trouble(), IsEmpty());
  VideoKernel kernel = driver.kernel();
  driver.unplugged = true;
  EXPECT_FALSE(camera->next(Seconds(0)));
}

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
  CameraSettings settings = small_picture();
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
