// What must not change a result: the rig's unit, the pictures' gain, the order and the place of the
// devices; and rigs beyond the usual must not break anything.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <tuple>

#include "pencilscan/core/median.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/grid/gamma_trace.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/light_warnings.h"
#include "pencilscan/pipeline/sample_frame.h"
#include "pencilscan/pipeline/sensor_frame.h"
#include "pencilscan/rig/camera_light.h"
#include "pencilscan/rig/sample_devices.h"
#include "pencilscan/simulation/panel_light.h"
#include "pencilscan/simulation/render.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {
namespace {

Frame picture(const Rig& rig, const TriangleMesh& mesh) {
  const SimulatedObject object(mesh);
  const auto lights = line_lights(rig);
  Frame frame;
  frame.name = "000000";
  for (std::size_t c = 0; c < rig.cameras.size(); ++c)
    frame.images.push_back(cv::min(render_camera(rig, c, object, lights), 1.0));
  return frame;
}

FrameOptions coarse() {
  FrameOptions options;
  options.shape.surface.max_depth = 5;
  options.shape.fusion.max_depth = 5;
  return options;
}

FrameOptions points_alone() {
  FrameOptions options;
  options.meshes = false;
  return options;
}

class Laws : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    rig_ = new Rig(sample::small_rig(480, 360, 110));
    frame_ = new Frame(picture(*rig_, make_sphere(95, 48)));
    result_ = new FrameResult(reconstruct_frame(*rig_, *frame_, coarse()));
  }
  static void TearDownTestSuite() {
    delete result_;
    delete frame_;
    delete rig_;
  }

  using Pixel = std::tuple<int, int, long, long>;  // camera, projector, u, v
  /// Line at each measured pixel.
  static std::map<Pixel, int> names(const std::vector<MeasuredPoint>& points) {
    std::map<Pixel, int> lines;
    for (const MeasuredPoint& p : points)
      lines[{p.camera, p.projector, std::lround(p.u), std::lround(p.v)}] = p.line;
    return lines;
  }
  /// Share of the points of both that the other one has too, with the same line.
  static double agreement(const std::vector<MeasuredPoint>& a,
                          const std::vector<MeasuredPoint>& b) {
    const auto in_a = names(a);
    const auto in_b = names(b);
    std::size_t same = 0;
    for (const auto& [pixel, line] : in_a) {
      const auto at = in_b.find(pixel);
      same += at != in_b.end() && at->second == line ? 1U : 0U;
    }
    return static_cast<double>(same) / static_cast<double>(std::max(in_a.size(), in_b.size()));
  }
  /// Median distance of the mesh's measured vertices from the ball, mm.
  static double error(const FrameResult& result, double scale = 1, const Vec3& center = {0, 0, 0}) {
    std::vector<double> off;
    for (const Vec3& x : result.shape.surface.measured.vertices)
      off.push_back(std::abs((x / scale - center).norm() - 95));
    return upper_median(std::move(off));
  }
  static double median_sigma(const FrameResult& result) {
    std::vector<double> sigmas;
    for (const float s : result.shape.surface.measured.sigma)
      sigmas.push_back(static_cast<double>(s));
    return upper_median(std::move(sigmas));
  }

  static Rig* rig_;
  static Frame* frame_;
  static FrameResult* result_;
};
Rig* Laws::rig_ = nullptr;
Frame* Laws::frame_ = nullptr;
FrameResult* Laws::result_ = nullptr;

TEST_F(Laws, TheRigsUnitDoesNotMatter) {
  const double of_mm = error(*result_);
  ASSERT_LT(of_mm, 0.3);
  for (const double scale : {0.001, 0.01, 30.0}) {
    const FrameResult other = reconstruct_frame(scaled(*rig_, scale), *frame_, coarse());
    EXPECT_GT(agreement(result_->points.points, other.points.points), 0.999) << scale;
    EXPECT_NEAR(error(other, scale), of_mm, 0.01 * of_mm) << scale;
    EXPECT_NEAR(median_sigma(other) / scale, median_sigma(*result_), 0.01 * median_sigma(*result_));
    const SurfaceReport& report = other.shape.surface.report;
    EXPECT_NEAR(report.spacing_mm / scale, result_->shape.surface.report.spacing_mm, 0.01);
    EXPECT_EQ(report.edges.boundary + report.edges.non_manifold, 0U) << scale;
  }
}

