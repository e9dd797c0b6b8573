#include "pencilscan/pipeline/picture_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/frame_failure.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/pipeline/frame_warnings.h"
#include "pencilscan/pipeline/light_warnings.h"
#include "pencilscan/pipeline/line_contrast.h"
#include "pencilscan/pipeline/sample_frame.h"
#include "pencilscan/pipeline/sequence.h"
#include "pencilscan/planning/ring.h"
#include "pencilscan/recording/frame_folders.h"
#include "pencilscan/rig/object_space.h"
#include "pencilscan/rig/sample_devices.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;

/// Six cameras and six projectors around an egg with bumps.
class PictureCheck : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    RingOptions ring;
    ring.camera_width = 480;
    ring.camera_height = 360;
    ring.camera_focal_px = 860;
    ring.pitch_px = 24;
    ring.line_width_px = 8;
    rig_ = new Rig(make_ring(ring));
    egg_ = new TriangleMesh(make_sphere(120, 48));
    for (Vec3& x : egg_->vertices) {
      const Vec3 d = x.normalized();
      x *= 1 + 0.08 * std::sin(5 * d.x() + 1) * std::cos(4 * d.z()) + 0.1 * d.y();
    }
    frame_ = new Frame(frame_of(*egg_));
  }
  static void TearDownTestSuite() {
    delete frame_;
    delete egg_;
    delete rig_;
  }

  static PhotographyOptions photography() {
    PhotographyOptions photo;
    photo.noise = "medium";
    return photo;
  }
  static Frame frame_of(const TriangleMesh& mesh) {
    return sample::photographed_frame(*rig_, SimulatedObject(mesh), photography());
  }

  /// What is said of a frame, and of which cameras.
  static std::vector<std::string> said_of(const Frame& frame, const Rig& rig = *rig_) {
    const PointResult result = sample::labelled_points(rig, frame);
    std::vector<std::string> said;
    for (const Warning& warning : result.warnings) {
      if (warning.code == WarningCode::kWrongPicture) said.push_back(warning.text);
    }
    const auto left_out = std::count(result.left_out.begin(), result.left_out.end(), 1);
    EXPECT_EQ(static_cast<std::size_t>(left_out), said.size());
    return said;
  }
  static void expect_said(const Frame& frame, const std::vector<std::string>& parts) {
    const std::vector<std::string> said = said_of(frame);
    ASSERT_EQ(said.size(), parts.size()) << testing::PrintToString(said);
    for (std::size_t i = 0; i < parts.size(); ++i) EXPECT_THAT(said[i], HasSubstr(parts[i]));
  }
  static Frame with(std::size_t camera, const cv::Mat& picture) {
    Frame frame = *frame_;
    frame.images[camera] = picture;
    return frame;
  }
  static cv::Mat flipped(std::size_t camera, int code) {
    cv::Mat result;
    cv::flip(frame_->images[camera], result, code);
    return result;
  }
  static cv::Mat bgr(std::size_t camera) {
    cv::Mat result;
    cv::cvtColor(frame_->images[camera], result, cv::COLOR_RGB2BGR);
    return result;
  }

  static Rig* rig_;
  static TriangleMesh* egg_;
  static Frame* frame_;
};
Rig* PictureCheck::rig_ = nullptr;
TriangleMesh* PictureCheck::egg_ = nullptr;
Frame* PictureCheck::frame_ = nullptr;

TEST_F(PictureCheck, RightPicturesAreNotAccused) {
  EXPECT_THAT(said_of(*frame_), IsEmpty());
  Frame dark = *frame_;
  for (cv::Mat& image : dark.images) image = cv::Mat(0.1 * image);
  EXPECT_THAT(said_of(dark), IsEmpty());
  for (cv::Mat& image : dark.images) image = cv::Mat(0.2 * image);
  EXPECT_THAT(said_of(dark), IsEmpty());
  Frame some = *frame_;
  some.images[1] = some.images[3] = some.images[5] = cv::Mat();
  EXPECT_THAT(said_of(some), IsEmpty());
}

