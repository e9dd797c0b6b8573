#include "pencilscan/jobs/watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

constexpr std::size_t kFrames = 300;

/// Three cameras and three projectors that see the same thing frame after frame.
class Watch : public ::testing::Test {
 protected:
  Watch() {
    Random random(7);
    const auto about = [&](double value) { return value * (1 + random.normal(0, 0.02)); };
    for (std::size_t k = 0; k < kFrames; ++k) {
      FrameRow& row = rows_.emplace_back();
      row.name = std::to_string(k);
      row.status.state = FrameState::kDone;
      for (std::size_t c = 0; c < 3; ++c) {
        CameraRow& camera = row.cameras.emplace_back();
        camera.labelled_share = about(0.9);
        camera.line_width_px = about(1.4);
        camera.line_height = about(0.2);
        camera.image_level = about(0.1);
        row.projector_points.push_back(std::round(about(5000)));
      }
      for (std::size_t d = 0; d < 6; ++d) row.device_crossing_px.push_back(about(0.08));
    }
  }
  std::vector<SequenceEvent> events() { return watch_sequence(rows_, devices_).events; }
  void expect_one_moved(const std::string& frame, const std::string& camera) {
    const auto found = events();
    ASSERT_THAT(found, SizeIs(1));
    EXPECT_EQ(found[0].frame, frame);
    EXPECT_EQ(found[0].device, camera);
    EXPECT_THAT(found[0].text, HasSubstr("camera " + camera + " moved"));
  }
  void from(std::size_t first, const std::function<void(FrameRow&)>& change) {
    for (std::size_t k = first; k < kFrames; ++k) change(rows_[k]);
  }

  std::vector<FrameRow> rows_;
  SequenceDevices devices_{{"cam0", "cam1", "cam2"}, {"proj0", "proj1", "proj2"}};
};

TEST_F(Watch, NothingHappens) {
  const WatchReport report = watch_sequence(rows_, devices_);
  EXPECT_THAT(report.events, IsEmpty());
  EXPECT_THAT(report.odd, IsEmpty());
}

TEST_F(Watch, ABumpedCameraIsNamed) {
  from(120, [](FrameRow& row) {
    row.device_crossing_px[1] += 0.4;
    for (const std::size_t p : {3U, 4U, 5U}) row.device_crossing_px[p] += 0.1;
  });
  expect_one_moved("120", "cam1");
}

TEST_F(Watch, ABumpThatNoiseOfCrossingsHidesShowsAsAShift) {
  Random random(3);
  for (FrameRow& row : rows_) {
    for (double& px : row.device_crossing_px) px = 0.17 + random.normal(0, 0.02);
    for (CameraRow& camera : row.cameras) {
      camera.shift_x_px = random.normal(0.03, 0.02);
      camera.shift_y_px = random.normal(0, 0.02);
    }
  }
  EXPECT_THAT(events(), IsEmpty());
  from(150, [](FrameRow& row) {
    row.cameras[2].shift_x_px += 0.5;
    row.device_crossing_px[2] += 0.09;
  });
  expect_one_moved("150", "cam2");
}

TEST_F(Watch, ASmallerShareOfAsManyLabelsIsNoLoss) {
  const auto lines_of_cam0_go = [&](double labels_left) {
    Random random(5);
    for (std::size_t k = 0; k < kFrames; ++k) {
      CameraRow& camera = rows_[k].cameras[0];
      camera.labelled_share = (k < 150 ? 0.79 : 0.67) + random.normal(0, 0.01);
      camera.labelled_points = (k < 150 ? 5000 : 5000 * labels_left) + random.normal(0, 50);
    }
  };
  lines_of_cam0_go(1);
  EXPECT_THAT(events(), IsEmpty());
  lines_of_cam0_go(0.85);
  const auto found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].device, "cam0");
  EXPECT_EQ(found[0].kind, "labelled");
}

TEST_F(Watch, ABumpedProjectorIsNamedAndOneOfTwoIsNot) {
  const std::vector<FrameRow> steady = rows_;
  from(120, [](FrameRow& row) {
    for (double& px : row.device_crossing_px) px += 0.2;
    row.device_crossing_px[4] += 0.2;
  });
  auto found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].device, "proj1");
  rows_ = steady;
  from(120, [](FrameRow& row) {
    for (double& px : row.device_crossing_px) px += 0.2;
  });
  found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].device, "");
  EXPECT_THAT(found[0].text, HasSubstr("do not tell"));
}

TEST_F(Watch, FocusLampAndProjectorAreToldApart) {
  from(100, [](FrameRow& row) { row.cameras[2].line_width_px *= 1.5; });
  from(150, [](FrameRow& row) {
    for (CameraRow& camera : row.cameras) camera.image_level *= 2;
  });
  from(200, [](FrameRow& row) { row.projector_points[0] = 0; });
  const auto found = events();
  ASSERT_THAT(found, SizeIs(3));
  EXPECT_EQ(found[0].device, "cam2");
  EXPECT_THAT(found[0].text, HasSubstr("out of focus"));
  EXPECT_EQ(found[1].device, "");
  EXPECT_EQ(found[1].frame, "150");
  EXPECT_THAT(found[1].text, HasSubstr("3 cameras"));
  EXPECT_THAT(found[1].text, HasSubstr("lamp"));
  EXPECT_EQ(found[2].device, "proj0");
  EXPECT_THAT(found[2].text, HasSubstr("off, covered"));
}

