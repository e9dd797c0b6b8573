#include "pencilscan/jobs/watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/core/random.h"
#include "pencilscan/jobs/device_light.h"

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
        for (std::size_t p = 0; p < 3; ++p) camera.height_of_projector.push_back(about(0.2));
        camera.image_level = about(0.1);
        row.projector_points.push_back(std::round(about(5000)));
      }
      for (std::size_t d = 0; d < 6; ++d) row.device_crossing_px.push_back(about(0.08));
      row.device_crossing_expected_px.assign(6, kUnknownFigure);
    }
  }
  void let_crossings_say_shifts() {
    Random random(3);
    for (FrameRow& row : rows_) {
      for (CameraRow& camera : row.cameras) {
        camera.shift_x_px = random.normal(0, 0.02);
        camera.shift_y_px = random.normal(0, 0.02);
      }
    }
  }
  WatchReport watch() {
    find_device_light(rows_, devices_);
    return watch_sequence(rows_, devices_);
  }
  std::vector<SequenceEvent> events() { return watch().events; }
  void lose_crossings(std::size_t device, std::size_t frames) {
    for (std::size_t k = 0; k < frames; ++k) rows_[k].device_crossing_px[device] = kUnknownFigure;
  }
  void expect_one_moved(const std::string& frame, const std::string& camera) {
    const auto found = events();
    ASSERT_THAT(found, SizeIs(1));
    EXPECT_EQ(rows_[found[0].first].name, frame);
    EXPECT_TRUE(found[0].lasts);
    EXPECT_EQ(found[0].device, camera);
    EXPECT_THAT(found[0].text, HasSubstr("camera " + camera + " moved"));
  }
  void from(std::size_t first, const std::function<void(FrameRow&)>& change) {
    for (std::size_t k = first; k < kFrames; ++k) change(rows_[k]);
  }

  std::vector<FrameRow> rows_;
  SequenceDevices devices_{{"cam0", "cam1", "cam2"}, {"proj0", "proj1", "proj2"}};
};

TEST_F(Watch, DevicesOfWhichFramesSayTooLittleAreNamed) {
  lose_crossings(1, kFrames / 2);
  EXPECT_THAT(watch().not_watched, IsEmpty());
  lose_crossings(1, kFrames / 2 + 1);
  lose_crossings(5, kFrames);
  EXPECT_THAT(watch().not_watched,
              ::testing::ElementsAre(devices_.cameras[1], devices_.projectors[2]));
}

TEST_F(Watch, NothingHappens) {
  const WatchReport report = watch();
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
  EXPECT_EQ(found[1].first, 150U);
  EXPECT_THAT(found[1].text, HasSubstr("3 cameras"));
  EXPECT_THAT(found[1].text, HasSubstr("lamp"));
  EXPECT_EQ(found[2].device, "proj0");
  EXPECT_THAT(found[2].text, HasSubstr("off, covered"));
}

TEST_F(Watch, ALampOfThreeFramesEnds) {
  for (const std::size_t k : {30U, 31U, 32U})
    for (CameraRow& camera : rows_[k].cameras) camera.image_level *= 2;
  const auto found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(when_text(found[0], rows_), "in frames 30 to 32");
  EXPECT_THAT(found[0].text, HasSubstr("a lamp"));
}

// Lines drown in its light.
TEST_F(Watch, WhatALampTakesOfTheNamedCurvesIsOneEventWithIt) {
  const std::vector<FrameRow> steady = rows_;
  const auto lamp_from = [&](std::size_t first, std::size_t end, double lost) {
    for (std::size_t k = first; k < end; ++k)
      for (CameraRow& camera : rows_[k].cameras) {
        camera.image_level *= 2;
        camera.labelled_share -= lost;
      }
  };
  lamp_from(100, kFrames, 0.2);
  auto found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].kind, "level");
  EXPECT_THAT(found[0].text,
              HasSubstr("a lamp); with it the share of curves that has a line, in 3 of them"));
  // It goes off; what it took of the curves of one camera stays lost.
  rows_ = steady;
  lamp_from(100, 150, 0.2);
  ASSERT_THAT(events(), SizeIs(1));
  for (std::size_t k = 150; k < kFrames; ++k) rows_[k].cameras[2].labelled_share -= 0.2;
  found = events();
  ASSERT_THAT(found, SizeIs(2));
  EXPECT_EQ(found[0].kind == "labelled" ? found[0].device : found[1].device, "cam2");
  // A projector that goes off meanwhile, and lines that are lost at another time, stay.
  rows_ = steady;
  lamp_from(100, kFrames, 0.2);
  from(102, [](FrameRow& row) { row.projector_points[0] = 0; });
  from(200, [](FrameRow& row) { row.cameras[1].labelled_share -= 0.2; });
  found = events();
  ASSERT_THAT(found, SizeIs(3));
  EXPECT_EQ(found[0].kind, "level");
  EXPECT_EQ(found[1].kind, "projector");
  EXPECT_EQ(found[2].kind, "labelled");
  // Of one camera alone: something bright before it.
  rows_ = steady;
  from(100, [](FrameRow& row) {
    row.cameras[1].image_level *= 2;
    row.cameras[1].labelled_share -= 0.5;
  });
  found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].device, "cam1");
  EXPECT_THAT(found[0].text, HasSubstr("; the share of its curves that has a line is 0.3"));
}