TEST_F(Laws, TheGainDecidesNothing) {
  Frame darker = *frame_;
  for (cv::Mat& image : darker.images) image = cv::Mat(0.5 * image);
  const FrameResult other = reconstruct_frame(*rig_, darker, points_alone());
  const FrameResult same = reconstruct_frame(*rig_, *frame_, points_alone());
  EXPECT_GT(agreement(same.points.points, other.points.points), 0.98);
}

double height_of_lines(const FrameResult& result) {
  std::vector<double> heights;
  for (const Curve& curve : result.points.graphs[0].curves)
    for (const CurvePoint& point : curve.points)
      heights.push_back(static_cast<double>(point.amplitude));
  return upper_median(std::move(heights));
}

/// Sensors of 10 or 12 bits leave their values in the low ones of 16.
TEST_F(Laws, TheBitsOfTheSensorDecideNothing) {
  const FrameResult same = reconstruct_frame(*rig_, *frame_, points_alone());
  for (const int full : {1023, 4095}) {
    constexpr int kBlack = 64;
    Rig rig = *rig_;
    for (Camera& camera : rig.cameras) camera.black_level = kBlack / 65535.;
    Frame stored = *frame_;
    for (std::size_t c = 0; c < stored.images.size(); ++c)
      frame_->images[c].convertTo(stored.images[c], CV_16U, full - kBlack, kBlack);
    const FrameResult other = reconstruct_frame(rig, stored, points_alone());
    EXPECT_GT(agreement(same.points.points, other.points.points), 0.99) << full;
    const double gain = height_of_lines(same) / height_of_lines(other);
    EXPECT_NEAR(gain * full / 65535, 1, 0.1) << "heights are those of the stored light";
  }
}

/// Where the samples of a mosaic stand in a picture whose colours were filled in, that picture is
/// worth what they are.
TEST_F(Laws, FilledInColoursGiveWhatTheirSamplesGive) {
  const Mosaic mosaic = *Mosaic::from_name("GRBG");
  Rig raw_rig = *rig_;
  for (Camera& camera : raw_rig.cameras) camera.mosaic = mosaic;
  Frame raw = *frame_;
  Frame filled_in = *frame_;
  for (std::size_t c = 0; c < raw.images.size(); ++c) {
    sampled(frame_->images[c], mosaic).convertTo(raw.images[c], CV_8U, 255);
    cv::Mat values;
    raw.images[c].convertTo(values, CV_32F);
    demosaiced(values, mosaic).convertTo(filled_in.images[c], CV_8U);
  }
  const FrameResult of_raw = reconstruct_frame(raw_rig, raw, points_alone());
  const FrameResult of_filled = reconstruct_frame(*rig_, filled_in, points_alone());
  ASSERT_GT(of_raw.points.points.size(), 1000U);
  EXPECT_EQ(of_filled.points.points.size(), of_raw.points.points.size());
  EXPECT_EQ(agreement(of_filled.points.points, of_raw.points.points), 1);
  const auto is_told = [](const Warning& w) { return w.code == WarningCode::kColorsFilledIn; };
  const auto& warnings = of_filled.points.warnings;
  EXPECT_EQ(std::count_if(warnings.begin(), warnings.end(), is_told), 1);
}

constexpr double kGamma = 2.2;

Frame coded(const Frame& frame, double gamma = kGamma) {
  Frame coded;
  coded.name = frame.name;
  for (const cv::Mat& image : frame.images) cv::pow(image, 1 / gamma, coded.images.emplace_back());
  return coded;
}

Rig with_gamma(Rig rig) {
  for (Camera& camera : rig.cameras) camera.gamma = kGamma;
  return rig;
}

/// The gamma that the frame warns of; 0: of none.
double gamma_named(const PointResult& points) {
  for (const Warning& warning : points.warnings)
    if (warning.code == WarningCode::kGamma) return warning.figures.front().second;
  return 0;
}

