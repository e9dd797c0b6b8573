#include "pencilscan/guided/guided_matching.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include "pencilscan/core/random.h"
#include "pencilscan/detection/curve_rendering.h"
#include "pencilscan/labeling/two_projector_scene.h"
#include "pencilscan/points/pixel_lattice.h"
#include "pencilscan/points/settle.h"
#include "pencilscan/points/triangulate.h"

namespace pencilscan {
namespace {

/// Camera z of the scene's surface in a pixel, by sphere tracing in small steps.
double depth_of_surface(const Camera& camera, const Vec2& pixel) {
  const Ray ray = camera.ray(pixel);
  const auto outside = [&](double t) {
    const Vec3 x = ray.origin + t * ray.direction;
    return x.x() - TwoProjectorScene::surface(x.y(), x.z()).x();
  };
  double low = 900;
  while (outside(low + 1) > 0) low += 1;
  double high = low + 1;
  for (int k = 0; k < 40; ++k) {
    const double middle = 0.5 * (low + high);
    (outside(middle) > 0 ? low : high) = middle;
  }
  return (camera.device_from_world * (ray.origin + low * ray.direction)).z();
}

/// One camera's curves with true labels.
class LabeledScene : public testing::Test, protected TwoProjectorScene {
 protected:
  LabeledScene() : graph_(graph(0, 50, 0.05, 3)) {
    labeling_.runs.resize(2);
    labeling_.tentative.resize(2);
    labeling_.undecided.resize(2);
    for (std::size_t k = 0; k < graph_.curves.size(); ++k) {
      Curve& curve = graph_.curves[k];
      const int line = true_lines[0][k];
      labeling_.runs[0].push_back({static_cast<int>(k), 0, static_cast<int>(curve.points.size()),
                                   CurveLabel{{curve.family, 0}, line, 1.0 * line, 1}});
      for (std::size_t i = 0; i < curve.points.size(); ++i) {
        const auto& next = curve.points[std::min(i + 4, curve.points.size() - 1)].position;
        const auto& before = curve.points[i < 4 ? 0 : i - 4].position;
        const Eigen::Vector2f tangent = (next - before).normalized();
        curve.points[i].normal = {tangent.y(), -tangent.x()};
        curve.points[i].amplitude = 0.3F;
        curve.points[i].width_px = 1.2F;
      }
    }
  }
  const Camera& camera() const { return rig.cameras[0]; }
  std::vector<MeasuredPoint> points() const { return triangulate(rig, {&graph_, 1}, labeling_); }

  /// Index of a curve of the middle of a family.
  std::size_t middle_curve(int family) const {
    std::vector<std::size_t> curves;
    for (std::size_t k = 0; k < graph_.curves.size(); ++k) {
      if (graph_.curves[k].family == family && graph_.curves[k].points.size() > 150)
        curves.push_back(k);
    }
    return curves[curves.size() / 2];
  }
  void remove_label(std::size_t curve) {
    std::erase_if(labeling_.runs[0],
                  [&](const LabeledRun& r) { return r.curve == static_cast<int>(curve); });
  }
  /// Label of most points of a curve, -1 where most have none.
  int label_of(std::size_t curve) const {
    int points = 0;
    int line = -1;
    for (const LabeledRun& run : labeling_.runs[0]) {
      if (run.curve != static_cast<int>(curve)) continue;
      points += run.end - run.begin;
      line = run.label.line;
    }
    return 2 * points > static_cast<int>(graph_.curves[curve].points.size()) ? line : -1;
  }

  /// True where a run of new points goes on with a detected curve of its line: the light of curves
  /// reaches 2 px beyond their ends (curve_rendering.h).
  bool continues_a_curve(const LabeledRun& run) const {
    constexpr float kOverhang = 3;  // px, with half a width
    const Curve& found = graph_.curves[static_cast<std::size_t>(run.curve)];
    for (std::size_t k = 0; k < true_lines[0].size(); ++k) {
      const Curve& curve = graph_.curves[k];
      if (curve.family != found.family || true_lines[0][k] != run.label.line) continue;
      const auto is_near = [&](const CurvePoint& p) {
        return std::any_of(curve.points.begin(), curve.points.end(), [&](const CurvePoint& q) {
          return (p.position - q.position).norm() < kOverhang;
        });
      };
      if (std::all_of(found.points.begin() + run.begin, found.points.begin() + run.end, is_near))
        return true;
    }
    return false;
  }

