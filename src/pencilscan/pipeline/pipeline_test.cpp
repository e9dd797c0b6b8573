#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <tuple>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/evaluation/label_error.h"
#include "pencilscan/evaluation/line_recall.h"
#include "pencilscan/evaluation/true_lines.h"
#include "pencilscan/evaluation/truth_scene.h"
#include "pencilscan/io/file.h"
#include "pencilscan/pipeline/pipeline_fixture.h"
#include "pencilscan/pipeline/rig_periods.h"
#include "pencilscan/pipeline/rig_refinement.h"
#include "pencilscan/pipeline/sample_frame.h"
#include "pencilscan/pipeline/sequence.h"
#include "pencilscan/rig/device_list.h"
#include "pencilscan/rig/object_space.h"
#include "pencilscan/simulation/render.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

TEST_F(PipelineTest, JointAndMultiviewLabelTheBallAndLinearWorksWithOneCamera) {
  const TruthScene truth(ball(), *rig_);
  std::vector<TrueLinePixel> lines;
  for (int c = 0; c < 2; ++c) {
    const auto part = true_line_pixels(truth, c);
    lines.insert(lines.end(), part.begin(), part.end());
  }
  // A noise-free convex object: nearly every point must carry its true line.
  for (const auto& [method, max_wrong, min_recall] :
       {std::tuple(MethodOptions(JointOptions{}), 0.002, 0.85),
        std::tuple(MethodOptions(MultiviewOptions{}), 0.02, 0.85)}) {
    PointOptions options;
    options.method = method;
    const PointResult result = sample::labelled_points(*rig_, *frame_, options);
    const auto verdicts = judge_points(truth, result.points);
    EXPECT_LT(label_figures(truth, result.points, verdicts).wrong.value(), max_wrong);
    EXPECT_GT(line_recall(*rig_, lines, result.points).recall.value(), min_recall);
  }

  Rig minimum = *rig_;
  minimum.cameras.resize(1);
  Frame one = *frame_;
  one.images.resize(1);
  PointOptions options;
  options.method = LinearOptions{};
  const PointResult linear = sample::labelled_points(minimum, one, options);
  ASSERT_GT(linear.points.size(), 500U);
  const TruthScene one_truth(ball(), minimum);
  const auto linear_verdicts = judge_points(one_truth, linear.points);
  EXPECT_LT(label_figures(one_truth, linear.points, linear_verdicts).wrong.value(), 0.01);
}

TEST_F(PipelineTest, TheSurfaceTakesWrongLabelsAwayAndFindsTheirLinesAgain) {
  const Rig rig = in_footprints(*rig_);
  const TruthScene truth(make_sphere(kBallMm / footprint(*rig_), 48), rig);
  std::vector<TrueLinePixel> lines;
  for (int c = 0; c < 2; ++c) {
    const auto part = true_line_pixels(truth, c);
    lines.insert(lines.end(), part.begin(), part.end());
  }
  const auto wrong = [&](const PointResult& result) {
    return label_figures(truth, result.points, judge_points(truth, result.points)).wrong.value();
  };
  const auto recall = [&](const PointResult& result) {
    return line_recall(rig, lines, result.points).recall.value();
  };
  const ShapeOptions shape_options = quick().output.frame.shape;
  FrameResult made{sample::points_in_footprints(rig, *frame_), {}, {}};
  made.shape = measure_shape(rig, *frame_, made.points, shape_options);
  PointResult& result = made.points;
  const double recall_before = recall(result);
  // Every tenth run gets its neighbour's line.
  for (auto& runs : result.labeling.runs) {
    for (std::size_t k = 0; k < runs.size(); k += 10) {
      ++runs[k].label.line;
      runs[k].label.plane = runs[k].label.line;
    }
  }
  result.points = triangulate(rig, result.graphs, result.labeling);
  ASSERT_GT(wrong(result), 0.03);
  made = match_on_surface(rig, std::move(made));
  EXPECT_LT(wrong(result), 0.003);
  EXPECT_GT(recall(result), recall_before - 0.01);
  EXPECT_GT(result.contradicted, 100U);
  EXPECT_EQ(made.shape.surface.used.size(), result.points.size());
}

