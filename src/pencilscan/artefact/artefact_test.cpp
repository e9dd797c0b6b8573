#include "pencilscan/artefact/artefact.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "pencilscan/artefact/plate_face.h"
#include "pencilscan/artefact/sphere_fit.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/random.h"
#include "pencilscan/io/curve_file.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/labeling/point_file.h"

namespace pencilscan {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

/// Places spread evenly over a sphere (a Fibonacci lattice); `deviation(i)` is radial.
template <typename Deviation>
void add_ball(std::vector<Vec3>& points, const Sphere& sphere, int count,
              const Deviation& deviation) {
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2.0 * i + 1) / count, r = std::sqrt(1 - z * z);
    const Vec3 d(r * std::cos(golden * i), r * std::sin(golden * i), z);
    points.push_back(sphere.center + (sphere.radius + deviation(i)) * d);
  }
}

ArtefactPoints as_points(std::vector<Vec3> points) {
  ArtefactPoints result;
  result.source = "test";
  result.points = std::move(points);
  return result;
}

std::vector<Vec3> plate_points(double thickness, const RigidTransform& world_from_plate,
                               std::uint64_t seed);

/// What measuring ends with, where it does.
template <typename Measure>
std::string complaint_of(const Measure& measure) {
  try {
    (void)measure();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "none";
}

constexpr int kMany = 20'000;  // dense enough for whole coverage: 1 % of the diameter apart

TEST(ArtefactSphere, FormIsTheRangeOfKnownDeviations) {
  std::vector<Vec3> points;
  // Rings of +a and -a in turn: the mean is none, so the fit is the nominal sphere.
  add_ball(points, {{3, 4, 5}, 25}, kMany, [](int i) { return i % 2 == 0 ? 0.04 : -0.04; });
  ArtefactOptions options;
  options.diameter_mm = 49.9;
  const BallFigures ball = measure_sphere(as_points(points), nullptr, options);
  EXPECT_NEAR(ball.form_mm.all, 0.08, 1e-4);
  // Any 60 of equal size are the worst: without them the rest leans a little.
  EXPECT_NEAR(ball.form_mm.trimmed, 0.08, 1e-3);
  ASSERT_TRUE(ball.size_mm);
  EXPECT_NEAR(ball.size_mm->all, 0.1, 1e-4);
  EXPECT_EQ(ball.removed, 60U);
  EXPECT_DOUBLE_EQ(ball.coverage, 1);
}

TEST(ArtefactSphere, OnePointDecidesTheFormUntilItIsRemoved) {
  std::vector<Vec3> points;
  Random random(1);
  add_ball(points, {{-30, 0, 700}, 20}, kMany, [&](int) { return random.uniform(-0.01, 0.01); });
  points[777] = {90, 0, 700};  // 100 mm outside
  const BallFigures ball = measure_sphere(as_points(points), nullptr, {});
  EXPECT_NEAR(ball.form_mm.all, 100, 0.1);
  EXPECT_LT(ball.form_mm.trimmed, 0.0201);
  EXPECT_GT(ball.form_mm.trimmed, 0.018);
  EXPECT_EQ(ball.worst.front().index, 777U);
  EXPECT_NEAR(ball.worst.front().distance, 100, 0.1);
  EXPECT_FALSE(ball.size_mm);
}

/// Greatest minus least distance of the points that a table of worst points shows.
double range_of(const std::vector<WorstPoint>& worst) {
  const auto [least, greatest] = std::minmax_element(
      worst.begin(), worst.end(),
      [](const WorstPoint& a, const WorstPoint& b) { return a.distance < b.distance; });
  return greatest->distance - least->distance;
}

TEST(ArtefactFigures, AreTheRangeOfTheWorstPoints) {
  Random random(18);
  std::vector<Vec3> ball;
  // Far points on one side only, more than the table holds, which draw the sphere to them.
  add_ball(ball, {{0, 0, 700}, 20}, 2000,
           [&](int i) { return i % 100 == 0 ? 3 : random.uniform(-0.01, 0.01); });
  const BallFigures sphere = measure_sphere(as_points(ball), nullptr, {});
  EXPECT_EQ(sphere.worst.size(), 10U);
  EXPECT_DOUBLE_EQ(range_of(sphere.worst), sphere.form_mm.all);
  std::vector<Vec3> plate = plate_points(0, RigidTransform(), 18);
  for (int i = 0; i < 20; ++i) plate.push_back({5.0 * i, 50, 7});
  const PlateFigures plane = measure_plate(as_points(plate), nullptr, {});
  EXPECT_DOUBLE_EQ(range_of(plane.worst), plane.flatness_mm.all);
}

TEST(ArtefactSphere, LittleCoverageIsTold) {
  std::vector<Vec3> points;
  add_ball(points, {{0, 0, 0}, 10}, 2 * kMany, [](int) { return 0.0; });
  const auto warnings_above = [&](double z) {
    std::vector<Vec3> cap;
    for (const Vec3& point : points)
      if (point.z() > z) cap.push_back(point);
    return artefact_warnings(measure_sphere(as_points(cap), nullptr, {}), {});
  };
  EXPECT_THAT(warnings_above(4), ::testing::IsEmpty());  // 30 %
  EXPECT_THAT(warnings_above(8), ::testing::ElementsAre(HasSubstr("of the ball has points")));
}

TEST(ArtefactSphere, CoverageIsTheShareOfTheBallThatHasPoints) {
  std::vector<Vec3> points, upper;
  add_ball(points, {{0, 0, 0}, 10}, 2 * kMany, [](int) { return 0.0; });
  for (const Vec3& point : points)
    if (point.z() > 5) upper.push_back(point);
  // A cap above z = 5 is a quarter; 1 % of the diameter round it makes 0.2 sin 60 / 20 more.
  const BallFigures ball = measure_sphere(as_points(upper), nullptr, {});
  EXPECT_NEAR(ball.coverage, 0.25 + 0.2 * std::sin(std::numbers::pi / 3) / 20, 0.005);
}

TEST(ArtefactSphere, ABallOfAnotherSizeIsCoveredAndItsSizeTold) {
  std::vector<Vec3> points;
  add_ball(points, {{0, 0, 0}, 1.09 * 35}, kMany, [](int) { return 0.0; });
  ArtefactOptions options;
  options.diameter_mm = 70;
  const BallFigures ball = measure_sphere(as_points(points), nullptr, options);
  EXPECT_GT(ball.coverage, 0.99);
  EXPECT_THAT(artefact_warnings(ball, options),
              ::testing::ElementsAre(HasSubstr("the ball is 76.3 mm across, 9 % more than "
                                               "--diameter = 70 mm")));
  options.diameter_mm = 1.09 * 70 / 0.99;  // as a rig may be off
  EXPECT_THAT(artefact_warnings(measure_sphere(as_points(points), nullptr, options), options),
              ::testing::IsEmpty());
}

TEST(ArtefactSphere, FiguresTurnScaleAndMoveWithThePoints) {
  std::vector<Vec3> points, moved;
  Random random(2);
  add_ball(points, {{0, 0, 0}, 20}, 3000, [&](int) { return random.normal(0, 0.02); });
  const Mat3 turn = Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  for (const Vec3& point : points) moved.push_back(1000 * (turn * point) + Vec3(5e3, -2e4, 1e5));
  const BallFigures a = measure_sphere(as_points(points), nullptr, {});
  const BallFigures b = measure_sphere(as_points(moved), nullptr, {});
  EXPECT_NEAR(b.form_mm.all / a.form_mm.all, 1000, 1e-6 * 1000);
  EXPECT_NEAR(b.form_mm.trimmed / a.form_mm.trimmed, 1000, 1e-6 * 1000);
  EXPECT_NEAR(b.coverage, a.coverage, 0.01);
}

TEST(ArtefactSphere, AStemIsLeftOutAndCounted) {
  std::vector<Vec3> points;
  add_ball(points, {{0, 0, 0}, 10}, kMany, [](int) { return 0.0; });
  for (int i = 0; i < 500; ++i)
    points.emplace_back(2 * std::cos(0.1 * i), 2 * std::sin(0.1 * i), -10 - 0.05 * i);
  ArtefactOptions options;
  EXPECT_GT(measure_sphere(as_points(points), nullptr, options).form_mm.all, 10);
  options.stem = LeftOutCone{-Vec3::UnitZ(), 20 * std::numbers::pi / 180};
  const BallFigures ball = measure_sphere(as_points(points), nullptr, options);
  EXPECT_LT(ball.form_mm.all, 1e-6);
  EXPECT_NEAR(static_cast<double>(ball.left_out), 500 + kMany * 0.5 * (1 - std::cos(0.349)), 30);
  EXPECT_LT(ball.coverage, 0.98);
}

TEST(ArtefactSphere, ScoresOfPointsThatKnowTheirErrorAreIdeal) {
  Rig rig;
  rig.cameras.resize(1);
  rig.cameras[0].device_from_world = look_at({800, 0, 0}, Vec3::Zero());
  const Sphere sphere{{0, 0, 0}, 25};
  const Vec3 eye = rig.cameras[0].center();
  Random random(5);
  ArtefactPoints points;
  points.source = "test";
  while (points.points.size() < 4000) {
    const Vec3 d = Vec3(random.normal(), random.normal(), random.normal()).normalized();
    if (d.x() < 0.3) continue;  // turned away, or grazing
    const Vec3 on = sphere.radius * d;
    const double sigma = random.uniform(0.01, 0.05);
    points.points.push_back(on + random.normal(0, sigma) * (on - eye).normalized());
    points.sigma.push_back(static_cast<float>(sigma));
    points.origins.push_back({});
  }
  const BallFigures ball = measure_sphere(points, &rig, {});
  ASSERT_TRUE(ball.z);
  EXPECT_EQ(ball.z->count, 4000U);
  EXPECT_EQ(ball.z->missed, 0U);
  EXPECT_NEAR(ball.z->below_1, 0.683, 0.03);
  EXPECT_NEAR(ball.z->below_2, 0.954, 0.015);
  EXPECT_NEAR(ball.z->rms, 1, 0.05);
  EXPECT_FALSE(measure_sphere(points, nullptr, {}).z) << "where the cameras are is not known";
}

TEST(ArtefactSphere, AScaleThatIsOffBySomePerCentIsMeasured) {
  for (const double scale : {0.94, 1.06}) {
    std::vector<Vec3> points;
    add_ball(points, {{3, 4, 5}, scale * 40}, 2000, [](int) { return 0.0; });
    ArtefactOptions options;
    options.diameter_mm = 80;
    EXPECT_NEAR(measure_sphere(as_points(points), nullptr, options).size_mm->all, 80 * (scale - 1),
                1e-6);
  }
}

TEST(ArtefactBallBar, SpacingIsTheErrorOfTheDistance) {
  std::vector<Vec3> points;
  Random random(7);
  const Vec3 along = Vec3(2, 1, -1).normalized();
  add_ball(points, {100 * along, 15}, 4000, [&](int) { return random.normal(0, 0.01); });
  add_ball(points, {-100.25 * along, 15}, 1500, [&](int) { return random.normal(0, 0.01); });
  ArtefactOptions options;
  options.diameter_mm = 30;
  options.length_mm = 200;
  const BallBarFigures bar = measure_ball_bar(as_points(points), nullptr, options);
  ASSERT_TRUE(bar.spacing_mm);
  EXPECT_NEAR(bar.spacing_mm->all, 0.25, 0.003);
  EXPECT_NEAR(bar.spacing_mm->trimmed, 0.25, 0.003);
  ASSERT_EQ(bar.balls.size(), 2U);
  EXPECT_EQ(bar.balls[0].points.points.size() + bar.balls[1].points.points.size(), 5500U);
  for (const BallFigures& ball : bar.balls) EXPECT_LT(ball.form_mm.all, 0.1);
  EXPECT_EQ(bar.between, 0U);
}

TEST(ArtefactBallBar, HoldsTheCalibratedRadius) {
  // Balls half a millimetre larger than calibrated, seen from one side only: a free radius would
  // not move the centres, a held one moves both the same way, and the distance stays.
  std::vector<Vec3> points, seen;
  add_ball(points, {{-80, 0, 0}, 15.25}, 8000, [](int) { return 0.0; });
  add_ball(points, {{80, 0, 0}, 15.25}, 8000, [](int) { return 0.0; });
  for (const Vec3& point : points)
    if (point.z() > 0) seen.push_back(point);
  ArtefactOptions options;
  options.diameter_mm = 30;
  options.length_mm = 160;
  const BallBarFigures bar = measure_ball_bar(as_points(seen), nullptr, options);
  EXPECT_NEAR(bar.spacing_mm->all, 0, 1e-3);
  EXPECT_NEAR(bar.balls[0].size_mm->all, 0.5, 1e-6);
}

TEST(ArtefactBallBar, TheBarIsLeftOutWhereItIsStatedAndElsewhereNoticed) {
  std::vector<Vec3> points;
  add_ball(points, {{-80, 0, 0}, 15}, 6000, [](int) { return 0.0; });
  add_ball(points, {{80, 0, 0}, 15}, 6000, [](int) { return 0.0; });
  std::vector<Vec3> few = points;
  for (int i = 0; i < 2000; ++i) {
    points.emplace_back(-65 + 0.065 * i, 3 * std::cos(0.1 * i), 3 * std::sin(0.1 * i));
    if (i % 100 == 0) few.push_back(points.back());
  }
  ArtefactOptions options;
  options.diameter_mm = 30;
  options.length_mm = 160;
  // The sphere of all points of a ball and half of the bar is none of this size.
  const auto with = [&] { return measure_ball_bar(as_points(points), nullptr, options); };
  EXPECT_THAT(complaint_of(with), AllOf(HasSubstr("ball 1 is "), HasSubstr("--diameter says 30"),
                                        HasSubstr("--bar-diameter leaves a bar out")));
  options.bar_diameter_mm = 0.5;
  EXPECT_THAT(complaint_of(with), HasSubstr("thicker than --bar-diameter = 0.5 mm"));
  options.bar_diameter_mm = 0;
  const BallBarFigures noticed = measure_ball_bar(as_points(few), nullptr, options);
  EXPECT_GT(noticed.between, 10U);
  EXPECT_THAT(artefact_warnings(noticed, options),
              Contains(HasSubstr("if that is the bar, give --bar-diameter")));
  options.bar_diameter_mm = 6;
  const BallBarFigures without = measure_ball_bar(as_points(points), nullptr, options);
  EXPECT_NEAR(without.spacing_mm->all, 0, 1e-6);
  EXPECT_GT(without.balls[0].left_out, 900U);
  EXPECT_EQ(without.between, 0U);
}

TEST(ArtefactBallBar, ALengthThatIsNotThisBarsIsTold) {
  std::vector<Vec3> points;
  add_ball(points, {{-80, 0, 0}, 15}, 3000, [](int) { return 0.0; });
  add_ball(points, {{80, 0, 0}, 15}, 3000, [](int) { return 0.0; });
  ArtefactOptions options;
  options.diameter_mm = 30;
  const auto warnings_of = [&](double length) {
    options.length_mm = length;
    return artefact_warnings(measure_ball_bar(as_points(points), nullptr, options), options);
  };
  for (const double right : {150.0, 160.0, 170.0})  // scales may be off by some per cent
    EXPECT_THAT(warnings_of(right), ::testing::IsEmpty()) << right;
  EXPECT_THAT(
      warnings_of(0.16),
      ::testing::ElementsAre(HasSubstr("1000 times --length = 0.16 mm: it is probably in metres")));
  EXPECT_THAT(warnings_of(160 / 25.4), ::testing::ElementsAre(HasSubstr("probably in inches")));
  EXPECT_THAT(warnings_of(120), ::testing::ElementsAre(HasSubstr("is that the length of this")));
  ArtefactTest test{options, {}, {measure_ball_bar(as_points(points), nullptr, options)}, {}};
  EXPECT_EQ(artefact_json(test)["positions"][0]["warnings"].size(), 1U);
  EXPECT_THAT(artefact_html(test, ""), HasSubstr("is that the length of this bar"));
}

TEST(ArtefactBallBar, SizesThatAreNotAsStatedAreNotSaidToBe) {
  std::vector<Vec3> points;
  add_ball(points, {{-80, 0, 0}, 15}, 3000, [](int) { return 0.0; });
  add_ball(points, {{80, 0, 0}, 15}, 3000, [](int) { return 0.0; });
  ArtefactOptions options;
  options.diameter_mm = 30;
  options.length_mm = 120;
  BallBarFigures bar = measure_ball_bar(as_points(points), nullptr, options);
  bar.balls[1].trimmed.radius = 11.8;
  EXPECT_THAT(artefact_warnings(bar, options),
              ::testing::ElementsAre(HasSubstr("ball 2 is 23.6 mm across, 21.3 % less"),
                                     HasSubstr("30 and 23.6 mm across, and --diameter says 30")));
}

std::vector<Vec3> scaled(std::vector<Vec3> points, double factor) {
  for (Vec3& point : points) point *= factor;
  return points;
}

TEST(ArtefactUnits, OfPointsAreToldByTheStatedSize) {
  std::vector<Vec3> ball, bar;
  add_ball(ball, {{3, 4, 700}, 25}, 3000, [](int i) { return i % 2 == 0 ? 0.01 : -0.01; });
  add_ball(bar, {{-80, 0, 0}, 15}, 3000, [](int) { return 0.0; });
  add_ball(bar, {{80, 0, 0}, 15}, 3000, [](int) { return 0.0; });
  const std::vector<Vec3> plate = plate_points(10, RigidTransform(), 21);
  Rig unknown;
  unknown.unit_known = false;
  for (const auto& [factor, unit] :
       {std::pair{10.0, "centimetres"}, std::pair{25.4, "inches"}, std::pair{1000.0, "metres"}}) {
    const std::string words = std::string("the points are probably in ") + unit;
    ArtefactOptions options;
    const auto sphere = [&](double scale, const Rig* rig = nullptr) {
      return complaint_of(
          [&] { return measure_sphere(as_points(scaled(ball, scale)), rig, options); });
    };
    options.diameter_mm = 50;
    EXPECT_THAT(sphere(1 / factor), HasSubstr(words));
    EXPECT_THAT(sphere(1 / factor, &unknown), Not(HasSubstr("probably"))) << unit;
    EXPECT_THAT(sphere(1 / 3.0), AllOf(HasSubstr("no sphere fits"), Not(HasSubstr("probably"))));
    options.diameter_mm = 50 / factor;
    EXPECT_THAT(sphere(1), HasSubstr(std::string("--diameter is probably in ") + unit));
    options.diameter_mm = 30;
    EXPECT_THAT(complaint_of([&, factor = factor] {
                  return measure_ball_bar(as_points(scaled(bar, 1 / factor)), nullptr, options);
                }),
                HasSubstr(words));
    options.plate_length_mm = 120;
    options.plate_width_mm = 200;
    for (const double thickness : {0.0, 10.0}) {
      if (thickness > 0) options.plate_thickness_mm = thickness;
      EXPECT_THAT(complaint_of([&, factor = factor] {
                    return measure_plate(as_points(scaled(plate, 1 / factor)), nullptr, options);
                  }),
                  HasSubstr(words))
          << thickness;
    }
  }
}

TEST(ArtefactUnits, OfPointsAreDoubtedWhereNoArtefactIsSoLarge) {
  std::vector<Vec3> ball;
  add_ball(ball, {{3, 4, 700}, 25}, kMany, [](int) { return 0.0; });
  const std::vector<Vec3> plate = plate_points(0, RigidTransform(), 22);
  const auto of_ball = [&](double factor, ArtefactOptions options = {}) {
    return artefact_warnings(measure_sphere(as_points(scaled(ball, factor)), nullptr, options),
                             options);
  };
  const auto of_plate = [&](double factor) {
    return artefact_warnings(measure_plate(as_points(scaled(plate, factor)), nullptr, {}), {});
  };
  using ::testing::ElementsAre;
  EXPECT_THAT(of_ball(1), ::testing::IsEmpty());
  EXPECT_THAT(of_plate(1), ::testing::IsEmpty());
  EXPECT_THAT(of_ball(0.001), ElementsAre(HasSubstr("0.05 mm large: the points are probably in "
                                                    "metres; multiply them by 1000, for")));
  EXPECT_THAT(of_ball(1 / 25.4), ElementsAre(HasSubstr("in metres or inches;")));
  EXPECT_THAT(of_ball(1000), ElementsAre(HasSubstr("probably in micrometres")));
  EXPECT_THAT(of_plate(0.001), ElementsAre(HasSubstr("the plate is 0.2 mm large")));
  ArtefactOptions both;  // in metres, and so no error of size
  both.diameter_mm = 0.05;
  EXPECT_THAT(of_ball(0.001, both), ElementsAre(HasSubstr("probably in metres;")));
}

TEST(ArtefactWarnings, WhatIsNotOfTheShapeAskedForIsTold) {
  ArtefactPoints cube;
  ArtefactPoints faces;
  Random random(3);
  for (int i = 0; i < 3000; ++i) {
    Vec3 x(random.uniform(-50, 50), random.uniform(-50, 50), random.uniform(-50, 50));
    x[i % 3] = i % 2 == 0 ? 50 : -50;
    cube.points.push_back(x);
    faces.points.emplace_back(x.x(), x.y(), i % 2 == 0 ? 6 : -6);
  }
  EXPECT_THAT(artefact_warnings(measure_sphere(cube, nullptr, {}), {}),
              ::testing::ElementsAre(HasSubstr("mm from the sphere that fits them best")));
  EXPECT_THAT(artefact_warnings(measure_plate(faces, nullptr, {}), {}),
              Contains(HasSubstr("mm from the plane that fits them best")));
}

TEST(ArtefactWarnings, AnUnknownUnitIsToldOfEveryArtefact) {
  Rig rig;
  rig.unit_known = false;
  std::vector<Vec3> balls;
  add_ball(balls, {{-80, 0, 0}, 15}, 3000, [](int) { return 0.0; });
  ArtefactOptions options;
  options.diameter_mm = 30;
  const auto unknown = ::testing::ElementsAre(HasSubstr("the rig's unit is unknown"));
  const BallFigures ball = measure_sphere(as_points(balls), &rig, options);
  EXPECT_THAT(artefact_warnings(ball, options), unknown);
  EXPECT_THAT(artefact_warnings(measure_sphere(as_points(balls), nullptr, options), options),
              ::testing::IsEmpty());
  EXPECT_EQ(artefact_json({options, {ball}, {}, {}})["positions"][0]["warnings"].size(), 1U);
  add_ball(balls, {{80, 0, 0}, 15}, 3000, [](int) { return 0.0; });
  options.length_mm = 120;  // not "though their size is as stated"
  EXPECT_THAT(artefact_warnings(measure_ball_bar(as_points(balls), &rig, options), options),
              unknown);
  options.diameter_mm = 300;
  try {
    (void)measure_ball_bar(as_points(balls), &rig, options);
    FAIL() << "no StageError";
  } catch (const StageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("190 of the rig's units"));
  }
}

