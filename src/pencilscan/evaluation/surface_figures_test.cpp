#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/random.h"
#include "pencilscan/evaluation/evaluate.h"
#include "pencilscan/evaluation/synthetic_oracle.h"
#include "pencilscan/evaluation/truth_check.h"

namespace pencilscan {
namespace {

constexpr int kSphereRings = 60;
constexpr double kSagMm = 0.05;  // of the facets of such a sphere below the ideal one

CompletenessOptions few_samples() {
  CompletenessOptions options;
  options.sample_count = 10000;
  return options;
}

TEST(SampleSurface, PointsLieOnTheSurfaceUniformly) {
  const auto samples = sample_surface(make_box({10, 20, 30}), 22000, 5);
  ASSERT_EQ(samples.size(), 22000U);
  std::size_t on_x = 0;
  for (const auto& s : samples) {
    EXPECT_NEAR((s.point.array() / Eigen::Array3d(5, 10, 15)).abs().maxCoeff(), 1, 1e-9);
    on_x += std::abs(s.normal.x()) > 0.5 ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(on_x) / 22000, 1200.0 / 2200, 0.001);  // stratified by face
}

TEST(SurfaceFigures, SphereLargerByOneMillimetreIsOneMillimetreAway) {
  const TruthScene truth(make_sphere(oracle::kRadiusMm, kSphereRings), oracle::ring(3));
  const auto figures =
      surface_figures(truth, make_sphere(oracle::kRadiusMm + 1, kSphereRings), few_samples());
  EXPECT_NEAR(figures.distance.median_mm, 1, kSagMm);
  EXPECT_NEAR(figures.distance.p90_mm, 1, kSagMm);
  EXPECT_NEAR(figures.distance.rms_mm, 1, kSagMm);
  EXPECT_EQ(figures.distance.share_above_2mm, 0);
  ASSERT_EQ(figures.completeness.size(), 3U);
  EXPECT_EQ(figures.completeness[0].measurable, 0);  // at 0.5 mm
  EXPECT_EQ(figures.completeness[2].measurable, 1);  // at 2 mm
  EXPECT_EQ(figures.completeness[2].f_score, 1);
}

TEST(SurfaceFigures, SigmaIsJudgedWhereTheMeshIsMeasured) {
  const TruthScene truth(make_sphere(oracle::kRadiusMm, kSphereRings), oracle::ring(3));
  TriangleMesh mesh = make_sphere(oracle::kRadiusMm + 1, kSphereRings);
  EXPECT_FALSE(surface_figures(truth, mesh, few_samples()).sigma);
  // A third of the vertices says 0.6 mm, a third 1.2 mm, and the last was not measured.
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    mesh.sigma.push_back(v % 3 == 0 ? 0.6F : 1.2F);
    mesh.confidence.push_back(v % 3 == 2 ? 0.0F : 1.0F);
  }
  const auto sigma = surface_figures(truth, mesh, few_samples()).sigma;
  ASSERT_TRUE(sigma);
  const double vertices = static_cast<double>(mesh.vertices.size());
  EXPECT_NEAR(static_cast<double>(sigma->below_one.count), vertices * 2 / 3, 1);
  EXPECT_NEAR(sigma->below_one.value(), 0.5, 0.01);
  EXPECT_EQ(sigma->below_two.value(), 1);
  EXPECT_EQ(sigma->tenths.front(), 0);
  EXPECT_EQ(sigma->tenths.back(), 1);
}

/// A sheet of 100 mm before the first camera of a rig, and its figures where its facets are wound
/// by `wound(facet)` away from it.
template <class Wound>
SurfaceFigures figures_of_a_sheet(const Wound& wound) {
  constexpr int kSide = 20;
  constexpr double kStepMm = 5;
  const Rig rig = oracle::ring(3);
  const Vec3 out = rig.cameras[0].center().normalized();
  const Vec3 right = Vec3::UnitZ().cross(out).normalized();
  TriangleMesh sheet;
  for (int j = 0; j <= kSide; ++j)
    for (int i = 0; i <= kSide; ++i)
      sheet.vertices.push_back(kStepMm *
                               ((i - kSide / 2) * right + (j - kSide / 2) * out.cross(right)));
  for (int j = 0; j < kSide; ++j) {
    for (int i = 0; i < kSide; ++i) {
      const int a = j * (kSide + 1) + i;
      sheet.faces.push_back({a, a + 1, a + kSide + 2});
      sheet.faces.push_back({a, a + kSide + 2, a + kSide + 1});
    }
  }
  const TriangleMesh measured = sheet;  // as meshes of ours are, it faces the camera
  for (std::size_t f = 0; f < sheet.faces.size(); ++f)
    if (wound(f)) std::swap(sheet.faces[f][1], sheet.faces[f][2]);
  return surface_figures(TruthScene(sheet, rig), measured, few_samples());
}

TEST(SurfaceFigures, AnOpenTruthIsSeenFromBothSides) {
  const auto facing = figures_of_a_sheet([](std::size_t) { return false; });
  EXPECT_GT(facing.measurable_share, 0.3);
  EXPECT_EQ(facing.completeness[0].measurable, 1);
  const auto away = figures_of_a_sheet([](std::size_t) { return true; });
  const auto mixed = figures_of_a_sheet([](std::size_t f) { return f % 3 == 0; });
  for (const SurfaceFigures& figures : {away, mixed}) {
    // Facets that turn have their samples elsewhere.
    EXPECT_NEAR(figures.measurable_share, facing.measurable_share, 0.02);
    EXPECT_NEAR(figures.lit_by_one_share, facing.lit_by_one_share, 0.02);
    EXPECT_EQ(figures.completeness[0].measurable, 1);
  }
}

TEST(SurfaceFigures, EachClosedPartOfTheTruthFacesOutwards) {
  const TriangleMesh ball = make_sphere(30, kSphereRings, {0, 0, 40});
  TriangleMesh both = make_sphere(30, kSphereRings, {0, 0, -40});
  const auto first = static_cast<int>(both.vertices.size());
  both.vertices.insert(both.vertices.end(), ball.vertices.begin(), ball.vertices.end());
  TriangleMesh turned = both;
  for (const auto& f : ball.faces) {
    both.faces.push_back({first + f[0], first + f[1], first + f[2]});
    turned.faces.push_back({first + f[0], first + f[2], first + f[1]});
  }
  turned.vertices.emplace_back(1e4, 0, 0);  // of no face
  const TruthScene truth(turned, oracle::ring(3));
  EXPECT_EQ(truth.scene().mesh().faces, both.faces);
  EXPECT_EQ(truth.diameter_mm(), TruthScene(both, oracle::ring(3)).diameter_mm());
  EXPECT_FALSE(truth.is_two_sided(0));
}

TEST(SurfaceFigures, HalfASphereIsHalfComplete) {
  const TriangleMesh whole = make_sphere(oracle::kRadiusMm, kSphereRings);
  TriangleMesh half = whole;
  std::erase_if(half.faces, [&](const std::array<int, 3>& f) {
    double z = 0;
    for (const int v : f) z += whole.vertices[static_cast<std::size_t>(v)].z();
    return z < 0;
  });
  Rig rig = oracle::ring(6);
  // Level projectors make the measurable surface symmetric about z = 0.
  for (Projector& p : rig.projectors) {
    p.device_from_world = look_at({p.center().x(), p.center().y(), 0}, Vec3::Zero());
  }
  const TruthScene truth(whole, rig);
  const auto figures = surface_figures(truth, half, few_samples());
  constexpr double kSampling = 0.02;  // four standard errors of a share of 10000
  EXPECT_NEAR(figures.completeness[0].measurable, 0.5, kSampling);
  EXPECT_NEAR(figures.completeness[0].lit_by_one, 0.5, kSampling);
  EXPECT_NEAR(figures.completeness[0].lit_by_two, 0.5, kSampling);
  EXPECT_EQ(figures.completeness[0].precision, 1);
  EXPECT_NEAR(figures.completeness[0].f_score, 2.0 / 3, kSampling);
  // Turned inside out it is near but faces the wrong way.
  for (auto& f : half.faces) std::swap(f[0], f[1]);
  EXPECT_LT(surface_figures(truth, half, few_samples()).completeness[0].measurable, 0.001);
}

TEST(SurfaceFigures, MeasurableCapOfASphereIsTheClosedForm) {
  Rig rig = oracle::ring(1, 40);  // lines 27 px apart: spacing never limits below 75 degrees
  rig.projectors[0].device_from_world = rig.cameras[0].device_from_world;
  const TruthScene truth(make_sphere(oracle::kRadiusMm, 120), rig);
  const auto samples = sample_surface(truth.scene().mesh(), 20000, 1);
  Share measurable;
  Share seen;
  for (const auto& c : surface_coverage(truth, samples)) {
    measurable.add(c.measurable);
    seen.add(c.seen && c.lit_by >= 1);
  }
  // Incidence i is reached at the polar angle i - asin(R sin i / D); a cap holds (1 - cos) / 2.
  const auto cap = [](double incidence) {
    const double ratio = oracle::kRadiusMm / oracle::kDeviceDistanceMm;
    const double polar = incidence - std::asin(ratio * std::sin(incidence));
    return (1 - std::cos(polar)) / 2;
  };
  constexpr double kSampling = 0.01;
  EXPECT_NEAR(measurable.value(), cap(75 * std::numbers::pi / 180), kSampling);
  EXPECT_NEAR(seen.value(), cap(std::numbers::pi / 2), kSampling);
}

/// A body without symmetry, and points of it in another frame, some of them wrong.
struct Displaced {
  TriangleMesh mesh = make_box({100, 150, 220});
  std::vector<Vec3> points;
};
Displaced displaced(const Similarity& truth_from_result) {
  Displaced d;
  d.mesh.vertices[0] += Vec3(30, 40, 50);
  d.mesh.vertices[5] += Vec3(-20, 10, 5);
  Random random(7);
  const Similarity result_from_truth = truth_from_result.inverse();
  for (const auto& s : sample_surface(d.mesh, 3000, 3)) {
    Vec3 p = s.point;
    if (random.uniform() < 0.1) p += 30 * Vec3(random.normal(), random.normal(), random.normal());
    d.points.push_back(result_from_truth * p);
  }
  return d;
}

void expect_near(const Similarity& a, const Similarity& b, double scale_tolerance,
                 double length_tolerance_mm) {
  EXPECT_NEAR(a.scale, b.scale, scale_tolerance * b.scale);
  EXPECT_NEAR((a.rotation - b.rotation).norm(), 0, scale_tolerance);
  EXPECT_NEAR((a.translation - b.translation).norm(), 0, length_tolerance_mm);
}

TEST(Alignment, RecoversASmallRigidMotionDespiteOutliers) {
  Similarity truth_from_result;
  truth_from_result.rotation =
      Eigen::AngleAxisd(0.05, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  truth_from_result.translation = {3, -2, 4};
  const auto d = displaced(truth_from_result);
  const auto report = align_to_surface(d.points, RayScene(d.mesh), AlignmentKind::kRigid);
  expect_near(report.truth_from_result, truth_from_result, 1e-4, 0.01);
  EXPECT_LT(report.median_mm, 1e-3);
}

TEST(Alignment, RecoversALargeSimilarity) {
  Similarity truth_from_result;
  truth_from_result.scale = 250;  // a result without known unit
  truth_from_result.rotation =
      Eigen::AngleAxisd(2.2, Vec3(-1, 0.5, 2).normalized()).toRotationMatrix();
  truth_from_result.translation = {300, -120, 45};
  const auto d = displaced(truth_from_result);
  const auto report = align_to_surface(d.points, RayScene(d.mesh), AlignmentKind::kSimilarity);
  expect_near(report.truth_from_result, truth_from_result, 1e-4, 0.05);
}

TriangleMesh joined(TriangleMesh a, const TriangleMesh& b) {
  const auto first = static_cast<int>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const auto& f : b.faces) a.faces.push_back({first + f[0], first + f[1], first + f[2]});
  return a;
}

/// A tube along a (2, 3) torus knot: seen from above alike after a third of a turn, and its
/// principal axes say nothing of how it is turned about z.
TriangleMesh knot_tube() {
  constexpr int kAlong = 300, kAround = 24;
  const auto curve = [](double t) -> Vec3 {
    const double r = 95 + 35 * std::cos(3 * t);
    return {r * std::cos(2 * t), r * std::sin(2 * t), -45 * std::sin(3 * t)};
  };
  TriangleMesh mesh;
  for (int i = 0; i < kAlong; ++i) {
    const double t = 2 * std::numbers::pi * i / kAlong;
    const Vec3 tangent = (curve(t + 1e-4) - curve(t - 1e-4)).normalized();
    const Vec3 side = tangent.cross(Vec3::UnitZ()).normalized();
    for (int k = 0; k < kAround; ++k) {
      const double angle = 2 * std::numbers::pi * k / kAround;
      mesh.vertices.emplace_back(
          curve(t) + 22 * (std::cos(angle) * side + std::sin(angle) * side.cross(tangent)));
      const auto at = [&](int along, int around) {
        return (along % kAlong) * kAround + around % kAround;
      };
      mesh.faces.push_back({at(i, k), at(i, k + 1), at(i + 1, k + 1)});
      mesh.faces.push_back({at(i, k), at(i + 1, k + 1), at(i + 1, k)});
    }
  }
  return mesh;
}

/// A box that looks alike after a quarter of a turn about z, but for a knob on one side.
TriangleMesh knobbed_box() {
  return joined(make_box({180, 180, 140}),
                transformed(make_box({30, 40, 40}), {1, Mat3::Identity(), {95, 30, 20}}));
}

/// Points of a surface with noise, in another frame; where it faces `side`, if that is given.
std::vector<Vec3> measured(const TriangleMesh& mesh, const Similarity& truth_from_result,
                           double noise_mm, const Vec3& side = Vec3::Zero()) {
  Random random(11);
  std::vector<Vec3> points;
  for (const auto& s : sample_surface(mesh, 6000, 4)) {
    if (s.normal.dot(side) < 0) continue;
    points.push_back(truth_from_result.inverse() *
                     (s.point + noise_mm * random.normal() * s.normal));
  }
  return points;
}

Similarity turned(double angle_rad, const Vec3& axis, const Vec3& shift) {
  return {1, Eigen::AngleAxisd(angle_rad, axis.normalized()).toRotationMatrix(), shift};
}

TEST(Alignment, FindsAShapeWhoseAxesSayNothingFromAnyTurn) {
  const TriangleMesh mesh = knot_tube();
  const RayScene truth(mesh);
  constexpr double kNoiseMm = 0.05;
  for (const Similarity& pose :
       {turned(1.05, Vec3::UnitZ(), {2, 300, -4}), turned(-0.5, Vec3::UnitZ(), {0, 0, 9}),
        turned(2.0, {1, 2, -1}, {40, -20, 10}), turned(3.1, {1, 0, 0.2}, {0, 0, 0})}) {
    for (const Vec3& side : {Vec3(0, 0, 0), Vec3(1, 0.3, 0.4)}) {
      const auto points = measured(mesh, pose, kNoiseMm, side);
      const auto report = align_to_surface(points, truth, AlignmentKind::kRigid);
      EXPECT_LT(report.median_mm, kNoiseMm);
    }
  }
}

TEST(Alignment, APartThatStandsOutTellsTurnsOfABoxApart) {
  const TriangleMesh mesh = knobbed_box();
  const RayScene truth(mesh);
  for (const double turn : {0.0, 0.5, 1.0, 1.5}) {
    const Similarity pose = turned(turn * std::numbers::pi + 0.02, Vec3(0.1, -0.1, 5), {3, -5, 8});
    const auto report = align_to_surface(measured(mesh, pose, 0.1), truth, AlignmentKind::kRigid);
    expect_near(report.truth_from_result, pose, 1e-3, 0.1);
  }
}

/// The warnings of points that were moved onto the truth.
std::string warnings_when_moved(const TriangleMesh& truth, std::span<const Vec3> points) {
  const Rig rig = oracle::ring(2);
  EvaluationInput input;
  input.points.emplace();
  for (const Vec3& x : points) set_position(x, input.points->emplace_back());
  EvaluationOptions options;
  options.align = AlignmentKind::kRigid;
  const auto figures = figures_json(evaluate(truth, rig, input, options), rig);
  return figures.contains("warnings") ? figures.at("warnings").dump() : "";
}

TEST(Alignment, TellsWhereAnotherPoseIsAboutAsGood) {
  using ::testing::HasSubstr;
  constexpr double kNoiseMm = 0.1;
  const Similarity pose = turned(0.1, {1, 2, 3}, {3, -5, 8});
  EXPECT_EQ(warnings_when_moved(knobbed_box(), measured(knobbed_box(), pose, kNoiseMm)), "");
  // Where the knob is, nothing was measured, on no side.
  std::vector<Vec3> elsewhere;
  for (const Vec3& point : measured(make_box({180, 180, 140}), pose, kNoiseMm)) {
    const Vec3 on_box = pose * point;
    if (std::min(std::abs(on_box.x()), std::abs(on_box.y())) > 55 || std::abs(on_box.z()) > 69)
      elsewhere.push_back(point);
  }
  EXPECT_THAT(warnings_when_moved(knobbed_box(), elsewhere), HasSubstr("looks alike"));
  // Every pose of what is really symmetric gives the same figures.
  const TriangleMesh box = make_box({180, 180, 140});
  EXPECT_EQ(warnings_when_moved(box, measured(box, pose, kNoiseMm)), "");
  const TriangleMesh ball = make_sphere(oracle::kRadiusMm, kSphereRings);
  EXPECT_EQ(warnings_when_moved(ball, measured(ball, pose, kNoiseMm)), "");
}

TEST(Evaluate, PerfectPointsHavePerfectFigures) {
  const Rig rig = oracle::ring(3);
  EvaluationInput input;
  input.points = oracle::sphere_points(rig);
  input.mesh = make_sphere(oracle::kRadiusMm, kSphereRings);
  EvaluationOptions options;
  options.completeness = few_samples();
  const auto json = figures_json(
      evaluate(make_sphere(oracle::kRadiusMm, kSphereRings), rig, input, options), rig);
  constexpr double kRim = 0.001;  // rays at the rim of the ideal sphere that miss the faceted one
  EXPECT_LT(json.at("label_error").get<double>(), kRim);
  EXPECT_GT(json.at("line_recall").get<double>(), 0.99);
  EXPECT_LT(json.at("distance_median_mm").get<double>(), kSagMm);
  EXPECT_EQ(json.at("share_above_2mm"), 0);
  EXPECT_EQ(json.at("completeness_0.5mm"), 1);
  EXPECT_EQ(json.at("completeness_1mm"), 1);
  EXPECT_EQ(json.at("f_score_2mm"), 1);
  EXPECT_EQ(json.at("sigma_rank_correlation"), 0);
  EXPECT_EQ(json.at("by_projector").size(), 3U);
}

TEST(Evaluate, SimilarityAlignmentCountsInTheUnitOfTheTruth) {
  const Rig rig = oracle::ring(3);
  EvaluationInput input;
  input.points = oracle::sphere_points(rig);
  input.mesh = make_sphere(oracle::kRadiusMm, kSphereRings);
  // The truth is ten times as large and elsewhere: the result's unit is a centimetre.
  Similarity truth_from_result;
  truth_from_result.scale = 10;
  truth_from_result.translation = {50, 5000, -70};
  EvaluationOptions options;
  options.align = AlignmentKind::kSimilarity;
  options.completeness = few_samples();
  const auto evaluation = evaluate(
      transformed(make_sphere(oracle::kRadiusMm, 90), truth_from_result), rig, input, options);
  EXPECT_NEAR(evaluation.alignment->truth_from_result.scale, 10, 0.01);
  EXPECT_LT(evaluation.labels->wrong.value(), 0.001);
  EXPECT_GT(evaluation.recall->recall.value(), 0.99);
  EXPECT_LT(evaluation.point_distance->median_mm, 10 * kSagMm);
  EXPECT_EQ(evaluation.surface->completeness[2].measurable, 1);
}

TEST(Evaluate, FiguresAreTheSameForAnyThreadCount) {
  const Rig rig = oracle::ring(2);
  EvaluationInput input;
  input.points = oracle::sphere_points(rig);
  input.mesh = make_sphere(oracle::kRadiusMm + 0.3, 20);
  EvaluationOptions options;
  options.align = AlignmentKind::kRigid;
  options.completeness.sample_count = 3000;
  const auto run = [&](int threads) {
    const ThreadLimit limit(threads);
    return figures_json(evaluate(make_sphere(oracle::kRadiusMm, 40), rig, input, options), rig)
        .dump();
  };
  EXPECT_EQ(run(1), run(3));
}

/// What a Gray-code scan measures of the sphere: panel columns at every eighth pixel.
std::vector<MeasuredPoint> scanned_sphere(const Rig& rig, float sigma) {
  std::vector<MeasuredPoint> points;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    for (int v = 0; v < rig.cameras[c].height; v += 8) {
      for (int u = 0; u < rig.cameras[c].width; u += 8) {
        const auto x = oracle::on_sphere(rig.cameras[c].ray(Vec2(u, v)));
        if (!x || x->dot(rig.projectors[c].center() - *x) <= 0) continue;
        MeasuredPoint point;
        set_position(*x, point);
        point.u = static_cast<float>(u);
        point.v = static_cast<float>(v);
        point.camera = point.projector = static_cast<std::uint8_t>(c);
        point.plane = static_cast<float>(rig.projectors[c].project(*x)->x());
        point.line = static_cast<std::uint16_t>(std::lround(point.plane));
        point.sigma = sigma;
        point.confidence = 1;
        points.push_back(point);
      }
    }
  }
  return points;
}