TEST_F(Laws, AGammaThatIsNotStatedIsNamed) {
  EXPECT_EQ(gamma_named(result_->points), 0);
  EXPECT_EQ(gamma_named(sample::labelled_points(with_gamma(*rig_), coded(*frame_))), 0);
  EXPECT_NEAR(gamma_named(sample::labelled_points(*rig_, coded(*frame_))), kGamma, 0.3);
  EXPECT_NEAR(gamma_named(sample::labelled_points(with_gamma(*rig_), *frame_)), 1, 0.15);
}

/// A gamma lifts the dark between lines, up to half of what lines have and more.
TEST_F(Laws, AGammaIsNamedWhereTheDarkIsLit) {
  Frame lit = *frame_;
  for (cv::Mat& image : lit.images) {
    cv::Mat values;  // the frame's own pixels stay as they are
    image.convertTo(values, CV_32F, 0.6, 0.1);
    image = values;
  }
  EXPECT_EQ(gamma_named(sample::labelled_points(*rig_, lit)), 0);
  EXPECT_NEAR(gamma_named(sample::labelled_points(*rig_, coded(lit))), kGamma, 0.4);
}

/// Pictures of 8 bits whose crossings are too few to tell have a note, and no finding.
TEST_F(Laws, AGammaThatCannotBeToldIsNoted) {
  Frame stored = *frame_;
  for (cv::Mat& image : stored.images) {
    cv::Mat values;
    image.convertTo(values, CV_8U, 255);
    image = values;
  }
  const std::vector<std::optional<GammaTrace>> nothing(rig_->cameras.size());
  EXPECT_THAT(gamma_note(*rig_, stored, nothing), testing::HasSubstr("state their \"gamma\""));
  EXPECT_EQ(gamma_note(with_gamma(*rig_), stored, nothing), "");
  EXPECT_EQ(gamma_note(*rig_, *frame_, nothing), "") << "floating point is light";
  const std::vector<std::optional<GammaTrace>> told(rig_->cameras.size(),
                                                    GammaTrace{0.98, 0.02, 500});
  EXPECT_EQ(gamma_note(*rig_, stored, told), "");
}

TEST_F(Laws, AVolumeThatCutsTheObjectIsNamed) {
  const auto cut = [](const Rig& rig, const Frame& frame) {
    for (const Warning& warning : sample::labelled_points(rig, frame).warnings)
      if (warning.code == WarningCode::kVolumeCuts) return warning.figures.front().second;
    return 0.0;
  };
  EXPECT_EQ(cut(*rig_, *frame_), 0);
  Rig narrow = *rig_;
  narrow.volume = Sphere{{0, 60, 0}, 90};  // of the ball of 95 mm the better half
  EXPECT_GT(cut(narrow, *frame_), 0.2);
  narrow.volume = Sphere{{95, 0, 0}, 50};  // what stands out of the ball's front
  EXPECT_GT(cut(narrow, *frame_), 0.2);
}

TEST_F(Laws, AFloorThatCutsTheObjectIsNamed) {
  const auto cut = [](double height) {
    Rig rig = *rig_;
    rig.floor = Floor{{0, 0, height}, Vec3::UnitZ()};
    for (const Warning& warning : sample::labelled_points(rig, *frame_).warnings)
      if (warning.code == WarningCode::kFloorCuts) return warning.figures.front().second;
    return 0.0;
  };
  EXPECT_EQ(cut(-110), 0);  // below the ball of 95 mm
  EXPECT_GT(cut(-40), 0.03);
}

/// JPEG and colours that are filled in show less gamma than there is, and never so little as none.
TEST_F(Laws, LessThanTheStatedGammaIsNamedBelowHalfOfIt) {
  const Rig rig = with_gamma(*rig_);
  const auto is_named = [&](double gamma) {
    const std::vector<std::optional<GammaTrace>> traces(rig.cameras.size(),
                                                        GammaTrace{gamma, 0.02, 500});
    return gamma_warning(rig, traces).has_value();
  };
  EXPECT_FALSE(is_named(0.55 * kGamma));
  EXPECT_TRUE(is_named(1));
  EXPECT_TRUE(is_named(1.4 * kGamma));
}

