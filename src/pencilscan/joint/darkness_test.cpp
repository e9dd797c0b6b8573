#include "pencilscan/joint/darkness.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "pencilscan/rig/object_space.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

constexpr double kHalf = 20;     ///< of a lit square in the plane x = 0
constexpr double kInFront = 90;  ///< so far before it is where wrong labels lie

/// Lines on a lit square before three cameras. Each piece has two labels: on the square, which
/// crossings support, and far before it.
struct LitSquare {
  LitSquare() {
    rig = sample::small_rig(240, 200, 110);
    rig.cameras.push_back(sample::device_at<Camera>({540, 200, 160}, "cam2", 240, 200, 850));
    for (int c = 0; c < 3; ++c) add_view(c);
  }

  void add_view(int c) {
    const Camera& camera = rig.camera(c);
    GridGraph& graph = graphs.emplace_back();
    graph.camera = c;
    cv::Mat presence(camera.height, camera.width, CV_32FC1, cv::Scalar(0.1));
    for (double y = -kHalf; y <= kHalf; y += line_spacing(rig)) {
      Curve curve;
      for (double z = -kHalf; z <= kHalf; z += 0.6) {
        CurvePoint point;
        point.position = camera.project({0, y, z})->cast<float>();
        point.amplitude = 1;
        curve.points.push_back(point);
        cv::circle(presence, cv::Point(cv::Point2f(point.position.x(), point.position.y())), 2, 1,
                   cv::FILLED);
      }
      graph.curves.push_back(curve);
    }
    graph.lit = lit_cells(rig, c, graph.curves, {&presence, 1});
    LabelledPieces& own = pieces.emplace_back();
    own.graph = cut_into_pieces(camera, graph, 12, 10);
    for (std::size_t p = 0; p < own.graph.pieces.size(); ++p) {
      own.labels.push_back({label_at(camera, 0), label_at(camera, kInFront)});
      own.scores.push_back({0, 9});
      if (p == 0) continue;
      PieceCrossing crossing;
      crossing.a = static_cast<int>(p) - 1;
      crossing.b = static_cast<int>(p);
      own.graph.crossings.push_back(crossing);
    }
  }

  /// A label whose sheet is the plane x = `at`.
  static PieceLabel label_at(const Camera& camera, double at) {
    const RigidTransform& t = camera.device_from_world;
    const Vec3 normal = t.rotation.col(0);
    PieceLabel label;
    label.q = (normal / (normal.dot(t.translation) + at)).cast<float>();
    return label;
  }

  /// From where camera o would see a label of a piece to its nearest line, in line spacings;
  /// negative: not in its picture.
  [[nodiscard]] double spacings_to_line(std::size_t g, std::size_t p, std::size_t k,
                                        std::size_t o) const {
    const Camera& camera = rig.cameras[g];
    const Vec3 ray = pieces[g].graph.pieces[p].middle.homogeneous().cast<double>();
    const double depth = 1 / pieces[g].labels[p][k].q.cast<double>().dot(ray);
    const auto at =
        rig.cameras[o].project(camera.device_from_world.inverse() * (depth * ray).eval());
    if (!at || !rig.cameras[o].contains(*at)) return -1;
    double nearest = std::numeric_limits<double>::infinity();
    for (const Curve& curve : graphs[o].curves)
      for (const CurvePoint& point : curve.points)
        nearest = std::min(nearest, (point.position.cast<double>() - *at).norm());
    const double distance = rig.cameras[o].center().norm();
    return nearest / (line_spacing(rig) * rig.cameras[o].K(0, 0) / distance);
  }

  Rig rig;
  std::vector<GridGraph> graphs;
  std::vector<LabelledPieces> pieces;
};

