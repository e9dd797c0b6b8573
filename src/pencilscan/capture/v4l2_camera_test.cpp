#include "pencilscan/capture/v4l2_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <cerrno>
#include <map>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

using ::testing::IsEmpty;

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
  bool broken = false;
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
        if (broken) return fail(EIO);
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

TEST(VideoCamera, SaysThatItGivesNoPictureUntilItDoesAgain) {
  FakeDriver driver;
  const auto camera = open_v4l2_camera("/dev/video7", driver.kernel());
  camera->configure(of_size(64, 48));
  camera->start();
  driver.broken = true;
  EXPECT_FALSE(camera->next(Seconds(0)));
  EXPECT_THAT(camera->trouble(), ::testing::HasSubstr("no picture"));
  driver.broken = false;
  EXPECT_TRUE(camera->next(Seconds(0)));
  EXPECT_EQ(camera->trouble(), "");
}

}  // namespace
}  // namespace pencilscan