// A camera that hardly sees what two projectors light names little of its lines, and that its
// picture is right shows where the lines lie that other cameras measured.
TEST_F(PictureCheck, CamerasThatSeeOneProjectorsLightAreNotAccused) {
  for (std::size_t first = 0; first < 3; ++first) {
    Rig rig = *rig_;
    rig.projectors = {rig_->projectors[first], rig_->projectors[first + 1]};
    const Frame frame = sample::photographed_frame(rig, SimulatedObject(*egg_), photography());
    EXPECT_THAT(said_of(frame, rig), IsEmpty());
  }
}

TEST_F(PictureCheck, ExchangedCamerasAreNamed) {
  Frame frame = *frame_;
  std::swap(frame.images[0], frame.images[1]);
  expect_said(frame, {"camera cam0: its picture is that of camera cam1",
                      "camera cam1: its picture is that of camera cam0"});
}

// The ring repeats itself after two devices: the projectors fit the picture there as well. What is
// seen there does not fit the other cameras, by more than a line spacing.
TEST_F(PictureCheck, CamerasThatAreExchangedWhereTheRingRepeatsItselfAreNamed) {
  Frame frame = frame_of(make_sphere(85, 48, {40, 25, 0}));
  EXPECT_THAT(said_of(frame), IsEmpty());
  std::swap(frame.images[2], frame.images[4]);
  expect_said(frame, {"camera cam2: its picture is that of camera cam4",
                      "camera cam4: its picture is that of camera cam2"});
}

// A ball nearly in the middle looks alike from there, so that no line is named another one's. Its
// depths lie apart by a fraction of a line spacing, and that is many deviations.
TEST_F(PictureCheck, CamerasThatAreExchangedBeforeABallInTheMiddleLieApartFromTheOthers) {
  Frame frame = frame_of(make_sphere(85, 48, {1.5, 1, 0}));
  EXPECT_THAT(sample::labelled_points(*rig_, frame).warnings, IsEmpty());
  std::swap(frame.images[2], frame.images[4]);
  const PointResult points = sample::labelled_points(*rig_, frame);
  std::vector<std::string> wrong;
  for (const Warning& warning : points.warnings)
    if (warning.code == WarningCode::kWrongPicture) wrong.push_back(warning.device);
  EXPECT_THAT(wrong, testing::UnorderedElementsAre(rig_->cameras[2].name, rig_->cameras[4].name));
  EXPECT_EQ(points.left_out, (std::vector<char>{0, 0, 1, 0, 1, 0}));
  // What they saw is no figure of theirs.
  for (const std::size_t camera : {2U, 4U}) {
    EXPECT_EQ(points.device_crossings[camera].crossings, 0U);
    EXPECT_FALSE(points.device_crossings[camera].shift_px);
  }
}

/// What is said where projectors a and b show each other's patterns.
std::string refusal_of(Rig rig, const Frame& frame, std::size_t a, std::size_t b) {
  std::swap(rig.projectors[a].patterns, rig.projectors[b].patterns);
  try {
    (void)sample::labelled_points(rig, frame);
  } catch (const StageError& error) {
    return error.what();
  }
  return "nothing";
}

TEST_F(PictureCheck, ExchangedProjectorsAreNamed) {
  EXPECT_THAT(refusal_of(*rig_, *frame_, 0, 1), HasSubstr("projectors proj0 and proj1 show"));
  EXPECT_THAT(refusal_of(*rig_, *frame_, 2, 3), HasSubstr("projectors proj2 and proj3 show"));
}

TEST_F(PictureCheck, ExchangedProjectorsThatStandOppositeAreNamed) {
  EXPECT_THAT(refusal_of(*rig_, *frame_, 1, 4), HasSubstr("projectors proj1 and proj4 show"));
}

TEST_F(PictureCheck, ProjectorsOfOnePatternCannotBeExchanged) {
  EXPECT_EQ(refusal_of(*rig_, *frame_, 0, 2), "nothing");
}