TEST(LitCells, GrazingLightIsLightAndNoiseIsNot) {
  LitSquare scene;
  cv::Mat presence(200, 240, CV_32FC1);
  cv::theRNG().state = 1;
  cv::randn(presence, 0.1, 0.02);
  presence(cv::Rect(160, 100, 40, 40)) += 0.05;  // no line is found in them
  presence(cv::Rect(20, 100, 40, 40)) += 0.3;
  const LitCells cells = lit_cells(scene.rig, 0, scene.graphs[0].curves, {&presence, 1});
  EXPECT_EQ(cells.at({180, 120}), Sight::kFaint);
  EXPECT_EQ(cells.at({40, 120}), Sight::kLit);
  const Vec2 on_line = scene.graphs[0].curves[0].points[0].position.cast<double>();
  EXPECT_EQ(cells.at(on_line), Sight::kLit);
  for (const Vec2& pixel : {Vec2(30, 30), Vec2(30, 180), Vec2(0, 0), Vec2(239, 10)})
    EXPECT_EQ(cells.at(pixel), Sight::kDark) << pixel.transpose();
  EXPECT_TRUE(lit_cells(scene.rig, 0, {}, {&presence, 1}).seen.empty());
}

TEST(Darkness, WhatLiesBeforeNothingCostsAndWhatLiesOnLinesDoesNot) {
  const LitSquare scene;
  const Darkness darkness(scene.rig, scene.graphs, scene.pieces);
  int dark = 0;
  for (std::size_t g = 0; g < 3; ++g) {
    const auto costs = darkness.costs(g);
    ASSERT_EQ(costs.size(), scene.pieces[g].labels.size());
    for (std::size_t p = 0; p < costs.size(); ++p) {
      EXPECT_EQ(costs[p][0], 0);
      double farthest = -1;
      for (std::size_t o = 0; o < 3; ++o)
        if (o != g) farthest = std::max(farthest, scene.spacings_to_line(g, p, 1, o));
      if (farthest < 2) {
        EXPECT_EQ(costs[p][1], 0) << g << " " << p;
      }
      if (farthest < 6) continue;  // in between, cells decide
      ++dark;
      EXPECT_GT(costs[p][1], 3) << g << " " << p;
    }
  }
  EXPECT_GT(dark, 30);
}

TEST(Darkness, ACameraThatMissesLightHasLittleToSay) {
  const LitSquare whole;
  LitSquare half;  // camera 2 does not see the light on one half of the square
  LitCells& cells = half.graphs[2].lit;
  const Vec2 middle = *half.rig.cameras[2].project(Vec3::Zero());
  const int column = static_cast<int>(static_cast<float>(middle.x()) / cells.cell_px.width);
  cells.seen.colRange(column, cells.seen.cols) = static_cast<int>(Sight::kDark);
  const auto greatest = [](const LitSquare& scene) {
    // What camera 2 alone says of camera 0's labels.
    std::vector<GridGraph> graphs = scene.graphs;
    graphs[1] = {};
    const Darkness darkness(scene.rig, graphs, scene.pieces);
    float most = 0;
    for (const auto& costs : darkness.costs(0)) most = std::max(most, costs[1]);
    return most;
  };
  EXPECT_GT(greatest(whole), 3);
  EXPECT_LT(greatest(half), 1.5);
  EXPECT_GT(greatest(half), 0);
}

TEST(Darkness, FaintLightIsAsGoodAsDarkWhereTrueLabelsLieOnLines) {
  LitSquare lit;  // all of the pictures is lit a little
  for (GridGraph& graph : lit.graphs)
    graph.lit.seen = cv::max(graph.lit.seen, static_cast<int>(Sight::kFaint));
  const LitSquare black;
  for (std::size_t g = 0; g < 3; ++g)
    EXPECT_EQ(Darkness(lit.rig, lit.graphs, lit.pieces).costs(g),
              Darkness(black.rig, black.graphs, black.pieces).costs(g));
}

TEST(Darkness, ACameraWhoseLightIsUnknownSaysNothing) {
  LitSquare scene;
  for (const std::size_t c : {1U, 2U}) {
    scene.graphs[c].lit = {};
  }
  const Darkness darkness(scene.rig, scene.graphs, scene.pieces);
  for (const auto& costs : darkness.costs(0)) EXPECT_EQ(costs, (std::vector<float>{0, 0}));
}

}  // namespace
}  // namespace pencilscan