std::vector<Vec3> plate_points(double thickness, const RigidTransform& world_from_plate,
                               std::uint64_t seed) {
  Random random(seed);
  std::vector<Vec3> points;
  for (int i = 0; i < 6000; ++i)
    points.push_back(
        {random.uniform(-100, 100), random.uniform(-60, 60), random.uniform(-0.02, 0.02)});
  for (int i = 0; i < 4000 && thickness > 0; ++i)
    points.push_back({random.uniform(-100, 100), random.uniform(-60, 60), -thickness});
  for (int i = 0; i < 1000 && thickness > 0; ++i)
    points.push_back({100, random.uniform(-60, 60), -random.uniform(0, thickness)});
  for (Vec3& point : points) point = world_from_plate * point;
  return points;
}

TEST(ArtefactPlate, FlatnessIsTheRangeOfKnownDeviations) {
  const RigidTransform pose = look_at({300, 200, 500}, Vec3::Zero()).inverse();
  std::vector<Vec3> points = plate_points(0, pose, 9);
  const PlateFigures plate = measure_plate(as_points(points), nullptr, {});
  EXPECT_NEAR(plate.flatness_mm.all, 0.04, 0.001);
  EXPECT_LT(plate.flatness_mm.trimmed, plate.flatness_mm.all);
  EXPECT_NEAR(plate.rectangle.length, 200, 0.5);
  EXPECT_NEAR(plate.rectangle.width, 120, 0.5);
  EXPECT_GT(plate.coverage, 0.9);
  points.push_back(pose * Vec3(0, 0, 7));
  EXPECT_NEAR(measure_plate(as_points(points), nullptr, {}).flatness_mm.all, 7, 0.05);
}