/// Where crossings are few in each camera, all cameras' tell the gamma.
TEST_F(Laws, AGammaIsNamedByFewCrossingsOfManyCameras) {
  for (const bool is_coded : {true, false}) {
    const Frame frame = is_coded ? coded(*frame_) : *frame_;
    const PointResult points = sample::labelled_points(*rig_, frame);
    std::vector<GridGraph> graphs = points.graphs;
    std::size_t sum = 0;
    for (std::size_t c = 0; c < graphs.size(); ++c) {
      const cv::Mat light = linear_light(rig_->cameras[c], frame.images[c]);
      auto said = gammas_at_crossings(graphs[c], light);
      while (gamma_of_crossings(said)) {
        graphs[c].crossings.resize(graphs[c].crossings.size() * 3 / 4);
        said = gammas_at_crossings(graphs[c], light);
      }
      sum += said.size();
    }
    ASSERT_GE(sum, 30U);
    const auto warning = gamma_warning(*rig_, gammas_of_light(*rig_, frame, graphs));
    EXPECT_EQ(warning.has_value(), is_coded);
    if (warning) {
      EXPECT_NEAR(warning->figures.front().second, kGamma, 0.3);
    }
  }
}

/// No camera codes light with a gamma below one: paint beside the crossings may look like that.
TEST_F(Laws, NoGammaBelowOneIsNamed) {
  const Frame frame = coded(*frame_, 0.55);
  const PointResult points = sample::labelled_points(*rig_, frame);
  std::vector<CrossingGamma> said;
  for (std::size_t c = 0; c < points.graphs.size(); ++c) {
    const auto more = gammas_at_crossings(points.graphs[c], frame.images[c]);
    said.insert(said.end(), more.begin(), more.end());
  }
  const auto trace = gamma_of_crossings(said);
  ASSERT_TRUE(trace);
  ASSERT_LT(trace->gamma, 0.75);
  EXPECT_FALSE(gamma_warning(*rig_, gammas_of_light(*rig_, frame, points.graphs)));
}

TEST_F(Laws, ABlackLevelAboveThePictureIsNamed) {
  const auto warned = [](const Rig& rig, const Frame& frame) {
    const SensorFrame sensor = sensor_frame(rig, frame);
    const auto& notes = sensor.frame.notes;
    return std::any_of(notes.begin(), notes.end(),
                       [](const Warning& w) { return w.code == WarningCode::kBlackLevel; });
  };
  const auto with_black = [](double level) {
    Rig rig = *rig_;
    for (Camera& camera : rig.cameras) camera.black_level = level;
    return rig;
  };
  constexpr int kBlack = 240;  // of 12 bits
  constexpr double kNoise = 100;
  Frame stored = *frame_;
  for (cv::Mat& image : stored.images) {
    cv::Mat values;  // the frame's own pixels stay as they are
    image.convertTo(values, CV_32F, 4095 - kBlack, kBlack);
    cv::Mat noise(values.size(), values.type());
    cv::RNG random(5);
    random.fill(noise, cv::RNG::NORMAL, 0, kNoise);
    cv::Mat(cv::min(values + noise, 4095)).convertTo(image, CV_16U);
  }
  EXPECT_FALSE(warned(*rig_, stored));
  EXPECT_FALSE(warned(with_black(kBlack / 65535.), stored));
  EXPECT_TRUE(warned(with_black(kBlack / 4095.), stored)) << "of 12 bits, which are the low ones";
  EXPECT_TRUE(warned(with_black(2 * kBlack / 65535.), stored));
}

/// What a gamma was put on and taken off again is the same light, in every stage.
TEST_F(Laws, GammaIsTakenOutOnce) {
  const Rig coded_rig = with_gamma(*rig_);
  const FrameResult other = reconstruct_frame(coded_rig, coded(*frame_), coarse());
  EXPECT_GT(agreement(result_->points.points, other.points.points), 0.98);
  EXPECT_NEAR(error(other), error(*result_), 0.02 * error(*result_));
  EXPECT_NEAR(other.shape.surface.report.measured_share,
              result_->shape.surface.report.measured_share, 0.005);
}