// The same frame gives the same another time, so that it is not made again. Those that follow are
// made: their surface starts from the one before it, or anew.
TEST_F(PictureCheck, ExchangedProjectorsAreNoPassingFailure) {
  const TemporaryFolder temporary("exchanged_projectors");
  Rig rig = *rig_;
  std::swap(rig.projectors[0].patterns, rig.projectors[1].patterns);
  write_rig(rig, temporary.path() / "rig.json");
  const Frame right = sample::photographed_frame(rig, SimulatedObject(*egg_), photography());
  for (const std::size_t k : {0U, 1U}) {
    for (std::size_t c = 0; c < rig.cameras.size(); ++c)
      write_image(temporary.path() / "frames" / six_digits(k) / (rig.cameras[c].name + ".png"),
                  (k == 0 ? *frame_ : right).images[c], 8);
  }
  SequenceOptions options;
  options.output.pictures = false;
  options.output.tracks = true;
  options.output.frame.shape.fusion.max_depth = 5;
  const fs::path out = temporary.path() / "out";
  const SequenceOutcome outcome = reconstruct_sequence(temporary.path() / "rig.json",
                                                       temporary.path() / "frames", out, options);
  ASSERT_EQ(outcome.frames.size(), 2U);
  EXPECT_THAT(outcome.frames[0].failure, HasSubstr("projectors proj0 and proj1 show"));
  const auto failure = read_failure(out / outcome.frames[0].name);
  ASSERT_TRUE(failure);
  EXPECT_FALSE(failure->is_passing);
  EXPECT_TRUE(outcome.frames[1].done) << outcome.frames[1].failure;
}

TEST_F(PictureCheck, TurnedAndMirroredPicturesAreNamed) {
  expect_said(with(4, flipped(4, -1)), {"camera cam4: its picture is turned by half a turn"});
  expect_said(with(2, flipped(2, 1)), {"camera cam2: its picture is mirrored, left for right"});
  expect_said(with(3, flipped(3, 0)), {"camera cam3: its picture is mirrored, top for bottom"});
}

/// Why no line of a frame can be named; empty where some can.
std::string why_nothing_of(const Rig& rig, const Frame& frame) {
  try {
    (void)sample::labelled_points(rig, frame);
  } catch (const NothingFound& nothing) {
    return nothing.what();
  }
  return "";
}

TEST_F(PictureCheck, AFaultOfMostPicturesIsAskedOfAll) {
  Frame frame = *frame_;
  for (std::size_t c = 0; c < frame.images.size(); ++c) frame.images[c] = flipped(c, -1);
  const std::string why = why_nothing_of(*rig_, frame);
  for (const Camera& camera : rig_->cameras)
    EXPECT_THAT(why, HasSubstr(camera.name + ": its picture is turned by half a turn"));
}

TEST_F(PictureCheck, CamerasThatSeeMuchBeyondTheVolumeAreNotAccused) {
  const double radius = rig_->volume->radius;
  EXPECT_THAT(said_of(frame_of(make_sphere(0.7 * radius, 48, {radius, 0, 0}))), IsEmpty());
}

TEST_F(PictureCheck, ExchangedColorsAreNamed) {
  expect_said(with(5, bgr(5)), {"camera cam5: its picture has red and blue exchanged"});
  Frame frame = *frame_;
  for (std::size_t c = 0; c < frame.images.size(); ++c) frame.images[c] = bgr(c);
  const std::string why = why_nothing_of(*rig_, frame);
  for (const Camera& camera : rig_->cameras)
    EXPECT_THAT(why, HasSubstr("camera " + camera.name + ": its picture has red and blue"));
}

TEST_F(PictureCheck, AProjectorWithAnotherPatternIsNamed) {
  const auto named = [](const Rig& rig, const Frame& frame) {
    std::vector<std::string> devices;
    for (const Warning& warning : reconstruct_frame(rig, frame).points.warnings)
      if (warning.code == WarningCode::kMissingLines) devices.push_back(warning.device);
    return devices;
  };
  EXPECT_THAT(named(*rig_, *frame_), IsEmpty());
  Rig other = *rig_;
  other.projectors[2].patterns[0].offset_px += 12;  // half a pitch
  EXPECT_THAT(named(other, *frame_), testing::ElementsAre(rig_->projectors[2].name));
}

TEST_F(PictureCheck, ACameraOutOfFocusIsSaidToBe) {
  Frame frame = *frame_;
  frame.images[2] = cv::Mat();  // the fixture keeps its own
  cv::GaussianBlur(frame_->images[2], frame.images[2], {}, 6);
  expect_said(
      frame,
      {"camera cam2: its picture does not fit the rig as the others' do: its lines stand out"});
  EXPECT_THAT(said_of(frame).front(), HasSubstr("out of focus"));
}

