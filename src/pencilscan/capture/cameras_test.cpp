#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <fstream>
#include <future>
#include <memory>
#include <thread>

#include "pencilscan/capture/camera_group.h"
#include "pencilscan/capture/file_cameras.h"
#include "pencilscan/capture/sensor_pixels.h"
#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;

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

/// A camera that hangs in configure() until it is let go, or refuses.
class StubbornCamera final : public CameraDevice {
 public:
  struct State {
    std::promise<void> let_go;
    std::atomic<bool> hangs = false;
    std::atomic<bool> refuses = false;
    std::atomic<bool> runs = false;
    std::atomic<bool> starts = true;
    std::promise<void> closed;
  };
  explicit StubbornCamera(std::shared_ptr<State> state) : state_(std::move(state)) {}
  ~StubbornCamera() override { state_->closed.set_value(); }
  const CameraInfo& info() const override { return info_; }
  CameraSettings configure(const CameraSettings& settings) override {
    if (state_->hangs) state_->let_go.get_future().wait();
    if (state_->refuses) throw InputError("camera", "gain", "", "must be less");
    return settings;
  }
  void start() override {
    if (!state_->starts) throw StageError("no room on the bus");
    state_->runs = true;
  }
  void stop() override { state_->runs = false; }
  void trigger() override {}
  std::optional<CameraFrame> next(Seconds patience) override {
    std::this_thread::sleep_for(patience);
    return std::nullopt;
  }

 private:
  std::shared_ptr<State> state_;
  CameraInfo info_;
};

std::vector<NamedCamera> stubborn(const std::shared_ptr<StubbornCamera::State>& state) {
  std::vector<NamedCamera> cameras;
  cameras.push_back({"cam0", std::make_unique<StubbornCamera>(state)});
  return cameras;
}

TEST(CameraGroup, ACameraThatDoesNotAnswerIsNamedAndLeft) {
  const auto state = std::make_shared<StubbornCamera::State>();
  {
    CameraGroup group(stubborn(state), 0.2);
    group.configure(0, {});
    group.start([](std::size_t, const CameraFrame&) {});
    EXPECT_TRUE(group.faults().empty());
    state->hangs = true;
    EXPECT_THROW(group.configure(0, {}), StageError);
    ASSERT_EQ(group.faults().size(), 1U);
    EXPECT_EQ(group.faults()[0].kind, "dead");
    EXPECT_EQ(to_string(group.faults()[0]), "cam0: it did not answer for 0.2 s");
    group.stop();
  }
  auto closed = state->closed.get_future();
  EXPECT_EQ(closed.wait_for(Seconds(0)), std::future_status::timeout);  // it still hangs
  state->let_go.set_value();
  EXPECT_EQ(closed.wait_for(Seconds(10)), std::future_status::ready);
}

TEST(CameraGroup, ACameraThatRefusesGoesOn) {
  const auto state = std::make_shared<StubbornCamera::State>();
  CameraGroup group(stubborn(state));
  group.start([](std::size_t, const CameraFrame&) {});
  state->refuses = true;
  EXPECT_THROW(group.configure(0, {}), InputError);
  EXPECT_TRUE(state->runs);
}

TEST(CameraGroup, ACameraThatDoesNotStartAgainIsNamed) {
  const auto state = std::make_shared<StubbornCamera::State>();
  CameraGroup group(stubborn(state));
  group.start([](std::size_t, const CameraFrame&) {});
  EXPECT_TRUE(group.faults().empty());
  state->starts = false;
  EXPECT_THROW(group.configure(0, {}), StageError);
  ASSERT_EQ(group.faults().size(), 1U);
  EXPECT_EQ(to_string(group.faults()[0]), "cam0: no room on the bus");
  state->starts = true;
  group.configure(0, {});
  EXPECT_TRUE(group.faults().empty());
  EXPECT_TRUE(state->runs);
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
  EXPECT_THAT(third->remark, HasSubstr("its pictures are 8 x 5, the rig says 8 x 6"));
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
  EXPECT_EQ(frame->remark, "its program ended with 1 and made no file");
  EXPECT_THROW((void)open_command_camera({"gphoto2", "--capture-image"}), InputError);
}

}  // namespace
}  // namespace pencilscan