TEST(ArtefactPlate, OneOfTwoFacesIsMeasuredAndErrorsBeforeItStay) {
  const RigidTransform pose = look_at({-300, 100, 400}, Vec3(5, 5, 5)).inverse();
  std::vector<Vec3> points = plate_points(10, pose, 10);
  EXPECT_GT(measure_plate(as_points(points), nullptr, {}).flatness_mm.all, 5);
  ArtefactOptions options;
  options.plate_thickness_mm = 10;
  options.border_mm = 2;
  const PlateFigures plate = measure_plate(as_points(points), nullptr, options);
  EXPECT_NEAR(plate.flatness_mm.all, 0.04, 0.001);
  EXPECT_EQ(plate.points.points.size() + plate.left_out, points.size());
  points.push_back(pose * Vec3(0, 0, 45));
  EXPECT_NEAR(measure_plate(as_points(points), nullptr, options).flatness_mm.all, 45, 0.1);
}

TEST(ArtefactPlate, StrayPointsBeyondTheRimDoNotMoveAKnownPlate) {
  const RigidTransform pose = look_at({-300, 100, 400}, Vec3(5, 5, 5)).inverse();
  std::vector<Vec3> points = plate_points(10, pose, 11);
  ArtefactOptions options;
  options.plate_thickness_mm = 10;
  options.border_mm = 2;
  // Of the side, but before the border of the rectangle that holds the strays too.
  for (int i = 0; i < 20; ++i) points.push_back(pose * Vec3(99.5, 5.0 * i - 50, -2));
  for (const double x : {104.0, 108.0, 115.0}) points.push_back(pose * Vec3(x, 0.3 * x, 0.5));
  EXPECT_GT(measure_plate(as_points(points), nullptr, options).flatness_mm.all, 1.5);
  options.plate_length_mm = 200;
  options.plate_width_mm = 120;
  EXPECT_NEAR(measure_plate(as_points(points), nullptr, options).flatness_mm.all, 0.04, 0.001);
}