TEST(Evaluate, PointsOfAScanHaveNoLinesAndNeedNone) {
  Rig rig = oracle::ring(3);
  EvaluationInput input;
  input.points = scanned_sphere(rig, 1);
  ASSERT_GT(input.points->size(), 500U);
  for (const bool with_patterns : {true, false}) {
    if (!with_patterns)
      for (Projector& projector : rig.projectors) projector.patterns.clear();
    const auto json =
        figures_json(evaluate(make_sphere(oracle::kRadiusMm, kSphereRings), rig, input), rig);
    EXPECT_EQ(json.at("points"), input.points->size());
    EXPECT_LT(json.at("distance_median_mm").get<double>(), kSagMm);
    EXPECT_GT(json.at("sigma_below_1").get<double>(), 0.98);  // but for rays at the rim
    for (const char* key : {"label_error", "line_recall", "largest_wrong_patch_mm2",
                            "right_by_confidence", "by_projector", "by_spacing", "warnings"})
      EXPECT_FALSE(json.contains(key)) << key;
  }
}

TEST(Evaluate, PointsWithLinesAreNoScan) {
  const Rig rig = oracle::ring(2);
  EXPECT_FALSE(are_of_gray_scan(oracle::sphere_points(rig)));
  // Of another program, which counts in whole pixels and lines.
  std::vector<MeasuredPoint> points = scanned_sphere(rig, 1);
  EXPECT_TRUE(are_of_gray_scan(points));
  // 754.4999999 is nearer to 754, and is 754.5 as a float; 754.5000001 is nearer to 755.
  points[0].plane = points[1].plane = 754.5F;
  points[0].line = 754;
  points[1].line = 755;
  points[2].plane = -0.7F;  // beside the panel
  points[2].line = 0;
  EXPECT_TRUE(are_of_gray_scan(points));
  points[1].line = 756;
  EXPECT_FALSE(are_of_gray_scan(points));
  points[1].line = 755;
  for (MeasuredPoint& point : points) point.plane = point.line;
  EXPECT_FALSE(are_of_gray_scan(points));
  EXPECT_FALSE(are_of_gray_scan({}));
}