// Lines that a dark object or a small one shows stand out as others do, and so they do in coarser
// pixels.
TEST_F(PictureCheck, LinesStandOutAsMuchInEachCameraThatIsInFocus) {
  Frame frame = *frame_;
  frame.images[1] = 0.1 * frame_->images[1];
  frame.images[3] = frame_->images[3].clone();
  frame.images[3].colRange(0, 240).setTo(cv::Scalar::all(0));
  Rig rig = *rig_;
  for (std::size_t c : {4, 5}) {
    Camera& camera = rig.cameras[c];
    camera.K.topRows<2>() *= 0.75;
    camera.width = 360;
    camera.height = 270;
    frame.images[c] = cv::Mat();
    cv::resize(frame_->images[c], frame.images[c], {camera.width, camera.height}, 0, 0,
               cv::INTER_AREA);
  }
  for (const double contrast : line_contrasts(rig, frame, {})) {
    EXPECT_GT(contrast, 0.6);
    EXPECT_LT(contrast, 1.6);
  }
  const double period = pixels_at_center(rig, rig.cameras[0], line_spacing(rig));
  frame.images[0] = cv::Mat();
  cv::GaussianBlur(frame_->images[0], frame.images[0], {}, 0.3 * period);
  EXPECT_TRUE(is_out_of_focus(line_contrasts(rig, frame, {})[0]));
}

// What it still shows is used. That it then disagrees with the others is no sign of a move.
TEST_F(PictureCheck, ACameraALittleOutOfFocusIsNamedAndNotSaidToBeMoved) {
  Frame frame = *frame_;
  frame.images[2] = cv::Mat();
  cv::GaussianBlur(frame_->images[2], frame.images[2], {}, 3.5);
  const FrameResult result = reconstruct_frame(*rig_, frame);
  std::vector<std::string> said;
  for (const Warning& warning : result.points.warnings)
    if (!warning.device.empty()) said.push_back(warning.device + to_string(warning.code));
  EXPECT_THAT(said, testing::ElementsAre(rig_->cameras[2].name + "out-of-focus"));
}

/// What is left in its colours is of others that share them, and no sign that it was moved.
TEST_F(PictureCheck, AProjectorThatIsOffStandsNowhereElse) {
  const Rig rig = make_ring(sample::small_ring());
  Rig lit = rig;
  lit.projectors.erase(lit.projectors.begin() + 2);
  const Frame frame =
      sample::photographed_frame(lit, SimulatedObject(make_sphere(120, 40)), photography());
  for (const Warning& warning : sample::labelled_points(rig, frame).warnings)
    EXPECT_NE(warning.code, WarningCode::kRigIsOff) << warning.text;
}

TEST_F(PictureCheck, LightThatIsTooLittleIsNamed) {
  const auto frame = [](double albedo) {
    Reflectance surface;
    surface.albedo = albedo;
    return sample::photographed_frame(*rig_, SimulatedObject(*egg_, surface), photography());
  };
  const auto light = [&](const Frame& of) {
    for (const Warning& warning : reconstruct_frame(*rig_, of).points.warnings)
      if (warning.code == WarningCode::kLittleLight) return warning.figures.at(0).second;
    return 0.0;
  };
  EXPECT_EQ(light(*frame_), 0);
  EXPECT_EQ(light(frame(0.2)), 0);
  const double dark = light(frame(0.02));
  EXPECT_GT(dark, 1);
  EXPECT_LT(dark, 10);
  // Whether or not anything is left of still darker ones.
  std::string said;
  try {
    for (const Warning& warning : reconstruct_frame(*rig_, frame(0.008)).points.warnings)
      said += warning.text;
  } catch (const NothingFound& error) {
    said = error.what();
  }
  EXPECT_THAT(said, HasSubstr("times as bright as the noise of the pictures"));
}