TEST_F(Laws, TheOrderOfDevicesDoesNotMatter) {
  Rig turned = *rig_;
  std::swap(turned.cameras[0], turned.cameras[1]);
  std::swap(turned.projectors[0], turned.projectors[1]);
  Frame frame = *frame_;
  std::swap(frame.images[0], frame.images[1]);
  FrameResult other = reconstruct_frame(turned, frame, points_alone());
  FrameResult same = reconstruct_frame(*rig_, *frame_, points_alone());
  for (MeasuredPoint& p : other.points.points) {
    p.camera = static_cast<std::uint8_t>(1 - p.camera);
    p.projector = static_cast<std::uint8_t>(1 - p.projector);
  }
  EXPECT_GT(agreement(same.points.points, other.points.points), 0.97);
}

TEST_F(Laws, TheWorldMayTurnAndMove) {
  RigidTransform world;
  world.rotation = Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  world.translation = Vec3(1000, -500, 250);
  Rig moved = *rig_;
  const auto move = [&](Device& device) {
    RigidTransform& pose = device.device_from_world;
    const Mat3 rotation = pose.rotation * world.rotation.transpose();
    pose = {rotation, pose.translation - rotation * world.translation};
  };
  for (Camera& camera : moved.cameras) move(camera);
  for (Projector& projector : moved.projectors) move(projector);
  moved.volume->center = world.translation;
  const FrameResult other = reconstruct_frame(moved, *frame_, coarse());
  EXPECT_GT(agreement(result_->points.points, other.points.points), 0.97);
  EXPECT_NEAR(error(other, 1, world.translation), error(*result_), 0.1 * error(*result_));
}

/// There are points, each of a line that the rig has, and the closed surface is closed.
void expect_sound(const Rig& rig, const FrameResult& result) {
  EXPECT_GT(result.points.points.size(), 0U);
  for (const MeasuredPoint& p : result.points.points) {
    ASSERT_TRUE(position_of(p).allFinite() && std::isfinite(p.sigma));
    ASSERT_LT(p.camera, rig.cameras.size());
    ASSERT_LT(p.projector, rig.projectors.size());
    ASSERT_LT(p.pattern, rig.projectors[p.projector].patterns.size());
  }
  const EdgeCounts& edges = result.shape.surface.report.edges;
  EXPECT_EQ(edges.boundary + edges.non_manifold, 0U);
  EXPECT_FALSE(result.shape.surface.mesh.faces.empty());
}

TEST_F(Laws, SixteenColorFamiliesAndEightyPatternsBreakNothing) {
  const std::vector<std::vector<PatternColor>> sets = {{"blue", "cyan"},   {"red", "yellow"},
                                                       {"green"},          {"blue"},
                                                       {"cyan"},           {"red"},
                                                       {"yellow"},         {"magenta"},
                                                       {"white"},          {"blue", "green"},
                                                       {"red", "green"},   {"red", "blue"},
                                                       {"cyan", "white"},  {"yellow", "magenta"},
                                                       {"green", "white"}, {"magenta", "blue"}};
  Rig many = sample::small_rig(120, 90, 110);
  for (Camera& camera : many.cameras) {
    camera.K(0, 0) = camera.K(1, 1) = 225;
  }
  const Frame small = picture(many, make_sphere(95, 48));
  for (std::size_t k = 2; k < 80; ++k) {
    Projector& projector = many.projectors[k % 2];
    LinePattern pattern = projector.patterns.front();
    pattern.colors = sets[k % sets.size()];
    pattern.alphabet = static_cast<int>(pattern.colors.size());
    if (pattern.alphabet == 1) pattern.sequence = {0};
    pattern.offset_px += static_cast<double>(k) / 10;
    projector.patterns.push_back(pattern);
  }
  expect_sound(many, reconstruct_frame(many, small, coarse()));
  // And with sixteen families alone.
  Rig families = many;
  for (Projector& projector : families.projectors) projector.patterns.resize(1);
  for (std::size_t k = 2; k < sets.size(); ++k) {
    LinePattern pattern = families.projectors[0].patterns.front();
    pattern.colors = sets[k];
    pattern.alphabet = static_cast<int>(pattern.colors.size());
    if (pattern.alphabet == 1) pattern.sequence = {0};
    families.projectors[k % 2].patterns.push_back(pattern);
  }
  EXPECT_EQ(color_families(families).size(), 16U);
  expect_sound(families, reconstruct_frame(families, small, coarse()));
}

}  // namespace
}  // namespace pencilscan