/// The warning about a truth, "" without one.
std::string warning_of(const TriangleMesh& truth, std::span<const Vec3> points) {
  return truth_warning(RayScene(truth), points).value_or("");
}

TEST(TruthWarning, NamesAMeshOfAnotherSizeOrPlace) {
  using ::testing::HasSubstr;
  const auto sphere = [](double radius, const Vec3& center) {
    return transformed(make_sphere(radius, kSphereRings), {1, Mat3::Identity(), center});
  };
  const std::vector<Vec3> points = make_sphere(100, kSphereRings).vertices;
  EXPECT_THAT(warning_of(sphere(0.1, Vec3::Zero()), points),
              HasSubstr("the truth is probably in metres instead of millimetres"));
  EXPECT_THAT(warning_of(sphere(100 / 25.4, Vec3::Zero()), points), HasSubstr("in inches"));
  for (const TriangleMesh& truth :
       {sphere(2.7, Vec3::Zero()), sphere(50, Vec3::Zero()), sphere(700, Vec3::Zero()),
        sphere(100, {80, 0, 0}), sphere(100, {0, 5000, 0})})
    EXPECT_THAT(warning_of(truth, points), HasSubstr("it is truth/mesh.ply in the scene's folder"));
}

TEST(TruthWarning, ATruthInMillimetresIsNotBlamedForAResultInAnotherUnit) {
  using ::testing::HasSubstr;
  const TriangleMesh truth = make_sphere(100, kSphereRings);
  EXPECT_THAT(warning_of(truth, make_sphere(0.1, kSphereRings).vertices),
              HasSubstr("the result is probably in metres instead of millimetres, or the truth in "
                        "micrometres"));
  EXPECT_THAT(warning_of(truth, make_sphere(100 / 25.4, kSphereRings).vertices),
              HasSubstr("the result is probably in inches instead of millimetres"));
}

