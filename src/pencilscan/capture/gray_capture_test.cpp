#include "pencilscan/capture/gray_capture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pencilscan/capture/sample_room.h"
#include "pencilscan/capture/scripted_camera.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/core/random.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/pattern/gray_code.h"

namespace pencilscan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using sample::kHeight;
using sample::kWidth;
using sample::Room;
constexpr double kRate = 100;
constexpr double kExposureUs = 2000;

class GrayCapture : public ::testing::Test {
 protected:
  void SetUp() override {
    for (std::size_t c = 0; c < 2; ++c) {
      Camera camera;
      camera.name = "cam" + std::to_string(c);
      camera.width = 2 * kWidth;
      camera.height = 2 * kHeight;
      rig_.cameras.push_back(camera);
    }
    rig_.projectors = room_.projectors();
    options_.delay_ms = {20, 20};
    options_.patience_s = 0.5;
  }

  [[nodiscard]] std::unique_ptr<LiveCameras> cameras(
      const std::function<void(std::size_t, CameraScript&)>& change = {},
      Trigger trigger = Trigger::kFree) {
    std::vector<NamedCamera> named;
    for (std::size_t c = 0; c < 2; ++c) {
      CameraScript script;
      script.name = rig_.cameras[c].name;
      script.phase_s = 0.003 * static_cast<double>(c);
      script.clock_start_ns = 1'000'000'000'000;
      script.expose = [this, c](std::int64_t begin, double exposure_us, double) {
        return room_.seen(c, begin, exposure_us);
      };
      if (change) change(c, script);
      named.push_back({script.name, make_scripted_camera(script)});
    }
    auto live = std::make_unique<LiveCameras>(std::move(named));
    CameraSettings settings;
    settings.rate_hz = kRate;
    settings.exposure_us = kExposureUs;
    settings.trigger = trigger;
    for (std::size_t c = 0; c < 2; ++c) live->group().configure(c, settings);
    live->start();
    return live;
  }

  [[nodiscard]] GrayCaptureReport capture(LiveCameras& live, const GrayCaptureWatch& watch = {}) {
    return capture_gray_codes(live, room_, rig_, out(), options_, watch);
  }
  [[nodiscard]] std::filesystem::path out() const { return temporary_.path() / "captures"; }