TEST_F(Watch, ACameraThatIsPutBackSoonIsBack) {
  let_crossings_say_shifts();
  for (std::size_t k = 30; k < 34; ++k) {
    rows_[k].cameras[1].shift_x_px += 0.5;
    rows_[k].cameras[1].shift_y_px -= 0.5;
    rows_[k].device_crossing_px[1] += 0.4;
  }
  auto found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(when_text(found[0], rows_), "in frames 30 to 33");
  EXPECT_THAT(found[0].text, HasSubstr("camera cam1 moved"));
  // It stood elsewhere from the beginning.
  for (std::size_t k = 0; k < 30; ++k) {
    rows_[k].cameras[1].shift_x_px += 0.5;
    rows_[k].device_crossing_px[1] += 0.4;
  }
  for (std::size_t k = 30; k < 34; ++k) rows_[k].cameras[1].shift_y_px += 0.5;
  found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(when_text(found[0], rows_), "from frame 34");
  EXPECT_EQ(found[0].device, "cam1");
  EXPECT_THAT(found[0].text, HasSubstr("is again where the rig has it"));
}

TEST_F(Watch, AProjectorThatComesOnAgainIsNoLamp) {
  for (std::size_t k = 100; k < 150; ++k) {
    rows_[k].projector_points[0] = 2;
    for (CameraRow& camera : rows_[k].cameras) camera.image_level *= 0.7;
  }
  auto found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].device, "proj0");
  EXPECT_NEAR(found[0].after, 2, 1e-9);
  EXPECT_EQ(when_text(found[0], rows_), "in frames 100 to 149");
  // It was off from the beginning.
  for (std::size_t k = 0; k < 100; ++k) {
    rows_[k].projector_points[0] = 2;
    for (CameraRow& camera : rows_[k].cameras) camera.image_level *= 0.7;
  }
  found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].device, "proj0");
  EXPECT_EQ(when_text(found[0], rows_), "from frame 150");
}

// The object turns away meanwhile: its light does not come back with the projector's.
TEST_F(Watch, WhatGoesWithAProjectorIsNoEventThatOutlastsIt) {
  for (std::size_t k = 100; k < 120; ++k) rows_[k].projector_points[0] = 0;
  from(100, [](FrameRow& row) {
    row.cameras[0].image_level *= 0.7;
    row.cameras[1].labelled_share -= 0.2;
  });
  auto found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].device, "proj0");
  EXPECT_EQ(when_text(found[0], rows_), "in frames 100 to 119");
  // A lamp is none of a projector that goes off.
  from(100, [](FrameRow& row) { row.cameras[2].image_level *= 2; });
  found = events();
  ASSERT_THAT(found, SizeIs(2));
  EXPECT_THAT(found[0].text + found[1].text, HasSubstr("lamp"));
}

// Names are those of other lines: the shift that these few meet with is of no line.
TEST_F(Watch, WhatFramesSayOfACameraIsSaidOnce) {
  let_crossings_say_shifts();
  for (std::size_t k = 150; k < 180; ++k) {
    rows_[k].device_crossing_px[2] += 0.5;
    if (k >= 160) rows_[k].cameras[2].shift_y_px -= 0.3;
  }
  auto found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(when_text(found[0], rows_), "in frames 150 to 179");
  for (std::size_t k = 140; k < 180; ++k)
    rows_[k].findings.push_back({"device-is-off", "cam2", "words"});
  found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].kind, "device-is-off");
  EXPECT_EQ(when_text(found[0], rows_), "in frames 140 to 179");
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
  EXPECT_EQ(when_text(events()[0], rows_), "in frames 50 to 52");
  EXPECT_EQ(events()[0].device, "cam1");
  EXPECT_EQ(events()[0].after, 3);
}