  /// Presence images of all curves as they are, with noise.
  std::vector<cv::Mat> noisy_presence() const {
    std::vector<cv::Mat> presence;
    for (int f = 0; f < 2; ++f) {
      std::vector<Curve> of_family;
      for (const Curve& curve : graph_.curves) {
        if (curve.family == f) of_family.push_back(curve);
      }
      presence.push_back(render_curves(of_family, {camera().width, camera().height}));
      Random random(11);
      for (int y = 0; y < presence.back().rows; ++y) {
        for (int x = 0; x < presence.back().cols; ++x)
          presence.back().at<float>(y, x) += static_cast<float>(random.normal(0, 0.01));
      }
    }
    return presence;
  }

  GridGraph graph_;
  Labeling labeling_;
};

TEST_F(LabeledScene, LocalSurfaceIsTheTrueOneWithinItsSigma) {
  LocalSurface surface(camera());
  surface.add(points());
  int patches = 0;
  int within = 0;
  for (const SurfacePatch& patch : surface.patches()) {
    // Away from the border of what is labelled, where patches extrapolate.
    const Vec2 pixel = patch.pixel.cast<double>();
    if (!patch.exists() || (pixel - Vec2(640, 480)).norm() > 70) continue;
    const double error = 1 - patch.inverse_depth(patch.pixel) * depth_of_surface(camera(), pixel);
    ++patches;
    within += std::abs(error) < 2 * patch.sigma + 3e-5;  // 0.03 mm: curvature beyond quadratic
  }
  EXPECT_GT(patches, 300);
  EXPECT_GT(within, 0.95 * patches);
}

TEST_F(LabeledScene, PredictedLinesAreWhereTheCurvesAre) {
  LocalSurface surface(camera());
  surface.add(points());
  for (int p = 0; p < 2; ++p) {
    std::vector<std::pair<int, Eigen::Vector2f>> predicted;
    for (const PredictedPoint& point :
         predict_lines(rig, camera(), surface, std::array{PatternRef{p, 0}}))
      predicted.emplace_back(point.line, point.position);
    std::size_t found = 0;
    std::size_t all = 0;
    for (std::size_t k = 0; k < graph_.curves.size(); ++k) {
      const Curve& curve = graph_.curves[k];
      if (curve.family != p) continue;
      for (std::size_t i = 5; i + 5 < curve.points.size(); i += 7) {
        ++all;
        bool hit = false;
        for (const auto& [line, position] : predicted) {
          hit = hit ||
                (line == true_lines[0][k] && (position - curve.points[i].position).norm() < 0.8F);
        }
        found += hit ? 1 : 0;
      }
    }
    EXPECT_GT(all, 100U);
    EXPECT_GT(static_cast<double>(found), 0.97 * static_cast<double>(all)) << "projector " << p;
  }
}

TEST_F(LabeledScene, UndecidedCurveOnAPredictedLineGetsItsLabel) {
  const std::size_t curve = middle_curve(0);
  remove_label(curve);
  ASSERT_EQ(label_of(curve), -1);
  const std::vector<std::vector<cv::Mat>> no_images(1);
  match_guided(rig, families, no_images, {&graph_, 1}, labeling_);
  EXPECT_EQ(label_of(curve), true_lines[0][curve]);
}

TEST_F(LabeledScene, UndecidedCurveBetweenLinesStaysUndecided) {
  const std::size_t curve = middle_curve(0);
  remove_label(curve);
  // Half a line aside: no line is there.
  for (CurvePoint& p : graph_.curves[curve].points) p.position += 6.F * p.normal;
  const std::vector<std::vector<cv::Mat>> no_images(1);
  match_guided(rig, families, no_images, {&graph_, 1}, labeling_);
  EXPECT_EQ(label_of(curve), -1);
}

TEST_F(LabeledScene, UndecidedCurveOfTheOtherColorStaysUndecided) {
  const std::size_t curve = middle_curve(0);
  remove_label(curve);
  std::vector<float>& code = graph_.curves[curve].code;
  for (std::size_t i = 0; i < code.size(); i += 2) std::swap(code[i], code[i + 1]);
  const std::vector<std::vector<cv::Mat>> no_images(1);
  Labeling other_color = labeling_;
  GridGraph graph = graph_;
  match_guided(rig, families, no_images, {&graph, 1}, other_color);
  std::swap(labeling_, other_color);
  EXPECT_EQ(label_of(curve), -1);
  // Weak evidence does not outweigh the place.
  std::swap(labeling_, other_color);
  for (float& c : code) c *= 0.1F;
  match_guided(rig, families, no_images, {&graph_, 1}, labeling_);
  EXPECT_EQ(label_of(curve), true_lines[0][curve]);
}

TEST_F(LabeledScene, LinesOfAProjectorWithoutAnyLabelAreNamedByTheirColourOnADenseSurface) {
  std::vector<MeasuredPoint> dense = points();
  std::vector<std::size_t> curves;
  for (std::size_t k = 0; k < graph_.curves.size(); ++k) {
    if (graph_.curves[k].family != 1) continue;
    remove_label(k);
    if (graph_.curves[k].points.size() > 150) curves.push_back(k);
  }
  ASSERT_GT(curves.size(), 5U);
  const auto share_named = [&](std::span<const MeasuredPoint> more, float code) {
    GridGraph graph = graph_;
    for (Curve& curve : graph.curves) {
      for (float& c : curve.code) c *= code;
    }
    Labeling labeling = labeling_;
    match_guided(rig, families, std::vector<std::vector<cv::Mat>>(1), {&graph, 1}, labeling, {},
                 more);
    std::swap(labeling_, labeling);
    const auto named = std::count_if(curves.begin(), curves.end(), [&](std::size_t k) {
      return label_of(k) == true_lines[0][k];
    });
    std::swap(labeling_, labeling);
    return static_cast<double>(named) / static_cast<double>(curves.size());
  };
  EXPECT_EQ(share_named({}, 1), 0) << "labels alone: no line around supports any";
  EXPECT_GT(share_named(dense, 1), 0.8);
  EXPECT_EQ(share_named(dense, 0), 0) << "no colour supports any either";
}

TEST_F(LabeledScene, OnADenseSurfaceALineOfTheOtherColorTakesTheLabelsOfTheLinesBesideItBack) {
  const std::size_t curve = middle_curve(0);
  const int line = true_lines[0][curve];
  remove_label(curve);
  std::vector<float>& code = graph_.curves[curve].code;
  for (std::size_t i = 0; i < code.size(); i += 2) std::swap(code[i], code[i + 1]);
  // The curve is seen along the first half of its line only.
  Curve& seen = graph_.curves[curve];
  seen.points.resize(seen.points.size() / 2);
  seen.code.resize(2 * seen.points.size());
  const Eigen::Vector2f last = seen.points.back().position;
  const Eigen::Vector2f onward = (last - seen.points.front().position).normalized();
  const std::vector<MeasuredPoint> dense = points();
  const auto labelled = [&](const Labeling& labeling, int of_line, bool beside) {
    int count = 0;
    for (const LabeledRun& run : labeling.runs[0]) {
      if (run.label.pattern != PatternRef{0, 0} || run.label.line != of_line) continue;
      for (int i = run.begin; i < run.end; ++i) {
        const Eigen::Vector2f& place = graph_.curves[static_cast<std::size_t>(run.curve)]
                                           .points[static_cast<std::size_t>(i)]
                                           .position;
        const float along = (place - last).dot(onward);
        if (beside ? along < -15 : along > 15) ++count;
      }
    }
    return count;
  };
  Labeling labels_alone = labeling_;
  const std::vector<std::vector<cv::Mat>> no_images(1);
  match_guided(rig, families, no_images, {&graph_, 1}, labels_alone);
  EXPECT_TRUE(labels_alone.denied[0].empty());
  EXPECT_GT(labelled(labels_alone, line + 1, true), 30);
  Labeling labeling = labeling_;
  match_guided(rig, families, no_images, {&graph_, 1}, labeling, {}, dense);
  ASSERT_FALSE(labeling.denied[0].empty());
  for (const DeniedRun& denied : labeling.denied[0]) {
    EXPECT_EQ(denied.predicted.curve, static_cast<int>(curve));
    EXPECT_EQ(denied.predicted.label.line, line);
  }
  for (const int next : {line - 2, line - 1, line + 1, line + 2}) {
    // At its rim the surface predicts nothing.
    EXPECT_LT(labelled(labeling, next, true), 0.6 * labelled(labeling_, next, true));
    EXPECT_EQ(labelled(labeling, next, false), labelled(labeling_, next, false));
  }
  for (const int third : {line - 3, line + 3})
    EXPECT_EQ(labelled(labeling, third, true), labelled(labeling_, third, true));
  const auto undecided = undecided_points(labeling.undecided[0], labeling.runs[0]);
  EXPECT_GT(undecided[static_cast<std::size_t>(UndecidedReason::kContradicted)], 60U);
}

TEST_F(LabeledScene, OnADenseSurfacePiecesOfACurveOfTheOtherColorAreDeniedTogether) {
  constexpr std::size_t kPiece = 6;  // points: too few for their colour to deny a line alone
  const std::size_t curve = middle_curve(0);
  const std::vector<MeasuredPoint> dense = points();
  remove_label(curve);
  Curve& seen = graph_.curves[curve];
  for (std::size_t i = 0; i < seen.code.size(); i += 2) std::swap(seen.code[i], seen.code[i + 1]);
  for (std::size_t i = 0; i < seen.points.size(); ++i)
    if (i % (kPiece + 3) >= kPiece) seen.points[i].width_px *= 2;  // of no line that is predicted
  match_guided(rig, families, std::vector<std::vector<cv::Mat>>(1), {&graph_, 1}, labeling_, {},
               dense);
  std::ptrdiff_t labelled = 0;
  for (const LabeledRun& run : labeling_.runs[0])
    if (run.curve == static_cast<int>(curve)) labelled += run.end - run.begin;
  EXPECT_EQ(labelled, 0);
  EXPECT_GT(labeling_.denied[0].size(), 5U);
}

TEST_F(LabeledScene, CurveMuchWiderThanThePredictedLineGetsNoLabel) {
  const std::size_t curve = middle_curve(0);
  remove_label(curve);
  for (CurvePoint& p : graph_.curves[curve].points) p.width_px *= 2;
  match_guided(rig, families, std::vector<std::vector<cv::Mat>>(1), {&graph_, 1}, labeling_);
  EXPECT_EQ(label_of(curve), -1);
}

TEST_F(LabeledScene, TentativeLabelIsConfirmedWhereTheSurfaceAgreesOnly) {
  const std::size_t good = middle_curve(0);
  const std::size_t bad = middle_curve(1);
  for (const std::size_t k : {good, bad}) {
    remove_label(k);
    const int line = true_lines[0][k] + (k == bad ? 3 : 0);
    labeling_.tentative[0].push_back({static_cast<int>(k), 0,
                                      static_cast<int>(graph_.curves[k].points.size()),
                                      CurveLabel{{k == bad ? 1 : 0, 0}, line, 1.0 * line, 0.8F}});
  }
  GuidedMatchingOptions options;
  options.min_adopted = 1000000;  // nothing but tentative labels
  options.min_whole = 1000000;
  match_guided(rig, families, std::vector<std::vector<cv::Mat>>(1), {&graph_, 1}, labeling_,
               options);
  EXPECT_EQ(label_of(good), true_lines[0][good]);
  EXPECT_EQ(label_of(bad), -1);
}

TEST_F(LabeledScene, ACurveThatTwoProjectorsLightHasTheNamesOfBoth) {
  // A third projector stands where the first does, so its lines lie on the first one's.
  rig.projectors.push_back(rig.projectors[0]);
  rig.projectors[2].name = "proj2";
  families = color_families(rig);
  const std::size_t middle = middle_curve(0);
  const std::size_t single = middle + 3;
  const std::size_t count = graph_.curves.size();
  const std::vector<MeasuredPoint> dense = points();
  for (std::size_t k = 0; k < count; ++k) {
    if (graph_.curves[k].family != 0 || k == middle || k == single) continue;
    const int line = true_lines[0][k];
    const int length = static_cast<int>(graph_.curves[k].points.size());
    labeling_.runs[0].push_back({static_cast<int>(graph_.curves.size()), 0, length,
                                 CurveLabel{{2, 0}, line, 1.0 * line, 1}});
    graph_.curves.push_back(graph_.curves[k]);
    graph_.component_of_curve.push_back(-1);
    if (!graph_.identities.empty()) graph_.identities.emplace_back();
  }
  for (CurvePoint& p : graph_.curves[middle].points) p.amplitude *= 2;
  const auto named = [&](std::size_t curve) {
    int points = 0;
    for (const LabeledRun& run : labeling_.runs[0]) {
      if (run.label.pattern == PatternRef{2, 0} && run.label.line == true_lines[0][curve])
        points += run.end - run.begin;
    }
    return static_cast<double>(points) / static_cast<double>(graph_.curves[curve].points.size());
  };
  match_guided(rig, families, std::vector<std::vector<cv::Mat>>(1), {&graph_, 1}, labeling_, {},
               dense);
  EXPECT_GT(named(middle), 0.8);
  EXPECT_EQ(named(single), 0) << "no brighter than the lines of one projector beside it";
  EXPECT_EQ(label_of(middle), true_lines[0][middle]);
}

TEST_F(LabeledScene, MissedLineIsFoundInTheImageWhereItIsAndNotWhereItIsDark) {
  std::vector<cv::Mat> presence = noisy_presence();
  // One curve is in the image but was not detected, another was never projected.
  const std::size_t missed = middle_curve(0);
  const std::size_t dark = missed + 2;
  presence[0] -= render_curves({graph_.curves[dark]}, presence[0].size());
  const std::vector<CurvePoint> truth = graph_.curves[missed].points;
  const int line = true_lines[0][missed];
  for (const std::size_t k : {missed, dark}) {
    remove_label(k);
    graph_.curves[k].points.clear();
  }
  const std::size_t before = graph_.curves.size();
  const std::vector<std::vector<cv::Mat>> images = {presence};
  match_guided(rig, families, images, {&graph_, 1}, labeling_);
  std::size_t found = 0;
  for (const LabeledRun& run : labeling_.runs[0]) {
    if (run.curve < static_cast<int>(before) || continues_a_curve(run)) continue;
    EXPECT_EQ(run.label.pattern, (PatternRef{0, 0}));
    EXPECT_EQ(run.label.line, line);
    for (int i = run.begin; i < run.end; ++i) {
      const auto& p = graph_.curves[static_cast<std::size_t>(run.curve)]
                          .points[static_cast<std::size_t>(i)]
                          .position;
      float nearest = 1e9F;
      for (const CurvePoint& t : truth) nearest = std::min(nearest, (t.position - p).norm());
      EXPECT_LT(nearest, 1.F);
      ++found;
    }
  }
  EXPECT_GT(static_cast<double>(found), 0.5 * static_cast<double>(truth.size()));
}

TEST_F(LabeledScene, GapOfALineIsClosedWhereTheImageShowsItAndNotWhereItIsDark) {
  constexpr std::size_t kGap = 7;  // points, too few for a new curve where named ones end
  std::vector<cv::Mat> presence = noisy_presence();
  const std::size_t lit = middle_curve(0);
  const std::size_t dark = lit + 2;
  std::vector<CurvePoint> truth;
  std::vector<CurvePoint> unlit;
  for (const std::size_t k : {lit, dark}) {
    std::vector<CurvePoint>& points = graph_.curves[k].points;
    const std::size_t middle = points.size() / 2;
    std::vector<CurvePoint>& gap = k == lit ? truth : unlit;
    const auto first = points.begin() + static_cast<std::ptrdiff_t>(middle);
    gap.assign(first, first + kGap);
    remove_label(k);
    const int line = true_lines[0][k];
    for (const auto& [begin, end] :
         {std::pair(std::size_t{0}, middle), std::pair(middle + kGap, points.size())}) {
      graph_.curves.push_back(graph_.curves[k]);
      Curve& piece = graph_.curves.back();
      piece.points.assign(graph_.curves[k].points.begin() + static_cast<std::ptrdiff_t>(begin),
                          graph_.curves[k].points.begin() + static_cast<std::ptrdiff_t>(end));
      piece.code.resize(2 * piece.points.size());
      graph_.component_of_curve.push_back(graph_.component_of_curve[k]);
      labeling_.runs[0].push_back({static_cast<int>(graph_.curves.size()) - 1, 0,
                                   static_cast<int>(piece.points.size()),
                                   CurveLabel{{0, 0}, line, 1.0 * line, 1}});
    }
    graph_.curves[k].points.clear();
    graph_.curves[k].code.clear();
  }
  Curve shadow;
  shadow.points = unlit;
  presence[0] -= render_curves({shadow}, presence[0].size());
  const std::size_t before = graph_.curves.size();
  const std::vector<std::vector<cv::Mat>> images = {presence};
  match_guided(rig, families, images, {&graph_, 1}, labeling_);
  std::vector<CurvePoint> found;
  for (const LabeledRun& run : labeling_.runs[0]) {
    if (run.curve < static_cast<int>(before)) continue;
    const std::vector<CurvePoint>& points =
        graph_.curves[static_cast<std::size_t>(run.curve)].points;
    found.insert(found.end(), points.begin() + run.begin, points.begin() + run.end);
  }
  const auto shown = [&](const std::vector<CurvePoint>& of_line) {
    return std::count_if(of_line.begin(), of_line.end(), [&](const CurvePoint& t) {
      return std::any_of(found.begin(), found.end(), [&](const CurvePoint& p) {
        return (p.position - t.position).norm() < 0.8F;
      });
    });
  };
  EXPECT_GE(shown(truth), static_cast<std::ptrdiff_t>(kGap) - 2);
  EXPECT_EQ(shown(unlit), 0);
}

TEST_F(LabeledScene, WhatIsLeftOfAnUndecidedCurveIsNoMissedLine) {
  const std::size_t curve = middle_curve(0);
  const int line = true_lines[0][curve];
  remove_label(curve);
  // The colour denies the line there, and the fit of the curve left half of its light.
  std::vector<float>& code = graph_.curves[curve].code;
  for (std::size_t i = 0; i < code.size(); i += 2) std::swap(code[i], code[i + 1]);
  std::vector<cv::Mat> presence;
  for (int f = 0; f < 2; ++f) {
    std::vector<Curve> of_family;
    for (const Curve& c : graph_.curves) {
      if (c.family == f) of_family.push_back(c);
    }
    if (f == 0) of_family.push_back(graph_.curves[curve]);
    presence.push_back(render_curves(of_family, {camera().width, camera().height}));
  }
  const std::vector<std::vector<cv::Mat>> images = {presence};
  const std::size_t before = graph_.curves.size();
  match_guided(rig, families, images, {&graph_, 1}, labeling_);
  for (const LabeledRun& run : labeling_.runs[0]) {
    const bool is_of_line = run.label.pattern == PatternRef{0, 0} && run.label.line == line;
    EXPECT_FALSE(is_of_line && run.curve >= static_cast<int>(before));
  }
}

TEST_F(LabeledScene, CurveOfAWallKeepsItsNameBesideTheObject) {
  constexpr int kPeriod = 8;  // lines after which the colours repeat
  rig.volume = Sphere{Vec3::Zero(), 75};
  const std::size_t curve = middle_curve(0);
  const int line = true_lines[0][curve];
  const auto n = static_cast<int>(graph_.curves[curve].points.size());
  remove_label(curve);
  const auto points_of_line = [&](int line_of_first_half) {
    GridGraph graph = graph_;
    Labeling labeling = labeling_;
    labeling.runs[0].push_back(
        {static_cast<int>(curve), 0, n / 2,
         CurveLabel{{0, 0}, line_of_first_half, 1.0 * line_of_first_half, 1}});
    std::sort(labeling.runs[0].begin(), labeling.runs[0].end(),
              [](const auto& a, const auto& b) { return a.curve < b.curve; });
    match_guided(rig, families, std::vector<std::vector<cv::Mat>>(1), {&graph, 1}, labeling);
    int points = 0;
    for (const LabeledRun& run : labeling.runs[0]) {
      if (run.curve == static_cast<int>(curve) && run.begin >= n / 2 && run.label.line == line)
        points += run.end - run.begin;
    }
    return points;
  };
  EXPECT_GT(points_of_line(line), n / 3) << "the curve goes on";
  EXPECT_EQ(points_of_line(line + 2 * kPeriod), 0) << "far behind the volume";
}

TEST_F(LabeledScene, FewerPointsAreThoseOfTheLatticeInOrder) {
  const std::vector<MeasuredPoint> all = points();
  const auto place = [](const MeasuredPoint& p) {
    return std::tuple(p.projector, p.pattern, p.line, pixel_number(p.v), pixel_number(p.u));
  };
  for (std::size_t i = 1; i < all.size(); ++i) ASSERT_LT(place(all[i - 1]), place(all[i]));
  TriangulationOptions options;
  options.used_of_seven = 2;
  const std::vector<MeasuredPoint> some = triangulate(rig, {&graph_, 1}, labeling_, options);
  EXPECT_NEAR(static_cast<double>(some.size()) / static_cast<double>(all.size()), 2 / 7.0, 0.02);
  auto at = all.begin();
  for (const MeasuredPoint& p : some) {
    at = std::find_if(at, all.end(), [&](const MeasuredPoint& q) { return place(p) == place(q); });
    ASSERT_TRUE(at != all.end());
    EXPECT_EQ(std::tie(p.x, p.y, p.z, p.sigma), std::tie(at->x, at->y, at->z, at->sigma));
  }
}

TEST_F(LabeledScene, SurfaceThatGrewIsThatOfAllPointsAtOnce) {
  const Vec3 center = camera().center();
  for (const int cut : {480, 560, 640, 720, 800}) {  // px, between cells
    for (const int beside : {8, 10, 12, 14}) {
      // A depth step runs beside the cut, where patches need a smaller neighbourhood.
      std::vector<MeasuredPoint> all = points();
      for (MeasuredPoint& p : all) {
        if (p.u < static_cast<float>(cut + beside)) continue;
        set_position(center + 1.1 * (position_of(p) - center), p);
      }
      std::vector<MeasuredPoint> right;
      std::vector<MeasuredPoint> left;
      for (const MeasuredPoint& p : all)
        (p.u < static_cast<float>(cut) ? left : right).push_back(p);
      LocalSurface at_once(camera());
      LocalSurface grown(camera());
      at_once.add(all);
      grown.add(right);
      grown.add(left);
      for (std::size_t i = 0; i < grown.patches().size(); ++i) {
        const SurfacePatch& a = grown.patches()[i];
        const SurfacePatch& b = at_once.patches()[i];
        EXPECT_EQ(a.reference, b.reference) << i;
        EXPECT_EQ(a.coefficients, b.coefficients) << i;
      }
    }
  }
}

TEST_F(LabeledScene, SettledPointsAreCloserToTheSurface) {
  const std::vector<MeasuredPoint> before = points();
  LocalSurface surface(camera());
  surface.add(before);
  const std::vector<MeasuredPoint> after = settle_points(rig, before, {&surface, 1});
  const auto rms = [&](const std::vector<MeasuredPoint>& list) {
    double sum = 0;
    for (const MeasuredPoint& p : list) {
      const double z = (camera().device_from_world * position_of(p)).z();
      sum += std::pow(z - depth_of_surface(camera(), Vec2(p.u, p.v)), 2);
    }
    return std::sqrt(sum / static_cast<double>(list.size()));
  };
  EXPECT_GT(after.size(), 0.99 * static_cast<double>(before.size()));
  // Dozens of points share a patch; its own error and bumps beyond quadratic leave part of it.
  EXPECT_LT(rms(after), 0.65 * rms(before));
  for (const MeasuredPoint& p : after) {
    const auto pixel = camera().project(position_of(p));
    ASSERT_TRUE(pixel);
    EXPECT_NEAR(pixel->x(), p.u, 1e-2);
    EXPECT_NEAR(pixel->y(), p.v, 1e-2);
  }
}

TEST_F(LabeledScene, SettlingDropsAStretchOfAWrongLine) {
  // One piece of the curve, as a solution labels it.
  const std::size_t curve = middle_curve(0);
  const int wrong = true_lines[0][curve] + 8;
  std::vector<LabeledRun>& runs = labeling_.runs[0];
  const auto run = std::find_if(runs.begin(), runs.end(), [&](const LabeledRun& r) {
    return r.curve == static_cast<int>(curve);
  });
  const int middle = (run->begin + run->end) / 2;
  LabeledRun piece = *run;
  LabeledRun rest = *run;
  run->end = piece.begin = middle - 6;
  rest.begin = piece.end = middle + 6;
  piece.label.line += 8;
  piece.label.plane += 8;
  runs.insert(run + 1, {piece, rest});
  const std::vector<MeasuredPoint> before = points();
  LocalSurface surface(camera());
  surface.add(before);
  const std::vector<MeasuredPoint> after = settle_points(rig, before, {&surface, 1});
  std::set<std::pair<float, float>> places;
  for (int i = piece.begin; i < piece.end; ++i) {
    const auto& p = graph_.curves[curve].points[static_cast<std::size_t>(i)].position;
    places.insert({p.x(), p.y()});
  }
  const auto of_piece = [&](const MeasuredPoint& p) {
    return p.projector == 0 && p.line == wrong && places.count({p.u, p.v}) != 0;
  };
  EXPECT_GT(std::count_if(before.begin(), before.end(), of_piece), 8);
  EXPECT_EQ(std::count_if(after.begin(), after.end(), of_piece), 0);
}

}  // namespace
}  // namespace pencilscan