TEST_F(PipelineTest, SurfaceWhosePointsWereTakenBackIsNotMeasured) {
  const FrameOptions options = quick().output.frame;
  const Rig rig = in_footprints(*rig_);
  const double cut = 20 / footprint(*rig_);  // height, footprints
  FrameResult made{sample::points_in_footprints(rig, *frame_), {}, {}};
  made.shape = measure_shape(rig, *frame_, made.points, options.shape);
  made = match_on_surface(rig, std::move(made));
  made = finish_shape(rig, std::move(made), options.shape.fusion);
  const double reach = 2 * line_spacing(rig);
  std::erase_if(made.points.points, [&](const MeasuredPoint& p) { return double{p.z} > cut; });
  const auto highest = [](const TriangleMesh& mesh) {
    double z = -1e9;
    for (const Vec3& x : mesh.vertices) z = std::max(z, x.z());
    return z;
  };
  const auto whole_area = [&] {
    const auto& area = made.shape.holes.area_mm2;
    return std::accumulate(area.begin(), area.end(), 0.0);
  };
  const double area = whole_area();
  const double share = made.shape.surface.report.measured_share;
  ASSERT_GT(highest(made.shape.surface.measured), cut + 2 * reach);
  made = finish_shape(rig, std::move(made), options.shape.fusion);
  const SurfaceResult& surface = made.shape.surface;
  EXPECT_LT(highest(surface.measured), cut + reach);
  EXPECT_GT(highest(surface.measured), cut);
  EXPECT_GT(highest(surface.mesh), cut + 2 * reach);  // closed as before
  EXPECT_LT(surface.report.measured_share, 0.9 * share);
  const auto measured_area =
      made.shape.holes.area_mm2[static_cast<std::size_t>(HoleReason::kMeasured)];
  EXPECT_NEAR(surface.report.measured_share, measured_area / whole_area(), 1e-9);
  EXPECT_NEAR(whole_area(), area, 1e-9 * area);
  const auto contradicted = static_cast<std::uint8_t>(HoleReason::kContradicted);
  for (std::size_t v = 0; v < surface.mesh.vertices.size(); ++v) {
    if (surface.mesh.confidence[v] > 0) {
      EXPECT_NE(surface.mesh.hole[v], contradicted);
    }
  }
}

TEST_F(PipelineTest, LinesWithoutACodeAreToldApartWhereFourProjectorsShareAColour) {
  Rig rig = *rig_;
  for (const auto& [eye, axis] : {std::pair(Vec3(450, -225, 45), Axis::kColumn),
                                  std::pair(Vec3(386, 140, -277), Axis::kRow)}) {
    Projector projector = rig.projectors.front();
    projector.name = "proj" + std::to_string(rig.projectors.size());
    projector.device_from_world = look_at(eye, Vec3::Zero());
    projector.patterns.front().axis = axis;
    rig.projectors.push_back(projector);
  }
  for (Projector& projector : rig.projectors) {
    projector.patterns.front().colors = {"white"};
    projector.patterns.front().alphabet = 1;
    projector.patterns.front().sequence = {0};
  }
  const PointResult result = sample::labelled_points(rig, render_frame(rig, ball()), {});
  ASSERT_GT(result.points.size(), 5000U);
  const TruthScene truth(ball(), rig);
  const auto verdicts = judge_points(truth, result.points);
  EXPECT_LT(label_figures(truth, result.points, verdicts).wrong.value(), 0.01);
}

/// Median distance of measured points from the ball, mm.
double distance_from_ball(const PointResult& result) {
  std::vector<double> distances;
  for (const MeasuredPoint& p : result.points)
    distances.push_back(std::abs(position_of(p).norm() - 95));
  return upper_median(std::move(distances));
}

TEST_F(PipelineTest, KnownLateralColourCostsNextToNothing) {
  Rig shifted = *rig_;
  const std::array<Vec2, 4> shifts{Vec2(0.4, 0.3), Vec2(-0.5, 0), Vec2(0.3, -0.4), Vec2(0, 0.5)};
  for (std::size_t d = 0; d < device_count(shifted); ++d) {
    ColorRegistration& registration = d < 2 ? shifted.cameras[d].color_registration
                                            : shifted.projectors[d - 2].color_registration;
    registration.colors[0] = {shifts[d], 1.0002};
    registration.colors[2] = {-shifts[d], 0.9998};
  }
  const Frame frame = render_frame(shifted, ball());
  const double without = distance_from_ball(sample::labelled_points(*rig_, *frame_));
  const double known = distance_from_ball(sample::labelled_points(shifted, frame));
  const double unknown = distance_from_ball(sample::labelled_points(*rig_, frame));
  EXPECT_LT(known, 1.1 * without + 0.002);  // float32 images, no noise: 2 um are of resampling
  EXPECT_GT(unknown, 3 * without);
}

