#include "pencilscan/lab/virtual_lab.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "pencilscan/capture/aravis_cameras.h"
#include "pencilscan/capture/gray_capture.h"
#include "pencilscan/capture/record.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/private_network.h"
#include "pencilscan/display/projector_screen.h"
#include "pencilscan/display/screen_faults.h"
#include "pencilscan/display/x_screen.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Two cameras and two projectors before a ball, on this test's own screen and network. What shows
/// and takes pictures is that of a real laboratory.
class Virtual : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!can_display()) GTEST_SKIP() << "built without SDL2 and X";
    if (!has_aravis()) GTEST_SKIP() << "built without Aravis";
    static const std::string refused = [] {
      try {
        enter_private_network(2);
        return std::string();
      } catch (const StageError& error) {
        return std::string(error.what());
      }
    }();
    if (!refused.empty()) GTEST_SKIP() << refused;
    rig_ = sample::two_by_two(sample::device_at<Camera>({560, -110, 80}, "cam0", 160, 120, 700),
                              sample::device_at<Projector>({450, 225, 45}, "proj0", 64, 48, 250),
                              sample::device_at<Projector>({386, -140, 277}, "proj1", 64, 48, 250),
                              70);
    lab_ = std::make_unique<VirtualLab>(rig_, temporary_.path() / "screen");
    lab_->room().place(SimulatedObject(make_sphere(50, 60)));
    options_.delay_ms = {40, 40};
    options_.patience_s = 0.5;
  }

  /// Cameras of the laboratory, running.
  [[nodiscard]] std::unique_ptr<LiveCameras> cameras(Trigger trigger = Trigger::kSoftware) const {
    Lab lab = lab_->lab_file();
    lab.trigger = trigger;
    auto live = std::make_unique<LiveCameras>(open_lab_cameras(lab, rig_, "lab.json"));
    for (std::size_t c = 0; c < 2; ++c)
      live->group().configure(c, settings_for(lab, rig_.cameras[c]));
    live->start();
    return live;
  }
  [[nodiscard]] std::unique_ptr<ProjectorScreen> screen() const {
    std::vector<Projector> projectors = rig_.projectors;
    for (std::size_t p = 0; p < projectors.size(); ++p) projectors[p].output = virtual_output(p);
    return open_screen(projectors);
  }
  [[nodiscard]] GrayCaptureReport capture(const GrayCaptureWatch& watch = {}) {
    const auto live = cameras();
    const auto projectors = screen();
    return capture_gray_codes(*live, *projectors, rig_, out(), options_, watch);
  }
  [[nodiscard]] std::filesystem::path out() const { return temporary_.path() / "captures"; }

  /// This projector counts as captured: one is enough.
  void skip(const char* projector) const { std::filesystem::create_directories(out() / projector); }
  static std::vector<std::string> told(const std::vector<Fault>& faults) {
    std::vector<std::string> lines;
    for (const Fault& fault : faults) lines.push_back(fault.kind + " " + to_string(fault));
    return lines;
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  Rig rig_;
  std::unique_ptr<VirtualLab> lab_;
  GrayCaptureOptions options_;
};

TEST_F(Virtual, CapturesAreThoseOfTheSimulator) {
  const GrayCaptureReport report = capture();
  EXPECT_THAT(told(report.faults), IsEmpty());
  EXPECT_EQ(report.retaken, 0U);
  // The finest columns of one projector in one camera.
  FilmOptions film;
  film.black_level = 0.004;
  constexpr int kFinest = 12;  // white, black, six bits of columns with inverses: the last bit
  const GrayCodeImage finest = gray_code_sequence(64, 48)[kFinest];
  const auto lights =
      std::vector<PanelLight>{gray_code_light(rig_.projectors[0], finest, film),
                              solid_light(rig_.projectors[1], {"black", {0, 0, 0}}, film)};
  const cv::Mat expected = apply_sensor(
      render_camera(rig_, 1, SimulatedObject(make_sphere(50, 60)), lights), SensorOptions{}, 1);
  cv::Mat taken;
  read_image(out() / "proj0" / "cam1" / "012.png").convertTo(taken, CV_8U, 255);
  EXPECT_GT(cv::mean(expected)[1], 5);
  // Light that falls across the panel's end is cut off there, which the renderer of stripes does
  // not do.
  cv::Mat difference;
  cv::absdiff(taken, expected, difference);
  cv::Mat other;
  cv::threshold(difference.reshape(1), other, 1, 255, cv::THRESH_BINARY);
  EXPECT_LE(cv::countNonZero(other), 3 * 160 * 120 / 1000);
}