TEST(UnitWarning, FiguresOfAnUnknownUnitAreNotInMillimetres) {
  Rig rig;
  EXPECT_FALSE(unit_warning(rig, AlignmentKind::kNone));
  rig.unit_known = false;
  EXPECT_TRUE(unit_warning(rig, AlignmentKind::kNone));
  EXPECT_TRUE(unit_warning(rig, AlignmentKind::kRigid));
  EXPECT_FALSE(unit_warning(rig, AlignmentKind::kSimilarity));
}

TEST(TruthWarning, IsSilentOfPartsAndOfResultsThatAreALittleOff) {
  const TriangleMesh truth = make_sphere(100, kSphereRings);
  std::vector<Vec3> part, larger, noisy;
  Random random(3);
  for (const Vec3& vertex : truth.vertices) {
    if (vertex.z() > 90) part.push_back(vertex);
    larger.push_back(1.1 * vertex);
    noisy.push_back(vertex + 3 * Vec3(random.normal(), random.normal(), random.normal()));
    if (noisy.size() % 4 == 0) noisy.back() *= 5;  // a quarter is wrong
  }
  for (const auto& points : {truth.vertices, part, larger, noisy, std::vector<Vec3>()})
    EXPECT_EQ(warning_of(truth, points), "");
}

TEST(Evaluate, WarnsOfATruthThatIsNoneUnlessItIsMovedThere) {
  const Rig rig = oracle::ring(2);
  EvaluationInput input;
  input.points = oracle::sphere_points(rig);
  const TriangleMesh truth =
      transformed(make_sphere(oracle::kRadiusMm, kSphereRings), {1, Mat3::Identity(), {0, 90, 0}});
  EvaluationOptions options;
  const auto figures = figures_json(evaluate(truth, rig, input, options), rig);
  ASSERT_EQ(figures.at("warnings").size(), 1U);
  EXPECT_THAT(figures.at("warnings")[0].get<std::string>(), ::testing::HasSubstr("hardly"));
  options.align = AlignmentKind::kRigid;
  EXPECT_TRUE(evaluate(truth, rig, input, options).warnings.empty());
}