TEST_F(PipelineTest, SingleProjectorLabelsTheGridOfOneProjector) {
  Rig rig = *rig_;
  rig.cameras.resize(1);
  rig.projectors.resize(1);
  rig.projectors[0].device_from_world = look_at({400, 260, 280}, Vec3::Zero());
  LinePattern across = rig_->projectors[1].patterns.front();
  across.axis = Axis::kRow;
  rig.projectors[0].patterns.push_back(across);
  PointOptions options;
  options.method = SingleProjectorOptions{};
  const PointResult result = sample::labelled_points(rig, render_frame(rig, ball()), options);
  ASSERT_GT(result.points.size(), 1000U);
  const TruthScene truth(ball(), rig);
  const auto verdicts = judge_points(truth, result.points);
  EXPECT_LT(label_figures(truth, result.points, verdicts).wrong.value(), 0.03);
}

TEST_F(PipelineTest, SingleProjectorRefusesARigWithoutAGrid) {
  SequenceOptions options = quick();
  options.output.frame.points.method = SingleProjectorOptions{};
  EXPECT_THROW(static_cast<void>(run(*folder_ / "frames", *folder_ / "out_without_grid", options)),
               InputError);
}

TEST_F(PipelineTest, PointsAloneAreThoseOfTheWholeResult) {
  SequenceOptions options = quick();
  options.output.frame.points.method = MultiviewOptions{};
  options.output.frame.shape.depth.enabled = false;
  ASSERT_TRUE(run(*folder_ / "frames", *folder_ / "out_whole", options).front().done);
  options.output.frame.meshes = false;
  ASSERT_TRUE(run(*folder_ / "frames", *folder_ / "out_points", options).front().done);
  EXPECT_EQ(read_file(*folder_ / "out_points" / "000000" / "points.ply"),
            read_file(*folder_ / "out_whole" / "000000" / "points.ply"));
  EXPECT_FALSE(fs::exists(*folder_ / "out_points" / "000000" / "mesh.ply"));
}

TEST_F(PipelineTest, BytesAreTheSameForAnyThreadCount) {
  // Several threads make several frames at once.
  const fs::path twice = *folder_ / "frames_twice";
  fs::create_directories(twice);
  for (const char* frame : {"000000", "000001"})
    fs::copy(*folder_ / "frames" / "000000", twice / frame, fs::copy_options::recursive);
  const auto bytes_of = [](const fs::path& frame) {
    std::string bytes;
    for (const char* file : {"points.ply", "mesh.ply", "mesh_measured.ply"})
      bytes += read_file(frame / file);
    auto report = nlohmann::ordered_json::parse(read_file(frame / "report.json"));
    report.erase("frame");
    return bytes + report.dump();
  };
  std::string of_one_thread;
  for (const int threads : {1, 2, 4}) {
    const ThreadLimit limit(threads);
    const fs::path out = *folder_ / ("out_threads_" + std::to_string(threads));
    const auto outcomes = run(threads == 1 ? *folder_ / "frames" : twice, out, quick());
    for (const FrameOutcome& outcome : outcomes) {
      ASSERT_TRUE(outcome.done);
      const std::string bytes = bytes_of(out / outcome.name);
      if (of_one_thread.empty()) of_one_thread = bytes;
      EXPECT_EQ(bytes == of_one_thread, true) << threads << " threads, frame " << outcome.name;
    }
  }
}

TEST_F(PipelineTest, WrongRigIsToldFromATrueOne) {
  const auto hint = testing::Contains(testing::Field(&Warning::code, WarningCode::kRigIsOff));
  EXPECT_THAT(sample::labelled_points(*rig_, *frame_).warnings, testing::Not(hint));
  const Rig wrong = corrected_rig(*rig_, {{{0, 0.7, 0}, {}}, {}, {{0, 0.5, 0}, {}}, {}});
  EXPECT_THAT(sample::labelled_points(wrong, *frame_).warnings, hint);
}