TEST_F(Virtual, ACameraHasItsOwnMosaic) {
  rig_.cameras[1].mosaic = Mosaic::from_name("GRBG");
  lab_.reset();
  lab_ = std::make_unique<VirtualLab>(rig_, temporary_.path() / "screen");
  EXPECT_EQ(lab_->lab_file().cameras.at("cam0").pixel_format, "RGB8");
  EXPECT_EQ(lab_->lab_file().cameras.at("cam1").pixel_format, "BayerGR8");
}

TEST_F(Virtual, ProjectorsThatAreLateAreWaitedFor) {
  lab_->room().set_delay(0, 3 * kRoomExposureMs);
  lab_->room().set_delay(1, kRoomExposureMs);
  options_.delay_ms.clear();  // nobody measured
  const GrayCaptureReport report = capture();
  EXPECT_THAT(told(report.faults), IsEmpty());
  EXPECT_EQ(report.retaken, 0U);
}

TEST_F(Virtual, PicturesOfAProjectorThatBecameLateAreTakenAgain) {
  skip("proj1");
  options_.delay_ms = {20, 20};
  lab_->room().set_delay(0, 3 * kRoomExposureMs);
  const GrayCaptureReport report = capture();
  EXPECT_THAT(told(report.faults), IsEmpty());
  EXPECT_GT(report.retaken, 0U);
}

TEST_F(Virtual, AWindowOnTopIsNamed) {
  XScreen x;
  const auto outputs = x.outputs();
  skip("proj0");
  std::unique_ptr<ForeignWindow> mail;
  options_.retakes = 1;
  const GrayCaptureReport report = capture([&](const std::string& what, double) {
    if (what == "proj1" && !mail)
      mail = std::make_unique<ForeignWindow>(x, outputs[1], cv::Rect(20, 10, 25, 25), "Mail");
    return true;
  });
  EXPECT_THAT(told(report.faults), Contains(HasSubstr("covered proj1: output DUMMY1")));
  EXPECT_THAT(told(report.faults), Contains(HasSubstr("\"Mail\"")));
}

TEST_F(Virtual, ACameraThatDiesEndsTheCapture) {
  const auto dies = [&](const std::string& what, double share) {
    if (what == "proj1" && share > 0.6 && share < 0.7) lab_->pull_cable(1);
    return true;
  };
  const GrayCaptureReport report = capture(dies);
  ASSERT_EQ(report.faults.size(), 1U);
  EXPECT_EQ(report.faults[0].device, "cam1");
  EXPECT_TRUE(report.faults[0].kind == "dead" || report.faults[0].kind == "missing");
  EXPECT_TRUE(std::filesystem::exists(out() / "proj0"));
  EXPECT_FALSE(std::filesystem::exists(out() / "proj1"));
}

TEST_F(Virtual, LostPacketsCostRetakes) {
  skip("proj1");
  options_.retakes = 6;
  lab_->camera(0).set_lost_packets(0.005);  // of 42 a picture: every fifth lacks one
  const GrayCaptureReport report = capture();
  EXPECT_GT(report.retaken, 0U);
  EXPECT_THAT(told(report.faults), IsEmpty());
}

TEST_F(Virtual, ANetworkThatLosesEverythingIsNamed) {
  lab_->camera(0).set_lost_packets(0.5);
  const GrayCaptureReport report = capture();
  EXPECT_THAT(told(report.faults), Contains(HasSubstr("missing cam0: no picture came whole")));
}

TEST_F(Virtual, AClockThatRunsAwayIsNamed) {
  lab_->camera(1).set_clock(3000);
  const auto live = cameras(Trigger::kFree);
  RecordOptions options;
  options.rate_hz = 10;
  options.seconds = 6;
  const RecordReport report = record(*live, rig_, temporary_.path() / "frames", options);
  EXPECT_THAT(told(report.faults), Contains(HasSubstr("clock cam1")));
}

TEST_F(Virtual, AnOutputOfAnotherSizeIsRefused) {
  rig_.projectors[1].width = 80;
  try {
    (void)screen();
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("projector proj1"));
    EXPECT_THAT(error.what(), HasSubstr("64 x 48"));
  }
}

}  // namespace
}  // namespace pencilscan