  /// The panel column that a camera pixel decodes to.
  [[nodiscard]] int decoded_column(const std::string& projector, const std::string& camera, int x,
                                   int y) const {
    const auto sequence = gray_code_sequence(kWidth, kHeight);
    std::vector<std::uint8_t> bright;
    for (std::size_t i = 0; i < sequence.size(); ++i) {
      const std::string number = std::to_string(i);
      const std::string file = std::string(3 - number.size(), '0') + number + ".png";
      const cv::Mat picture = read_image(out() / projector / camera / file);
      bright.push_back(picture.at<cv::Vec3f>(y, x)[0] > 0.3 ? 1 : 0);
    }
    return decode_gray_code(sequence, bright).column;
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  Room room_;
  Rig rig_;
  GrayCaptureOptions options_;
};

TEST_F(GrayCapture, EveryPictureShowsItsPattern) {
  options_.solids = true;
  const auto live = cameras();
  const GrayCaptureReport report = capture(*live);
  EXPECT_THAT(report.faults, IsEmpty());
  EXPECT_EQ(report.retaken, 0U);
  // White, black, 6 + 6 bits with inverses, 6 solids, and white again; of two projectors.
  EXPECT_EQ(report.pictures, 2U * (2 + 24 + 6 + 1));
  for (const char* projector : {"proj0", "proj1"}) {
    for (const char* camera : {"cam0", "cam1"}) {
      for (const int x : {0, 31, 64, 101, 127})
        EXPECT_EQ(decoded_column(projector, camera, x, 40), x / 2);
      const cv::Mat red = read_image(out() / projector / camera / "red.png");
      EXPECT_GT(red.at<cv::Vec3f>(9, 9)[0], 0.5);
      EXPECT_LT(red.at<cv::Vec3f>(9, 9)[2], 0.1);
    }
  }
}

TEST_F(GrayCapture, SoftwareTriggersDoAsWell) {
  const auto live = cameras({}, Trigger::kSoftware);
  const GrayCaptureReport report = capture(*live);
  EXPECT_THAT(report.faults, IsEmpty());
  EXPECT_EQ(report.retaken, 0U);
  EXPECT_EQ(decoded_column("proj1", "cam1", 77, 3), 38);
}

TEST_F(GrayCapture, LatePicturesAreTakenAgain) {
  options_.delay_ms = {5, 5};
  room_.delay_ns[0] = room_.delay_ns[1] = 40'000'000;  // two frames and more
  const auto live = cameras();
  const GrayCaptureReport report = capture(*live);
  EXPECT_GT(report.retaken, 0U);
  EXPECT_THAT(report.faults, IsEmpty());
  for (const int x : {5, 50, 120}) EXPECT_EQ(decoded_column("proj0", "cam0", x, 9), x / 2);
}

TEST_F(GrayCapture, PicturesThatStayLateAreNamed) {
  options_.delay_ms = {5, 5};
  options_.retakes = 1;
  room_.delay_ns[0] = room_.delay_ns[1] = 300'000'000;
  const auto live = cameras();
  const GrayCaptureReport report = capture(*live);
  ASSERT_FALSE(report.faults.empty());
  for (const Fault& fault : report.faults)
    EXPECT_TRUE(fault.kind == "picture" || fault.kind == "unseen" || fault.kind == "moved")
        << fault.kind;
}

TEST_F(GrayCapture, AMovedSceneIsNamed) {
  const auto live = cameras();
  const GrayCaptureReport report = capture(*live, [&](const std::string& what, double share) {
    if (what == "proj0" && share > 0.3) room_.moved = true;
    return true;
  });
  std::vector<std::string> moved;
  for (const Fault& fault : report.faults)
    if (fault.kind == "moved") moved.push_back(fault.device + " " + fault.what.substr(0, 11));
  EXPECT_THAT(moved, ElementsAre("cam0 under proj0", "cam1 under proj0"));
}

TEST_F(GrayCapture, RefusedPicturesAreTakenAnew) {
  options_.delay_ms = {5, 5};
  options_.retakes = 1;
  room_.delay_ns[0] = 300'000'000;
  const auto live = cameras();
  const GrayCaptureReport refused = capture(*live);
  EXPECT_THAT(refused.refused, ElementsAre("proj0"));
  EXPECT_FALSE(std::filesystem::exists(out() / "proj0"));
  EXPECT_TRUE(std::filesystem::exists(out() / "proj1"));
  room_.delay_ns[0] = room_.delay_ns[1] = 15'000'000;
  options_.delay_ms = {20, 20};
  const GrayCaptureReport again = capture(*live);
  EXPECT_EQ(again.resumed, 1U);
  EXPECT_THAT(again.faults, IsEmpty());
  EXPECT_THAT(again.refused, IsEmpty());
  EXPECT_EQ(decoded_column("proj0", "cam0", 90, 3), 45);
}

TEST_F(GrayCapture, EveryProjectorHasItsOwnFaults) {
  options_.delay_ms = {5, 5};
  options_.retakes = 1;
  room_.delay_ns[0] = room_.delay_ns[1] = 300'000'000;
  const auto live = cameras();
  EXPECT_THAT(capture(*live).refused, ElementsAre("proj0", "proj1"));
}

TEST_F(GrayCapture, WhatMovedUnderOneProjectorIsTakenAnewUnderAll) {
  std::filesystem::create_directories(out());
  const auto live = cameras();
  const GrayCaptureReport report = capture(*live, [&](const std::string& what, double share) {
    if (what == "proj1" && share > 0.7) room_.moved = true;
    return true;
  });
  EXPECT_THAT(report.refused, ElementsAre("proj0", "proj1"));
  EXPECT_FALSE(std::filesystem::exists(out() / "proj0"));
  const GrayCaptureReport again = capture(*live);
  EXPECT_EQ(again.resumed, 0U);
  EXPECT_THAT(again.faults, IsEmpty());
}

TEST_F(GrayCapture, AnotherCaptureThanTheOneThatIsThereIsRefused) {
  const auto live = cameras();
  (void)capture(*live);
  const auto complaint = [&] {
    const int shows = room_.shows;
    try {
      (void)capture(*live);
      return std::string("accepted");
    } catch (const InputError& error) {
      EXPECT_EQ(room_.shows, shows);  // nothing is shown before
      return std::string(error.what()).substr(out().string().size() + 1);
    }
  };
  EXPECT_EQ(complaint(), "accepted");
  options_.solids = true;
  EXPECT_THAT(complaint(), HasSubstr("proj0/capture.json: solids = false: must be true"));
  options_.solids = false;
  options_.inverses = false;
  EXPECT_THAT(complaint(), HasSubstr("inverses = true: must be false"));
  options_.inverses = true;
  rig_.cameras[1].width /= 2;
  EXPECT_THAT(complaint(), HasSubstr("cameras.cam1.width = 128: must be 64"));
  rig_.cameras[1].name = "cam7";
  EXPECT_THAT(complaint(), HasSubstr("cameras.cam1 = "));
  rig_.cameras[1].name = "cam1";
  rig_.cameras[1].width *= 2;
  // Pictures of another program have no note, and are believed.
  for (const char* projector : {"proj0", "proj1"})
    std::filesystem::remove(out() / projector / "capture.json");
  options_.solids = true;
  EXPECT_EQ(complaint(), "accepted");
}

TEST_F(GrayCapture, AFullDiskEndsItInOrder) {
  // Big pictures: while one write fails, other threads are still at work on theirs.
  const auto live = cameras([](std::size_t, CameraScript& script) {
    script.expose = [](std::int64_t, double, double) {
      return cv::Mat(1500, 2000, CV_8UC3, cv::Scalar::all(99));
    };
  });
  EXPECT_THROW((void)capture(*live,
                             [&](const std::string&, double) {
                               // A file where the folder of a camera has to be.
                               std::filesystem::remove_all(out() / ".proj0.part" / "cam1");
                               write_text(out() / ".proj0.part" / "cam1", "full");
                               return true;
                             }),
               std::exception);
}

TEST_F(GrayCapture, ACameraThatSeesNothingHasNoFolder) {
  room_.blind = [](std::size_t camera, std::size_t projector) {
    return camera == 1 && projector == 0;
  };
  const auto live = cameras();
  const GrayCaptureReport report = capture(*live);
  EXPECT_THAT(report.faults, IsEmpty());
  EXPECT_FALSE(std::filesystem::exists(out() / "proj0" / "cam1"));
  EXPECT_TRUE(std::filesystem::exists(out() / "proj0" / "cam0" / "025.png"));
  EXPECT_TRUE(std::filesystem::exists(out() / "proj1" / "cam1" / "000.png"));
  EXPECT_EQ(report.views[0][1].share, 0);
  EXPECT_GT(report.views[0][0].share, 0.9);
}

TEST_F(GrayCapture, ADarkProjectorIsNamed) {
  room_.blind = [](std::size_t, std::size_t projector) { return projector == 1; };
  const auto live = cameras();
  const GrayCaptureReport report = capture(*live);
  ASSERT_EQ(report.faults.size(), 1U);
  EXPECT_EQ(report.faults[0].kind, "unseen");
  EXPECT_EQ(report.faults[0].device, "proj1");
}

TEST_F(GrayCapture, ADeadCameraIsNamed) {
  options_.retakes = 1;
  options_.patience_s = 0.05;
  const auto live = cameras([](std::size_t c, CameraScript& script) {
    if (c == 1) script.expose = [](std::int64_t, double, double) { return cv::Mat(); };
  });
  const GrayCaptureReport report = capture(*live);
  ASSERT_FALSE(report.faults.empty());
  EXPECT_EQ(report.faults[0].kind, "missing");
  EXPECT_EQ(report.faults[0].device, "cam1");
  EXPECT_THAT(report.faults[0].what, HasSubstr("no picture came"));
}

TEST_F(GrayCapture, GoesOnWhereItWasStopped) {
  const auto live = cameras();
  (void)capture(*live, [](const std::string& what, double) { return what == "proj0"; });
  EXPECT_TRUE(std::filesystem::exists(out() / "proj0"));
  EXPECT_FALSE(std::filesystem::exists(out() / "proj1"));
  EXPECT_FALSE(std::filesystem::exists(out() / ".proj1.part"));
  const int shows = room_.shows;
  const GrayCaptureReport report = capture(*live);
  EXPECT_EQ(report.resumed, 1U);
  EXPECT_LT(room_.shows - shows, 40);
  EXPECT_EQ(decoded_column("proj1", "cam0", 90, 3), 45);
}

/// Pictures of blocks for the checks alone.
cv::Mat blocks(const std::function<bool(int, int)>& bright, float light = 0.6F,
               float black = 0.02F) {
  cv::Mat picture(24, 32, CV_32FC1);
  for (int y = 0; y < picture.rows; ++y)
    for (int x = 0; x < picture.cols; ++x)
      picture.at<float>(y, x) = black + (bright(x, y) ? light : 0);
  return picture;
}

TEST(PictureCheck, ATornPictureIsTold) {
  const cv::Mat white = blocks([](int, int) { return true; });
  const cv::Mat black = blocks([](int, int) { return false; });
  const LitView view = lit_view(white, black);
  EXPECT_EQ(view.share, 1);
  const auto stripes = [](int size) { return [size](int x, int) { return x / size % 2 == 0; }; };
  const cv::Mat pattern = blocks(stripes(8));
  const cv::Mat inverse = white + black - pattern;
  EXPECT_EQ(pair_trouble(pattern, inverse, view), "");
  EXPECT_THAT(pair_trouble(pattern, pattern, view), HasSubstr("100 % of what it lights is alike"));
  // The inverse came when half of the exposure still had the pattern.
  EXPECT_THAT(pair_trouble(pattern, 0.5 * pattern + 0.5 * inverse, view), HasSubstr("alike"));
  // Stored with gamma 2.2, and with light scattered within the scene.
  const auto stored = [](const cv::Mat& picture) {
    cv::Mat result;
    cv::pow(picture + 0.02 * cv::mean(picture)[0], 1 / 2.2, result);
    return result;
  };
  const LitView stored_view = lit_view(stored(white), stored(black));
  EXPECT_EQ(pair_trouble(stored(pattern), stored(inverse), stored_view), "");
}

TEST(PictureCheck, TellsAMovedSceneFromAWarmLamp) {
  const cv::Mat white = blocks([](int x, int y) { return x < 20 && y > 3; });
  const cv::Mat black = blocks([](int, int) { return false; });
  const LitView view = lit_view(white, black);
  EXPECT_EQ(white_again_trouble(white, white, view).why, "");
  EXPECT_THAT(white_again_trouble(white, 0.8 * white, view).why, HasSubstr("lamp"));
  const cv::Mat moved = blocks([](int x, int y) { return x < 17 && y > 3; });
  EXPECT_THAT(white_again_trouble(white, moved, view).why, HasSubstr("moved"));
}

TEST(PictureCheck, MeansOfBlocksAreFinerThanTheLevelsOfThePicture) {
  cv::Mat image(4, 8, CV_8UC3, cv::Scalar::all(6));
  image.at<cv::Vec3b>(0, 0) = {7, 7, 10};
  const cv::Mat coarse = coarse_picture(image);
  ASSERT_EQ(coarse.size(), cv::Size(2, 1));
  EXPECT_NEAR(coarse.at<float>(0, 0), (6 + 6.0 / 48) / 255, 1e-4);
  EXPECT_NEAR(coarse.at<float>(0, 1), 6.0 / 255, 1e-4);
}

TEST(PictureCheck, NoiseOfDimLightIsNoMotion) {
  // A projector that lights the rim of what a camera sees: blocks of .02 to .1 of the full scale,
  // the dimmest uncertain by a tenth.
  Random random(1);
  cv::Mat white(24, 32, CV_32FC1, cv::Scalar(0));
  for (int y = 4; y < white.rows; ++y)
    for (int x = 0; x < 20; ++x)
      white.at<float>(y, x) = 0.022F + 0.004F * static_cast<float>((7 * x + 3 * y) % 20);
  const auto noisy = [&](const cv::Mat& picture) {
    cv::Mat result = picture.clone();
    for (auto value = result.begin<float>(); value != result.end<float>(); ++value)
      *value += 0.1F * std::sqrt(0.02F * *value) * static_cast<float>(random.normal());
    return result;
  };
  const cv::Mat before = noisy(white);
  const LitView view = lit_view(before, cv::Mat(white.size(), CV_32FC1, cv::Scalar(0)));
  EXPECT_EQ(white_again_trouble(before, noisy(white), view).why, "");
  cv::Mat moved(white.size(), CV_32FC1, cv::Scalar(0));
  const cv::Size rest(white.cols - 3, white.rows);
  white(cv::Rect({0, 0}, rest)).copyTo(moved(cv::Rect({3, 0}, rest)));
  EXPECT_THAT(white_again_trouble(before, noisy(moved), view).why, HasSubstr("moved"));
}

}  // namespace
}  // namespace pencilscan