TEST(ArtefactPlate, AKnownRectangleIsPlacedWherePointsStandOutLeast) {
  Random random(12);
  const Plane plane = fit_plane(std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}).value();
  std::vector<Vec3> points;
  const Vec3 along(std::cos(0.3), std::sin(0.3), 0), across(-along.y(), along.x(), 0);
  for (int i = 0; i < 20000; ++i)
    points.push_back(Vec3(3, 2, 0) + random.uniform(-40.2, 40.2) * along +
                     random.uniform(-25.1, 25.1) * across);
  points.push_back({90, 0, 0});
  const PlateRectangle placed = placed_rectangle(points, plane, 50, 80, 2);
  EXPECT_LT((placed.center - Vec3(3, 2, 0)).norm(), 0.02);
  EXPECT_GT(std::abs(placed.along.dot(along)), std::cos(0.001));
  EXPECT_EQ(placed.length, 80);
}

TEST(ArtefactPlate, SidesInAnotherUnitAreRefused) {
  const RigidTransform pose = look_at({-300, 100, 400}, Vec3(5, 5, 5)).inverse();
  const ArtefactPoints points = as_points(plate_points(10, pose, 13));
  for (const auto& [factor, unit] :
       {std::pair{10.0, "centimetres"}, std::pair{25.4, "inches"}, std::pair{1000.0, "metres"}}) {
    for (const double thickness : {0.0, 10.0, 10 / factor}) {
      ArtefactOptions options;
      options.plate_length_mm = 200 / factor;
      options.plate_width_mm = 120 / factor;
      if (thickness > 0) options.plate_thickness_mm = thickness;
      try {
        (void)measure_plate(points, nullptr, options);
        ADD_FAILURE() << unit << " " << thickness;
      } catch (const InputError& error) {
        EXPECT_EQ(error.field, "--length x --width");
        EXPECT_THAT(error.rule, HasSubstr(std::string("probably in ") + unit)) << thickness;
      }
    }
  }
  ArtefactOptions options;
  options.plate_thickness_mm = 10;
  options.plate_length_mm = 200;
  options.plate_width_mm = 120 / 2.54;  // one side
  EXPECT_THROW((void)measure_plate(points, nullptr, options), InputError);
}

