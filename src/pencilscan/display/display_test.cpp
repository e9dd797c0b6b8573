#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <set>

#include "pencilscan/core/error.h"
#include "pencilscan/display/dummy_screen.h"
#include "pencilscan/display/output.h"
#include "pencilscan/display/projector_picture.h"
#include "pencilscan/display/projector_windows.h"
#include "pencilscan/display/screen_faults.h"
#include "pencilscan/display/shown_check.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/pattern/gray_code.h"
#include "pencilscan/pattern/solid_color.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Projector panel(const std::string& name, int width, int height) {
  Projector projector;
  projector.name = name;
  projector.width = width;
  projector.height = height;
  projector.patterns = {LinePattern{}};
  return projector;
}

DisplayOutput output(const std::string& name, int x, int width, int height) {
  DisplayOutput result;
  result.name = name;
  result.connected = result.lit = true;
  result.x = x;
  result.width = result.mode_width = result.native_width = width;
  result.height = result.mode_height = result.native_height = height;
  result.refresh_hz = 60;
  return result;
}

/// Two projectors on two outputs that fit.
struct TwoOutputs {
  std::vector<Projector> projectors{panel("proj0", 640, 480), panel("proj1", 800, 600)};
  std::vector<DisplayOutput> outputs{output("HDMI-1", 0, 640, 480), output("DP-1", 640, 800, 600)};

  [[nodiscard]] std::vector<std::string> kinds() const {
    const std::vector<OutputUse> uses{{&projectors[0], &outputs[0]}, {&projectors[1], &outputs[1]}};
    std::vector<std::string> found;
    for (const Fault& fault : output_faults(uses, outputs)) {
      EXPECT_FALSE(fault.what.empty());
      found.push_back(fault.device + " " + fault.kind);
    }
    return found;
  }
};

TEST(OutputFaults, AreNoneWhereSizesFit) { EXPECT_THAT(TwoOutputs().kinds(), IsEmpty()); }

TEST(OutputFaults, AreNamedOneByOne) {
  const auto with = [](auto change) {
    TwoOutputs two;
    change(two.outputs[1]);
    return two.kinds();
  };
  using Output = DisplayOutput;
  EXPECT_THAT(with([](Output& o) { o.lit = false; }), ElementsAre("proj1 no_signal"));
  EXPECT_THAT(with([](Output& o) { o.mode_width = o.width = o.native_width = 1024; }),
              ElementsAre("proj1 size"));
  EXPECT_THAT(with([](Output& o) { o.native_width = 1024; }), ElementsAre("proj1 not_native"));
  EXPECT_THAT(with([](Output& o) { o.native_width = o.native_height = 0; }), IsEmpty());
  EXPECT_THAT(with([](Output& o) { o.turned = true; }), ElementsAre("proj1 turned"));
  EXPECT_THAT(with([](Output& o) { o.scaled = true; }), ElementsAre("proj1 scaled"));
  EXPECT_THAT(with([](Output& o) { o.interlaced = true; }), ElementsAre("proj1 interlaced"));
  EXPECT_THAT(with([](Output& o) { o.x = 0; }), ElementsAre("proj0 mirrored", "proj1 mirrored"));
  EXPECT_THAT(with([](Output& o) { o.refresh_hz = 50; }), ElementsAre("proj1 refresh"));
  EXPECT_THAT(with([](Output& o) { o.refresh_hz = 59.94; }), IsEmpty());
}