TEST_F(Watch, OneBadFrameIsOddAndNoEvent) {
  rows_[50].cameras[0].labelled_share = 0.2;
  rows_[60].status.state = FrameState::kFailed;
  const WatchReport report = watch();
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
  EXPECT_THAT(watch().odd, IsEmpty());
  rows_[50].cameras[0].labelled_points = 3900;
  const WatchReport report = watch();
  ASSERT_THAT(report.odd, SizeIs(1));
  EXPECT_EQ(report.odd[0].row, 50U);
}

TEST_F(Watch, ADimProjectorIsNamedAndNoCamera) {
  from(200, [](FrameRow& row) {
    for (CameraRow& camera : row.cameras) camera.height_of_projector[1] *= 0.4;
  });
  const WatchReport report = watch();
  EXPECT_THAT(report.odd, IsEmpty());
  ASSERT_THAT(report.events, SizeIs(1));
  EXPECT_EQ(when_text(report.events[0], rows_), "from frame 200");
  EXPECT_EQ(report.events[0].kind, "light");
  EXPECT_EQ(report.events[0].device, "proj1");
  EXPECT_NEAR(report.events[0].after / report.events[0].before, 0.4, 0.02);
  EXPECT_THAT(report.events[0].text, HasSubstr("of that before (dimmer"));
}

TEST_F(Watch, ACameraThatTakesInLessLightIsNamedAndNoProjector) {
  from(200, [](FrameRow& row) {
    for (double& height : row.cameras[2].height_of_projector) height *= 0.5;
  });
  const auto found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].kind, "height");
  EXPECT_EQ(found[0].device, "cam2");
}

TEST_F(Watch, AProjectorThatWasDarkAccusesNoFrameAfterIt) {
  for (FrameRow& row : rows_) {
    row.device_crossing_expected_px.assign(6, 0.25);
    for (double& px : row.device_crossing_px) px += 0.1;
  }
  for (const std::size_t k : {8U, 9U, 10U}) {
    rows_[k].projector_points[1] = k == 9 ? 5 : 0;
    for (CameraRow& camera : rows_[k].cameras) camera.height_of_projector[1] = kUnknownFigure;
    // Fewer lines cross, and the rest meets better.
    for (double& px : rows_[k].device_crossing_px) px -= 0.1;
  }
  rows_.resize(13);
  const WatchReport report = watch();
  EXPECT_THAT(report.odd, IsEmpty());
  ASSERT_THAT(report.events, SizeIs(1));
  EXPECT_EQ(when_text(report.events[0], rows_), "in frames 8 to 10");
  EXPECT_EQ(report.events[0].device, "proj1");
  EXPECT_EQ(report.events[0].after, 0);
  EXPECT_THAT(report.events[0].text, Not(HasSubstr("e+03")));
}

// Fewer lines cross in the first frame, and these meet better.
TEST_F(Watch, CrossingsThatMeetBetterInTheFirstFrameAreNotOdd) {
  for (FrameRow& row : rows_) row.device_crossing_expected_px.assign(6, 0.1);
  rows_[0].device_crossing_px[1] = 0.01;
  EXPECT_THAT(watch().odd, IsEmpty());
  rows_[0].device_crossing_px[1] = 0.3;
  ASSERT_THAT(watch().odd, SizeIs(1));
  EXPECT_EQ(watch().odd[0].row, 0U);
}

// The object moves to where lines are less certain; the camera stands.
TEST_F(Watch, MissesThatNoiseExplainsAreNoMotion) {
  for (FrameRow& row : rows_) {
    row.device_crossing_expected_px.assign(6, 0.09);
    for (CameraRow& camera : row.cameras) camera.shift_x_px = camera.shift_y_px = 0.01;
  }
  from(120, [](FrameRow& row) {
    row.device_crossing_px[1] += 0.08;
    row.device_crossing_expected_px[1] += 0.08;
  });
  EXPECT_THAT(events(), IsEmpty());
  from(120, [](FrameRow& row) { row.device_crossing_px[1] += 0.1; });
  const auto found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].device, "cam1");
  EXPECT_THAT(found[0].text, HasSubstr("stands where it stood"));
}