TEST(ArtefactPlate, SidesOfASmallerPlateAreTold) {
  const ArtefactPoints points = as_points(plate_points(10, RigidTransform(), 14));
  ArtefactOptions options;
  options.plate_thickness_mm = 10;
  const auto warnings_of = [&](double length) {
    options.plate_length_mm = length;
    options.plate_width_mm = 120;
    return artefact_warnings(measure_plate(points, nullptr, options), options);
  };
  EXPECT_THAT(warnings_of(200), ::testing::IsEmpty());
  EXPECT_THAT(warnings_of(400), ::testing::IsEmpty());  // half of it was measured
  EXPECT_THAT(warnings_of(130), ::testing::ElementsAre(HasSubstr("are they this plate's?")));
  Rig rig;
  rig.unit_known = false;
  EXPECT_THAT(artefact_warnings(measure_plate(points, &rig, options), options),
              ::testing::ElementsAre(HasSubstr("the rig's unit is unknown")));
}

TEST(ArtefactPlate, OtherThingsInItsPlaneDoNotMakeItLarger) {
  // A plate that stands on a table before a wall, beside a cylinder.
  std::vector<Vec3> points = plate_points(10, RigidTransform(), 15);
  Random random(15);
  for (int i = 0; i < 4000; ++i) {
    points.push_back({random.uniform(-300, 300), -60, random.uniform(-100, 100)});
    points.push_back({random.uniform(-300, 300), random.uniform(-60, 200), -200});
    const double angle = random.uniform(0, 2 * std::numbers::pi);
    points.push_back({180 + 40 * std::cos(angle), random.uniform(-60, 200), 40 * std::sin(angle)});
    points.push_back({random.uniform(-300, -150), random.uniform(-50, 50), 0});  // in its plane
  }
  ArtefactOptions options;
  options.plate_thickness_mm = 10;
  options.border_mm = 3;
  options.plate_length_mm = 200;
  options.plate_width_mm = 120;
  const PlateFigures plate = measure_plate(as_points(points), nullptr, options);
  EXPECT_NEAR(plate.rectangle.center.x(), 0, 1);
  EXPECT_NEAR(plate.surface.area_mm2 / (200 * 120), 1, 0.15);
  EXPECT_THAT(artefact_warnings(plate, options), ::testing::IsEmpty());
}