/// Every device of the small rig about `px` pixels off.
Rig rig_off_by(double px, const Rig& rig) {
  const PoseCorrection one{px * Vec3(0.55, 0.8, -0.35), px * Vec3(0.1, 0.1, 0.2)};
  const PoseCorrection other{px * Vec3(-0.65, 0.55, 0.45), px * Vec3(-0.1, 0.2, -0.1)};
  return corrected_rig(rig, {one, other, other, one});
}

/// Of the points of `truth`, those that have the same name in `points`, and another one.
std::pair<std::size_t, std::size_t> same_and_other_names(const std::vector<MeasuredPoint>& truth,
                                                         const std::vector<MeasuredPoint>& points) {
  using Place = std::tuple<int, float, float>;
  std::map<Place, std::pair<int, int>> names;
  for (const MeasuredPoint& p : truth) names[{p.camera, p.u, p.v}] = {p.projector, p.line};
  std::size_t same = 0;
  std::size_t other = 0;
  for (const MeasuredPoint& p : points) {
    const auto found = names.find({p.camera, p.u, p.v});
    if (found == names.end()) continue;
    ++(found->second == std::pair<int, int>(p.projector, p.line) ? same : other);
  }
  return {same, other};
}

TEST_F(PipelineTest, LinesAreNamedRightWithARigThatIsOff) {
  const auto truth = sample::labelled_points(*rig_, *frame_).points;
  for (const double px : {1.0, 2.0, 4.0}) {
    const auto points = sample::labelled_points(rig_off_by(px, *rig_), *frame_).points;
    const auto [same, other] = same_and_other_names(truth, points);
    EXPECT_GT(same, 9 * truth.size() / 10) << px;
    EXPECT_LT(other, truth.size() / 200) << px;
  }
}

/// The picture with every line bent to and fro by `amplitude` px.
cv::Mat bent(const cv::Mat& image, float amplitude) {
  cv::Mat x(image.size(), CV_32F);
  cv::Mat y(image.size(), CV_32F);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const auto [fu, fv] = std::pair(static_cast<float>(u), static_cast<float>(v));
      x.at<float>(v, u) = fu + amplitude * std::sin(0.19F * fv + 0.11F * fu);
      y.at<float>(v, u) = fv + amplitude * std::sin(0.17F * fu - 0.13F * fv);
    }
  }
  cv::Mat result;
  cv::remap(image, result, x, y, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return result;
}

TEST_F(PipelineTest, LinesThatAreBentAreNamedRightWithARigThatIsOff) {
  Frame frame = *frame_;
  for (cv::Mat& image : frame.images) image = bent(image, 0.8F);
  const auto truth = sample::labelled_points(*rig_, frame).points;
  for (const double px : {1.0, 2.0, 3.0}) {
    const auto points = sample::labelled_points(rig_off_by(px, *rig_), frame).points;
    const auto [same, other] = same_and_other_names(truth, points);
    EXPECT_GT(same, 85 * truth.size() / 100) << px;
    EXPECT_LT(other, truth.size() / 50) << px;
  }
}

TEST_F(PipelineTest, RefinementFindsTheTolerancesThatNameMost) {
  const Rig wrong = rig_off_by(4.5, *rig_);
  const PointResult seen = detect_frame(wrong, *frame_);
  const FrameCurves curves{seen.families, seen.graphs};
  const TruthScene truth(ball(), *rig_);
  // From 1 px alone half of the names are wrong, though the crossings agree.
  const RigRefinement found = refine_rig_on_frames(wrong, {&curves, 1});
  ASSERT_TRUE(found.report.refined) << found.report.reason;
  const auto points = triangulate(found.rig, seen.graphs, found.labelings.front());
  EXPECT_LT(label_figures(truth, points, judge_points(truth, points)).wrong.value(), 0.002);
}