// Slower than a median of some frames could tell.
TEST_F(Watch, ALensThatCreepsOutOfFocusIsNamed) {
  for (std::size_t k = 100; k < kFrames; ++k) {
    const double wider = 1 + 0.25 * static_cast<double>(k - 100) / (kFrames - 100);
    rows_[k].cameras[1].line_width_px *= wider;
  }
  const auto found = events();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].kind, "width");
  EXPECT_EQ(found[0].device, "cam1");
  EXPECT_TRUE(found[0].lasts);
  EXPECT_NEAR(static_cast<double>(found[0].first), 220, 30);  // where it is wider by 15 %
  EXPECT_THAT(found[0].text, HasSubstr("out of focus"));
}

// Wider lines are lower: that is no aperture.
// Out of focus, all lines lose height and the pictures keep their light.
TEST_F(Watch, LightThatIsSpreadInAllCamerasIsNotCalledLess) {
  for (const double level : {1.0, 0.3}) {
    from(200, [&](FrameRow& row) {
      for (CameraRow& camera : row.cameras) {
        if (level == 1)
          for (double& height : camera.height_of_projector) height *= 0.3;
        else
          camera.image_level *= level;
      }
    });
    const auto found = events();
    const auto light = std::find_if(found.begin(), found.end(), [](const SequenceEvent& event) {
      return event.kind == "light";
    });
    ASSERT_NE(light, found.end());
    EXPECT_THAT(light->text, level == 1 ? HasSubstr("pictures are as bright as before: focus")
                                        : HasSubstr("the projectors' light, or the exposure"));
  }
}
TEST_F(Watch, LightOfALensThatGoesOutOfFocusIsSpread) {
  for (std::size_t k = 200; k < kFrames; ++k) {
    const double wider = 1 + 0.5 * std::min(1.0, static_cast<double>(k - 200) / 44);
    rows_[k].cameras[1].line_width_px *= wider;
    for (double& height : rows_[k].cameras[1].height_of_projector) height /= std::pow(wider, 3);
  }
  const auto found = events();
  ASSERT_FALSE(found.empty());
  for (const SequenceEvent& event : found) {
    EXPECT_EQ(event.kind, "width") << event.text;
    EXPECT_EQ(event.device, "cam1") << event.text;
  }
}

// Its shifts are noisy, and what crossings miss is noticed three frames after it moved.
TEST_F(Watch, ACameraThatIsNoticedLateHasMovedAllTheSame) {
  Random random(11);
  for (FrameRow& row : rows_) {
    row.device_crossing_expected_px.assign(6, 0.09);
    for (CameraRow& camera : row.cameras) {
      camera.shift_x_px = random.normal(0, 0.3);
      camera.shift_y_px = random.normal(0, 0.1);
    }
  }
  from(150, [](FrameRow& row) { row.cameras[1].shift_x_px += 1.2; });
  from(153, [](FrameRow& row) { row.device_crossing_px[1] += 0.1; });
  expect_one_moved("153", "cam1");
}

TEST_F(Watch, FindingsAreEventsWithTheirFrames) {
  const auto say = [&](std::size_t first, std::size_t last, const char* code, const char* device) {
    for (std::size_t k = first; k <= last; ++k)
      rows_[k].findings.push_back({code, device, "words"});
  };
  say(0, kFrames - 1, "little-measured", "");
  EXPECT_THAT(events(), IsEmpty());
  say(0, kFrames - 1, "saturated", "cam0");
  say(8, 10, "no-picture", "cam2");
  say(13, 13, "no-picture", "cam2");
  rows_[30].findings.push_back({"no-picture", "cam2", "nothing in frame 30: without it"});
  say(280, kFrames - 1, "wrong-picture", "cam1");
  rows_[285].status.state = FrameState::kFailed;
  const auto found = events();
  std::vector<std::string> said;
  for (const SequenceEvent& event : found)
    said.push_back(when_text(event, rows_) + " " + event.kind + " " + event.device + " " +
                   event.text);
  EXPECT_THAT(said, ::testing::ElementsAre("from frame 0 saturated cam0 words",
                                           "in frames 8 to 13 no-picture cam2 words (in 4 of these "
                                           "6 frames)",
                                           "in frame 30 no-picture cam2 nothing: without it",
                                           "from frame 280 wrong-picture cam1 words"));
}

}  // namespace
}  // namespace pencilscan