TEST(ArtefactPlate, CoverageIsTheShareOfTheStatedPlate) {
  std::vector<Vec3> points;
  for (int x = 0; x <= 200; ++x)
    for (int y = 0; y <= 100; ++y) points.emplace_back(0.5 * x, y, 0);
  ArtefactOptions options;
  options.plate_length_mm = 200;  // half of it was measured
  options.plate_width_mm = 100;
  // The rectangle is centred on what was measured: 1 % of the diagonal is more on both sides.
  const PlateFigures plate = measure_plate(as_points(points), nullptr, options);
  EXPECT_NEAR(plate.coverage, (100 + 2 * 2.236) / 200, 0.01);
}

TEST(ArtefactFiles, CurvesOfPicturesAreNoPoints) {
  const TemporaryFolder folder("artefact_curves");
  write_curves(folder.path() / "curves.ply", {{CurveSample{}, CurveSample{}}, {}});
  EXPECT_THAT(complaint_of([&] { return read_artefact_points(folder.path() / "curves.ply"); }),
              HasSubstr("these are curves in pictures"));
}

TEST(ArtefactFiles, AnyPlyIsReadAndPointsWithoutPositionAreCounted) {
  const TemporaryFolder folder("artefact_files");
  write_text(folder.path() / "rival.ply",
             "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\n"
             "property double z\nproperty uchar red\nend_header\n1 2 3 255\nnan nan nan 0\n"
             "4 5 6 1\n");
  const ArtefactPoints rival = read_artefact_points(folder.path() / "rival.ply");
  ASSERT_EQ(rival.points.size(), 2U);
  EXPECT_EQ(rival.points[1], Vec3(4, 5, 6));
  EXPECT_EQ(rival.not_finite, 1U);
  EXPECT_TRUE(rival.sigma.empty());
  EXPECT_FALSE(rival.is_mesh);
  write_mesh(folder.path() / "mesh.ply", make_sphere(10));
  EXPECT_TRUE(read_artefact_points(folder.path() / "mesh.ply").is_mesh);
  EXPECT_THROW((void)read_artefact_points(folder.path() / "none.ply"), InputError);
}