/// The rig with a projector turned so that its lines lie `lines` further.
Rig turned(Rig rig, std::size_t p, double lines) {
  Projector& projector = rig.projectors[p];
  const LinePattern& pattern = projector.patterns.front();
  const double way_px = lines * pattern.pitch_px;
  PoseCorrection turn;
  turn.rotation_px = pattern.axis == Axis::kColumn ? Vec3(0, way_px, 0) : Vec3(-way_px, 0, 0);
  projector.device_from_world = corrected_pose(projector, turn);
  return rig;
}

TEST_F(PipelineTest, AProjectorThatIsWholeLinesOffIsPutBackByItsColors) {
  const PointResult seen = detect_frame(*rig_, *frame_);
  const FrameCurves curves{seen.families, seen.graphs};
  const TruthScene truth(ball(), *rig_);
  for (const double lines : {1.8, 2.7}) {
    const Rig wrong = turned(*rig_, 1, lines);
    const RigRefinement found = refine_rig_on_frames(wrong, {&curves, 1});
    ASSERT_TRUE(found.report.refined) << lines << ": " << found.report.reason;
    const auto points = triangulate(found.rig, seen.graphs, found.labelings.front());
    EXPECT_GT(points.size(), 1000U);
    EXPECT_LT(label_figures(truth, points, judge_points(truth, points)).wrong.value(), 0.01)
        << lines;
    EXPECT_NE(check_rig_over_frames(wrong, {&curves, 1}).front().fit.verdict, RigVerdict::kFits)
        << lines;
  }
  EXPECT_EQ(check_rig_over_frames(*rig_, {&curves, 1}).front().fit.verdict, RigVerdict::kFits);
}

/// Its upper part is red, its lower part blue: cyan lines are blue there, and yellow ones red.
TEST_F(PipelineTest, LinesOnAColoredObjectHaveTheirNames) {
  Frame painted = *frame_;
  for (cv::Mat& image : painted.images) {
    image = image.clone();
    const int middle = image.rows / 2;
    const auto paint = [&](int begin, int end, const cv::Scalar& rgb) {
      cv::Mat part = image.rowRange(begin, end);
      cv::multiply(part, rgb, part);
    };
    paint(0, middle, {1, 0.06, 0.05});
    paint(middle, image.rows, {0.05, 0.08, 0.9});
  }
  const TruthScene truth(ball(), *rig_);
  const PointResult white = sample::labelled_points(*rig_, *frame_);
  const PointResult result = sample::labelled_points(*rig_, painted);
  const auto verdicts = judge_points(truth, result.points);
  EXPECT_LT(label_figures(truth, result.points, verdicts).wrong.value(), 0.01);
  EXPECT_GT(static_cast<double>(result.points.size()),
            0.8 * static_cast<double>(white.points.size()));
  for (const Warning& warning : result.warnings)
    EXPECT_NE(warning.code, WarningCode::kNamesDoubtful) << warning.text;
}

TEST_F(PipelineTest, ACameraThatWasKnockedIsFoundByTheSurfaceOfTheOthers) {
  const PointResult seen = detect_frame(*rig_, *frame_);
  const FrameCurves curves{seen.families, seen.graphs};
  const TruthScene truth(ball(), *rig_);
  for (const Vec3& turn : {Vec3(0, 12, 0), Vec3(-21, 17, 6)}) {
    Rig wrong = *rig_;
    Camera& camera = wrong.cameras[1];
    camera.device_from_world = corrected_pose(camera, {turn, Vec3(0, 2, 0)});
    const RigRefinement found = refine_rig_on_frames(wrong, {&curves, 1});
    ASSERT_TRUE(found.report.refined) << turn.transpose() << ": " << found.report.reason;
    const auto points = triangulate(found.rig, seen.graphs, found.labelings.front());
    EXPECT_GT(points_by_camera(*rig_, points)[1].size(), 300U);
    EXPECT_LT(label_figures(truth, points, judge_points(truth, points)).wrong.value(), 0.01)
        << turn.transpose();
    const RigFit fit = check_rig_over_frames(wrong, {&curves, 1}).front().fit;
    // Of two cameras and two projectors, others may seem to have moved a little too.
    EXPECT_TRUE(fit.verdict == RigVerdict::kOneMoved || fit.verdict == RigVerdict::kSeveralMoved)
        << fit.text;
    EXPECT_NEAR(fit.devices[1].shift_px, turn.norm(), 4) << fit.text;
  }
}

}  // namespace
}  // namespace pencilscan