TEST(OtherRigWarning, NamesARigThatDidNotMakeThePoints) {
  const Rig rig = oracle::ring(3);
  const std::vector<MeasuredPoint> points = oracle::sphere_points(rig);
  EXPECT_FALSE(other_rig_warning(rig, points));
  EXPECT_FALSE(other_rig_warning(rig, {}));
  Rig other = rig;
  std::swap(other.cameras[0], other.cameras[1]);
  EXPECT_TRUE(other_rig_warning(other, points));
  // Devices that moved a little since are those of the result.
  const auto turned_by = [&](double px) {
    Rig turned = rig;
    for (Camera& camera : turned.cameras) camera.K(0, 2) += px;
    return other_rig_warning(turned, points);
  };
  EXPECT_FALSE(turned_by(0.9));
  ASSERT_TRUE(turned_by(3));
  EXPECT_THAT(*turned_by(3), ::testing::HasSubstr("half of the points 3 px and more beside"));
}

TEST(Evaluate, NamesTheVertexThatTheRigCannotHold) {
  const Rig rig = oracle::ring(2);
  EvaluationInput input;
  input.points = std::vector<MeasuredPoint>(1);
  input.points->front().projector = 7;
  try {
    (void)evaluate(make_sphere(oracle::kRadiusMm, 8), rig, input);
    FAIL() << "no InputError";
  } catch (const InputError& error) {
    EXPECT_THAT(error.field, ::testing::HasSubstr("projector"));
    EXPECT_EQ(error.value, "7");
  }
}

}  // namespace
}  // namespace pencilscan