TEST_F(PictureCheck, LightIsJudgedByLinesThatDoNotOverlap) {
  const auto said = [](const Rig& rig, double ratio, double width_px, float amplitude = 0.03F) {
    PointResult result;
    result.families = color_families(rig);
    result.detections.resize(1);
    CurvePoint point;
    point.amplitude = amplitude;
    point.width_px = static_cast<float>(width_px);
    point.sigma_px = static_cast<float>(std::sqrt(2 * width_px * std::numbers::inv_sqrtpi) / ratio);
    Curve curve;
    curve.points.assign(9, point);
    result.graphs.resize(1);
    result.graphs[0].curves.push_back(curve);
    const auto warning = little_light_warning(rig, result);
    return warning ? warning->text : std::string();
  };
  EXPECT_THAT(said(*rig_, 6, 1.1), HasSubstr("light is too little"));
  EXPECT_THAT(said(*rig_, 9, 1.1), IsEmpty());
  EXPECT_THAT(said(*rig_, 6, 4), IsEmpty());
  EXPECT_THAT(said(*rig_, 6, 1.1, 0.3F), IsEmpty());  // no sensor has such noise
  Rig dense = *rig_;
  for (Projector& projector : dense.projectors)
    for (LinePattern& pattern : projector.patterns) pattern.pitch_px /= 4;
  EXPECT_THAT(said(dense, 6, 1.1), HasSubstr("lines are too close together: 2.1 px"));
  EXPECT_THAT(said(dense, 9, 1.1), IsEmpty());
  // One sample of four makes places half as sure in the same light.
  Rig raw = *rig_;
  raw.cameras[0].mosaic = Mosaic::from_name("RGGB");
  EXPECT_THAT(said(raw, 4, 1.1), IsEmpty());
  EXPECT_THAT(said(raw, 3, 1.1), HasSubstr("are 6.0 times as bright as the noise"));
}

TEST_F(PictureCheck, MosaicsThatAreNotStatedOrOthersAreNamed) {
  for (const char* name : {"RGGB", "BGGR", "GRBG", "GBRG"}) {
    const Mosaic mosaic = *Mosaic::from_name(name);
    const bool are_odd = name[0] != 'G';
    const std::string right = are_odd ? "RGGB or BGGR" : "GRBG or GBRG";
    const Frame raw = with(2, sampled(frame_->images[2], mosaic));
    expect_said(raw, {"one colour a pixel: state the \"mosaic\" of the camera, " + right});
    Rig rig = *rig_;
    rig.cameras[2].mosaic = mosaic;
    EXPECT_THAT(said_of(raw, rig), IsEmpty()) << name;
    rig.cameras[2].mosaic = Mosaic::from_name(are_odd ? "GBRG" : "RGGB");
    EXPECT_THAT(said_of(raw, rig),
                testing::ElementsAre(HasSubstr("green samples are those of " + right)));
  }
  // So it is where the object is small, and its lines are in a ninth of the picture.
  cv::Mat small = frame_->images[2].clone();
  cv::Mat around(small.size(), CV_8UC1, cv::Scalar(255));
  around(cv::Rect(160, 120, 160, 120)) = 0;
  small.setTo(cv::Scalar::all(0.01), around);
  expect_said(with(2, sampled(small, *Mosaic::from_name("GBRG"))),
              {"one colour a pixel: state the \"mosaic\" of the camera, GRBG or GBRG"});
  // A picture of a grey camera has no mosaic.
  cv::Mat grey;
  cv::transform(frame_->images[4], grey, cv::Matx13f(0.3F, 0.6F, 0.1F));
  expect_said(with(4, grey), {"is grey"});
}

TEST_F(PictureCheck, BlackGreyAndRepeatedPicturesAreNamed) {
  cv::Mat black(frame_->images[0].size(), CV_32FC3);
  cv::randn(black, 0.01, 0.005);
  expect_said(with(0, black), {"camera cam0: its picture is black"});
  expect_said(with(0, cv::Mat::zeros(black.size(), CV_32FC3)),
              {"camera cam0: its picture is black"});
  cv::Mat grey;
  cv::cvtColor(frame_->images[1], grey, cv::COLOR_RGB2GRAY);
  cv::cvtColor(grey, grey, cv::COLOR_GRAY2RGB);
  expect_said(with(1, grey), {"camera cam1: its picture is grey"});
  expect_said(with(2, frame_->images[3]),
              {"camera cam2: its picture is the same as camera cam3's",
               "camera cam3: its picture is the same as camera cam2's"});
}

TEST_F(PictureCheck, AMovedCameraIsNamed) {
  Rig moved = *rig_;
  RigidTransform& pose = moved.cameras[2].device_from_world;
  pose.rotation = Eigen::AngleAxisd(0.1, Vec3::UnitZ()).toRotationMatrix() * pose.rotation;
  const auto said = said_of(*frame_, moved);
  ASSERT_EQ(said.size(), 1U);
  EXPECT_THAT(said[0], HasSubstr("camera cam2: its picture does not fit the rig"));
}