TEST(Outputs, BelongToProjectorsByName) {
  const TwoOutputs two;
  Rig rig;
  rig.projectors = two.projectors;
  const auto complaint = [&](const std::map<std::string, std::string>& named,
                             const std::string& lab = "") {
    try {
      (void)uses_of(rig, two.outputs, named, "rig.json", lab);
      return std::string("accepted");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
  };
  EXPECT_THAT(complaint({}), HasSubstr("rig.json: projectors[0].output"));
  EXPECT_THAT(complaint({{"proj0", "HDMI-1"}, {"proj1", "VGA-1"}}),
              HasSubstr("VGA-1: this computer has no such output; connected are: HDMI-1, DP-1"));
  EXPECT_THAT(complaint({{"proj0", "DP-1"}, {"proj1", "DP-1"}}),
              HasSubstr("is the output of proj0, too"));
  EXPECT_THAT(complaint({{"proj7", "DP-1"}}),
              HasSubstr("command line: --output = proj7=DP-1: must be of a projector of rig.json"));
  EXPECT_THAT(complaint({{"proj0", "HDMI-9"}}),
              HasSubstr("command line: --output = proj0=HDMI-9: this computer has no such"));
  EXPECT_THAT(complaint({{"proj0", "HDMI-9"}}, "lab.json"),
              HasSubstr("lab.json: projectors.proj0.output = HDMI-9: this computer has no such"));
  EXPECT_THAT(complaint({{"proj7", "DP-1"}}, "lab.json"),
              HasSubstr("lab.json: projectors.proj7.output = DP-1: must be of a projector of rig"));
  rig.projectors[0].output = "DP-1";
  const auto uses = uses_of(rig, two.outputs, {{"proj1", "HDMI-1"}}, "rig.json");
  EXPECT_EQ(uses[0].output->name, "DP-1");
  EXPECT_EQ(uses[1].output->name, "HDMI-1");
}

TEST(ProjectorPicture, IsReadFromTextAndBack) {
  for (const char* text : {"black", "white", "lines", "gray:0", "gray:17", "red", "grey50",
                           "identify", "columns", "rows", "focus"}) {
    const auto picture = picture_from_text(text);
    ASSERT_TRUE(picture) << text;
    EXPECT_EQ(to_string(*picture), text);
  }
  for (const char* text : {"", "gray", "gray:", "gray:-1", "gray:1x", "pink", "White"})
    EXPECT_FALSE(picture_from_text(text)) << text;
}

TEST(ProjectorPicture, ShowsWhatPatternWrites) {
  const Projector projector = panel("p", 64, 48);
  const auto render = [&](const std::string& text) {
    return render_picture(*picture_from_text(text), projector);
  };
  const auto sequence = gray_code_sequence(64, 48);
  for (const std::size_t i : {std::size_t{0}, std::size_t{5}, sequence.size() - 1}) {
    cv::Mat gray;
    cv::cvtColor(render("gray:" + std::to_string(i)), gray, cv::COLOR_RGB2GRAY);
    EXPECT_EQ(cv::norm(gray, render_gray_code(sequence[i], 64, 48), cv::NORM_INF), 0) << i;
  }
  cv::Mat lines;
  render_patterns(projector.patterns, 64, 48).convertTo(lines, CV_8U, 255);
  EXPECT_EQ(cv::norm(render("lines"), lines, cv::NORM_INF), 0);
  EXPECT_EQ(render("red").at<cv::Vec3b>(3, 3), cv::Vec3b(255, 0, 0));
  EXPECT_EQ(cv::mean(render("columns"))[0], 127.5);
  EXPECT_EQ(cv::mean(render("rows"))[1], 127.5);
  EXPECT_THROW((void)render("gray:" + std::to_string(sequence.size())), InputError);
}

TEST(ShownCheck, TellsBlackCoveredAndOther) {
  const cv::Mat drawn = render_picture(*picture_from_text("focus"), panel("p", 64, 48));
  EXPECT_FALSE(compare_shown(drawn, drawn));
  EXPECT_FALSE(compare_shown(drawn - cv::Scalar::all(1), drawn));  // a visual that rounds
  EXPECT_EQ(compare_shown(drawn * 0, drawn)->kind, "black");
  cv::Mat covered = drawn.clone();
  covered(cv::Rect(10, 8, 20, 12)).setTo(cv::Scalar(10, 200, 30));
  const auto found = compare_shown(covered, drawn);
  EXPECT_EQ(found->kind, "covered");
  EXPECT_EQ(found->where, cv::Rect(10, 8, 20, 12));
  cv::Mat scaled;
  cv::resize(drawn, scaled, drawn.size() / 2);
  EXPECT_EQ(compare_shown(scaled, drawn)->kind, "other");
  cv::resize(scaled, scaled, drawn.size());
  EXPECT_EQ(compare_shown(scaled, drawn)->kind, "other");
}

TEST(DummyScreen, TakesNoNumberOfAnotherServer) {
  if (!can_display()) GTEST_SKIP() << "built without SDL2 and X";
  const TemporaryFolder folder("display_numbers");
  EXPECT_EQ(free_display_number(folder.path()), 0);
  write_text(folder.path() / ".X11-unix" / "X0", "");  // without a lock
  write_text(folder.path() / ".X1-lock", "");          // without a socket
  EXPECT_EQ(free_display_number(folder.path()), 2);
}

/// Three outputs of different sizes on an X server without hardware.
class OnScreen : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!can_display()) GTEST_SKIP() << "built without SDL2 and X";
    screen_ = std::make_unique<DummyScreen>(
        temporary_.path(),
        std::vector<DummyScreen::Output>{{640, 512, 60}, {320, 240, 60}, {640, 480, 60}});
    rig_.projectors = {panel("proj0", 640, 512), panel("proj1", 320, 240),
                       panel("proj2", 640, 480)};
    rig_.projectors[0].output = "DUMMY2";  // none where it would be by number
    rig_.projectors[1].output = "DUMMY1";
    rig_.projectors[2].output = "DUMMY0";
    std::swap(rig_.projectors[0].height, rig_.projectors[2].height);
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  std::unique_ptr<DummyScreen> screen_;
  Rig rig_;
};