TEST(ArtefactFiles, VerticesThatNoFaceHasAreNoPartOfAMesh) {
  const TemporaryFolder folder("artefact_loose");
  TriangleMesh ball = make_sphere(10);
  const std::size_t count = ball.vertices.size();
  ball.vertices.push_back(Vec3::Zero());  // as a scanner's program leaves its origin behind
  write_mesh(folder.path() / "mesh.ply", ball);
  const ArtefactPoints mesh = read_artefact_points(folder.path() / "mesh.ply");
  EXPECT_EQ(mesh.points.size(), count);
  EXPECT_EQ(mesh.without_face, 1U);
  ball.faces.clear();
  write_mesh(folder.path() / "points.ply", ball);
  EXPECT_EQ(read_artefact_points(folder.path() / "points.ply").points.size(), count + 1);
}

TEST(ArtefactFiles, AnOutputFolderIsOnePositionPerFrame) {
  const TemporaryFolder folder("artefact_folder");
  for (const char* frame : {"000001", "000000"})
    write_points(folder.path() / frame / "points.ply", {MeasuredPoint{}});
  const auto files = artefact_files(folder.path(), FrameSurface::kPoints).files;
  ASSERT_EQ(files.size(), 2U);
  EXPECT_THAT(files[0].string(), HasSubstr("000000"));
  EXPECT_EQ(artefact_files(files[0].parent_path(), FrameSurface::kPoints).files.size(), 1U);
  EXPECT_THROW((void)artefact_files(folder.path(), FrameSurface::kMesh), InputError);
  EXPECT_THROW((void)artefact_files(folder.path() / "nothing", FrameSurface::kPoints), InputError);
}

TEST(ArtefactFiles, AFrameWithoutAResultIsAPositionThatLacks) {
  const TemporaryFolder folder("artefact_lacking");
  const auto& out = folder.path();
  write_points(out / "000000" / "points.ply", {MeasuredPoint{}});
  write_json(out / "000001" / "failure.json", {{"reason", "cam1: black"}});
  write_json(out / "000002" / "input.json", {{"settings", "0"}});
  write_text(out / "000003" / "failure.json", "{");
  write_text(out / "notes" / "text.md", "");
  const ArtefactFiles found = artefact_files(out, FrameSurface::kPoints);
  EXPECT_EQ(found.files.size(), 1U);
  ASSERT_EQ(found.lacking.size(), 3U);
  EXPECT_EQ(found.lacking[0].folder, out / "000001");
  EXPECT_EQ(found.lacking[0].why, "cam1: black");
  EXPECT_EQ(found.lacking[1].why, "it holds no points.ply");
  EXPECT_THAT(found.lacking[2].why, HasSubstr("does not say why"));
  EXPECT_EQ(artefact_files(out / "000001", FrameSurface::kPoints).lacking.size(), 1U);
  EXPECT_THROW((void)artefact_files(out / "000002", FrameSurface::kPoints), InputError);
}