// Its lines have names of other lines, and what cameras measure by them contradicts the others.
TEST_F(PictureCheck, AProjectorThatIsOffByHalfALineIsNoCamerasFault) {
  const Frame frame = frame_of(make_box({150, 130, 170}));
  for (std::size_t p = 0; p < rig_->projectors.size(); ++p) {
    for (const double way : {-0.5, 0.5}) {
      Rig moved = *rig_;
      Projector& projector = moved.projectors[p];
      const LinePattern& lines = projector.patterns[0];
      Vec3 turn = Vec3::Zero();
      turn[lines.axis == Axis::kColumn ? 1 : 0] = way * lines.pitch_px;
      projector.device_from_world = corrected_pose(projector, {turn, Vec3::Zero()});
      EXPECT_THAT(said_of(frame, moved), IsEmpty()) << projector.name << " " << way;
    }
  }
}

// So small are the pictures that crossings with right names are few, and others meet by chance.
TEST_F(PictureCheck, ACameraThatIsTurnedByTwoPixelsIsNamed) {
  RingOptions ring;
  ring.camera_width = 320;
  ring.camera_height = 240;
  ring.camera_focal_px = 575;
  ring.pitch_px = 36;
  ring.line_width_px = 14;
  const Rig rig = make_ring(ring);
  const Frame frame = sample::photographed_frame(rig, SimulatedObject(*egg_), photography());
  const auto warnings_of = [&](const Rig& stated) {
    return sample::labelled_points(stated, frame).warnings;
  };
  for (const Warning& warning : warnings_of(rig)) EXPECT_EQ(warning.device, "") << warning.text;
  std::size_t turned = 0;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    Rig moved = rig;
    Camera& camera = moved.cameras[c];
    camera.device_from_world = corrected_pose(camera, {Vec3(0, 2, 0), Vec3::Zero()});
    const std::vector<Warning> said = warnings_of(moved);
    EXPECT_FALSE(said.empty()) << camera.name;
    for (const Warning& warning : said) {
      if (warning.code != WarningCode::kDeviceIsOff) continue;
      EXPECT_EQ(warning.device, camera.name);
      EXPECT_EQ(warning.figures.back().first, "shift_px");
      EXPECT_NEAR(warning.figures.back().second, 2, 0.2);
      ++turned;
    }
  }
  EXPECT_GE(turned, 3U);  // others are left out, or the rig as a whole is said to be off
}

// A camera whose picture is left out colours nothing, neither by its picture in plain light.
TEST_F(PictureCheck, ACameraThatIsLeftOutGivesNoColor) {
  const cv::Size size = frame_->images[0].size();
  Frame frame = with(0, cv::Mat::zeros(size, CV_32FC3));
  frame.plain.assign(rig_->cameras.size(), cv::Mat(size, CV_32FC3, cv::Scalar::all(0.4)));
  frame.plain[0] = cv::Mat(size, CV_32FC3, cv::Scalar(0, 0.4, 0));
  FrameOptions options;
  options.shape.fusion.max_depth = 5;
  const FrameResult result = reconstruct_frame(*rig_, frame, options);
  ASSERT_EQ(result.points.left_out[0], 1);
  const auto& colors = result.shape.surface.mesh.color;
  ASSERT_FALSE(colors.empty());
  const auto is_green = [](const std::array<float, 3>& c) { return c[1] > 1.05F * c[0]; };
  EXPECT_EQ(std::count_if(colors.begin(), colors.end(), is_green), 0);
}

TEST(PlainFaults, ColorsOfAPictureOfManyPixelsAreSeen) {
  // In every eighth row more pixels than a thousandth of what an int holds.
  const Rig rig = sample::small_rig(480, 360, 110);
  cv::Mat picture(3600, 5000, CV_8UC3, cv::Scalar(60, 0, 0));
  picture.rowRange(0, 600).setTo(cv::Scalar(200, 0, 0));
  Frame frame;
  frame.images = {picture, cv::Mat()};
  EXPECT_TRUE(plain_faults(rig, frame).empty());
}

}  // namespace
}  // namespace pencilscan