TEST_F(Watch, ALampOfThreeFramesEnds) {
  for (const std::size_t k : {30U, 31U, 32U})
    for (CameraRow& camera : rows_[k].cameras) camera.image_level *= 2;
  const auto found = events();
  ASSERT_THAT(found, SizeIs(2));
  EXPECT_EQ(found[0].frame, "30");
  EXPECT_THAT(found[0].text, HasSubstr("a lamp"));
  EXPECT_EQ(found[1].frame, "33");
  EXPECT_THAT(found[1].text, HasSubstr("less light"));
}

TEST_F(Watch, ACameraThatIsPutBackSoonIsBack) {
  Random random(3);
  for (FrameRow& row : rows_) {
    for (CameraRow& camera : row.cameras) {
      camera.shift_x_px = random.normal(0, 0.02);
      camera.shift_y_px = random.normal(0, 0.02);
    }
  }
  for (std::size_t k = 30; k < 34; ++k) {
    rows_[k].cameras[1].shift_x_px += 0.5;
    rows_[k].cameras[1].shift_y_px -= 0.5;
    rows_[k].device_crossing_px[1] += 0.4;
  }
  const auto found = events();
  ASSERT_THAT(found, SizeIs(2));
  EXPECT_EQ(found[0].frame, "30");
  EXPECT_THAT(found[0].text, HasSubstr("camera cam1 moved"));
  EXPECT_EQ(found[1].frame, "34");
  EXPECT_EQ(found[1].device, "cam1");
  EXPECT_THAT(found[1].text, HasSubstr("is again where the rig has it"));
}

TEST_F(Watch, AProjectorThatComesOnAgainIsNoLamp) {
  for (std::size_t k = 100; k < 150; ++k) {
    rows_[k].projector_points[0] = 2;
    for (CameraRow& camera : rows_[k].cameras) camera.image_level *= 0.7;
  }
  const auto found = events();
  ASSERT_THAT(found, SizeIs(4));
  EXPECT_EQ(found[2].kind, "level");
  EXPECT_EQ(found[2].frame, "150");
  EXPECT_THAT(found[2].text, HasSubstr("more light, the projectors' too"));
  EXPECT_EQ(found[3].device, "proj0");
  for (const SequenceEvent& event : found) EXPECT_THAT(event.text, Not(HasSubstr("lamp")));
}

TEST_F(Watch, CrossingsThatComeBackAfterTheyWereTooFewAreNoMotion) {
  for (std::size_t k = 100; k < 150; ++k) rows_[k].device_crossing_px[1] = kUnknownFigure;
  EXPECT_THAT(events(), IsEmpty());
}

TEST_F(Watch, ACameraThatHangsIsNamed) {
  for (std::size_t k = 0; k < kFrames; ++k) {
    for (std::size_t c = 0; c < 3; ++c) rows_[k].cameras[c].picture = 1 + 3 * k + c;
  }
  EXPECT_THAT(events(), IsEmpty());
  for (const std::size_t k : {50U, 51U, 52U})
    rows_[k].cameras[1].picture = rows_[49].cameras[1].picture;
  ASSERT_THAT(events(), SizeIs(1));
  EXPECT_EQ(events()[0].frame, "50");
  EXPECT_EQ(events()[0].device, "cam1");
  EXPECT_EQ(events()[0].after, 3);
}

TEST_F(Watch, OneBadFrameIsOddAndNoEvent) {
  rows_[50].cameras[0].labelled_share = 0.2;
  rows_[60].status.state = FrameState::kFailed;
  const WatchReport report = watch_sequence(rows_, devices_);
  EXPECT_THAT(report.events, IsEmpty());
  ASSERT_THAT(report.odd, SizeIs(1));
  EXPECT_EQ(report.odd[0].row, 50U);
  EXPECT_THAT(report.odd[0].text, HasSubstr("camera cam0"));
}

// More is seen that is no line: the share falls, the labels stay.
TEST_F(Watch, AFrameWithAsManyLabelsIsNotOdd) {
  Random random(6);
  for (FrameRow& row : rows_) row.cameras[0].labelled_points = 5000 + random.normal(0, 50);
  rows_[50].cameras[0].labelled_share = 0.7;
  EXPECT_THAT(watch_sequence(rows_, devices_).odd, IsEmpty());
  rows_[50].cameras[0].labelled_points = 3900;
  const WatchReport report = watch_sequence(rows_, devices_);
  ASSERT_THAT(report.odd, SizeIs(1));
  EXPECT_EQ(report.odd[0].row, 50U);
}

}  // namespace
}  // namespace pencilscan