TEST(ArtefactReport, NamesPositionsWithoutAResult) {
  ArtefactTest test;
  std::vector<Vec3> points;
  add_ball(points, {{0, 0, 0}, 20}, 2000, [](int i) { return i % 2 == 0 ? 0.1 : -0.1; });
  test.spheres.push_back(measure_sphere(as_points(points), nullptr, test.options));
  EXPECT_FALSE(artefact_json(test).contains("without_result"));
  test.lacking.push_back({"out/000002", "<black>"});
  const nlohmann::ordered_json json = artefact_json(test);
  EXPECT_EQ(json["positions"].size(), 1U);
  EXPECT_EQ(json["without_result"][0]["folder"], "out/000002");
  EXPECT_EQ(json["without_result"][0]["why"], "<black>");
  const std::string html = artefact_html(test, "program");
  for (const char* text :
       {"1 position, and 1 without a result.", "No result: out/000002", "&lt;black&gt;"})
    EXPECT_THAT(html, HasSubstr(text));
}

TEST(ArtefactReport, TheWorstPositionCounts) {
  ArtefactTest test;
  test.options.diameter_mm = 40;
  for (const double error : {0.02, 0.05, 0.01}) {
    std::vector<Vec3> points;
    add_ball(points, {{0, 0, 0}, 20 - error}, 2000,
             [&](int i) { return i % 2 == 0 ? error : -error; });
    test.spheres.push_back(measure_sphere(as_points(points), nullptr, test.options));
  }
  const nlohmann::ordered_json json = artefact_json(test);
  EXPECT_EQ(json["artefact"], "sphere");
  EXPECT_EQ(json["positions"].size(), 3U);
  EXPECT_NEAR(json["worst"]["PF_mm"].get<double>(), 0.1, 1e-3);
  EXPECT_NEAR(json["worst"]["PS_mm"].get<double>(), -0.1, 1e-3);
  EXPECT_EQ(json["worst"]["points"], 2000);
  const std::string html = artefact_html(test, "a <program>");
  for (const char* text : {"After the manner of", "a &lt;program&gt;", "PF 0.100"})
    EXPECT_NE(html.find(text), std::string::npos) << text;
  EXPECT_EQ(html.find("nan"), std::string::npos);
}

/// field of the InputError that measuring ends with.
template <typename Measure>
std::string refused_option(const Measure& measure) {
  try {
    (void)measure();
  } catch (const InputError& error) {
    return error.field;
  }
  return "none";
}

TEST(ArtefactFigures, NameTheOptionThatLeavesNoPoints) {
  std::vector<Vec3> ball;
  add_ball(ball, {{0, 0, 0}, 20}, 2000, [](int) { return 0.0; });
  const ArtefactPoints plate = as_points(plate_points(10, RigidTransform(), 16));
  ArtefactOptions options;
  options.diameter_mm = 40;
  options.region = Sphere{{500, 0, 0}, 30};
  const auto sphere = [&] { return measure_sphere(as_points(ball), nullptr, options); };
  const auto bar = [&] { return measure_ball_bar(as_points(ball), nullptr, options); };
  const auto face = [&] { return measure_plate(plate, nullptr, options); };
  EXPECT_EQ(refused_option(sphere), "--region");
  EXPECT_EQ(refused_option(bar), "--region");
  EXPECT_EQ(refused_option(face), "--region");
  options.region.reset();
  options.stem = LeftOutCone{Vec3::UnitZ(), 0.9999 * std::numbers::pi};
  EXPECT_EQ(refused_option(sphere), "--stem");
  options.plate_thickness_mm = 10;
  options.border_mm = 61;
  EXPECT_EQ(refused_option(face), "--border");
  options.plate_length_mm = 200;
  options.plate_width_mm = 120;
  EXPECT_EQ(refused_option(face), "--border");
}

TEST(ArtefactFigures, AreNotOfWhatIsNoBallOfThisSize) {
  const ArtefactPoints plate = as_points(plate_points(10, RigidTransform(), 17));
  std::vector<Vec3> two;
  add_ball(two, {{-60, 0, 0}, 30}, 2000, [](int) { return 0.0; });
  add_ball(two, {{60, 0, 0}, 30}, 2000, [](int) { return 0.0; });
  ArtefactOptions options;
  for (const double diameter : {50.0, 60.0, 80.0, 100.0}) {
    options.diameter_mm = diameter;
    EXPECT_THROW((void)measure_sphere(plate, nullptr, options), StageError) << diameter;
    EXPECT_THROW((void)measure_sphere(as_points(two), nullptr, options), StageError) << diameter;
    EXPECT_THROW((void)measure_ball_bar(plate, nullptr, options), StageError) << diameter;
  }
}

TEST(ArtefactFigures, SayWhenNothingFits) {
  const ArtefactPoints few = as_points({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
  EXPECT_THROW((void)measure_sphere(few, nullptr, {}), StageError);
  ArtefactOptions bar;
  bar.diameter_mm = 10;
  EXPECT_THROW((void)measure_ball_bar(few, nullptr, bar), StageError);
  EXPECT_THROW((void)measure_plate(as_points({{0, 0, 0}, {1, 1, 1}}), nullptr, {}), StageError);
}

}  // namespace
}  // namespace pencilscan