TEST_F(OnScreen, EveryOutputShowsItsProjectorsPixels) {
  XScreen screen;
  const auto outputs = screen.outputs();
  const auto uses = uses_of(rig_, outputs, {}, "rig");
  EXPECT_NEAR(uses[0].output->refresh_hz, 60, 0.01);
  ProjectorWindows windows(uses);
  EXPECT_THAT(windows.check(), IsEmpty());
  for (const char* what : {"lines", "gray:9", "identify", "black"}) {
    for (std::size_t p = 0; p < 3; ++p) {
      const cv::Mat picture = render_picture(*picture_from_text(what), rig_.projectors[p]);
      EXPECT_GT(windows.show(p, picture), 0);
      EXPECT_EQ(cv::norm(windows.read_back(p), picture, cv::NORM_INF), 0) << what << " " << p;
    }
    EXPECT_THAT(windows.check(), IsEmpty());
  }
}

TEST_F(OnScreen, AnotherWindowOnTopIsNamed) {
  XScreen screen;
  const auto outputs = screen.outputs();
  ProjectorWindows windows(uses_of(rig_, outputs, {}, "rig"));
  windows.show(2, render_picture(*picture_from_text("focus"), rig_.projectors[2]));
  std::vector<Fault> faults;
  {
    const ForeignWindow foreign(screen, outputs[0], cv::Rect(100, 50, 200, 80), "Mail");
    faults = windows.check();
  }
  ASSERT_EQ(faults.size(), 1U);
  EXPECT_EQ(faults[0].kind, "covered");
  EXPECT_EQ(faults[0].device, "proj2");
  EXPECT_THAT(faults[0].what, HasSubstr("columns 100 to 299, rows 50 to 129"));
  EXPECT_THAT(faults[0].what, HasSubstr("on top lies \"Mail\""));
}

TEST_F(OnScreen, OutputsOfAnotherSizeAreRefused) {
  XScreen screen;
  const auto outputs = screen.outputs();
  rig_.projectors[1].width = 400;
  try {
    ProjectorWindows windows(uses_of(rig_, outputs, {}, "rig"));
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("projector proj1"));
    EXPECT_THAT(error.what(),
                HasSubstr("sends 320 x 240 px, the projector of the rig has 400 x 240"));
  }
}

TEST_F(OnScreen, ColoursArePlainWhileWindowsLiveAndPutBack) {
  XScreen screen;
  const auto outputs = screen.outputs();
  const NightLight night(screen, outputs[1]);
  EXPECT_TRUE(screen.alters_colors(outputs[1]));
  {
    ProjectorWindows windows(uses_of(rig_, outputs, {}, "rig"));
    EXPECT_FALSE(screen.alters_colors(outputs[1]));
    const NightLight again(screen, outputs[1]);
    const auto faults = windows.check();
    ASSERT_EQ(faults.size(), 1U);
    EXPECT_EQ(faults[0].kind, "colors");
  }
  EXPECT_TRUE(screen.alters_colors(outputs[1]));
}

}  // namespace
}  // namespace pencilscan
