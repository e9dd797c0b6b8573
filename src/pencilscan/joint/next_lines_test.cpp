// Against plain loops over all points.
#include "pencilscan/joint/next_lines.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>
#include <vector>

#include "pencilscan/core/random.h"
#include "pencilscan/joint/sample_pieces.h"
#include "pencilscan/rig/object_space.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

using sample::add_random_crossings;
using sample::curve_of;
using sample::point_of;
using sample::random_curves;

/// The nearest piece on one side as next_lines.h defines it; -1: none.
int plain_next(const GridGraph& graph, const PieceGraph& pieces, std::size_t p, float side,
               float reach, const std::vector<char>& left_out) {
  const CurvePiece& own = pieces.pieces[p];
  const CurvePoint& middle = point_of(graph, own, (own.begin + own.end) / 2);
  const Eigen::Vector2f tangent = middle.tangent();
  const Eigen::Vector2f normal(tangent.y(), -tangent.x());
  float nearest = reach;
  int found = -1;
  for (std::size_t o = 0; o < pieces.pieces.size(); ++o) {
    const CurvePiece& other = pieces.pieces[o];
    if (!left_out.empty() && left_out[o] != 0) continue;
    if (other.curve == own.curve || curve_of(graph, other).family != curve_of(graph, own).family)
      continue;
    for (int i = other.begin; i < other.end; ++i) {
      const CurvePoint& point = point_of(graph, other, i);
      const Eigen::Vector2f way = point.position - middle.position;
      const float across = side * way.dot(normal);
      const bool is_beside = across >= 1.5F && std::abs(way.dot(tangent)) <= 1;
      const bool runs_along = std::abs(point.tangent().dot(tangent)) >= 0.85F;
      if (!is_beside || !runs_along || across >= nearest) continue;
      nearest = across;
      found = static_cast<int>(o);
    }
  }
  return found;
}

TEST(NextPieces, AreThoseOfAPlainLoopOverAllPoints) {
  const Camera camera = sample::device_at<Camera>({560, -110, 80}, "cam0", 160, 130, 400);
  Random random(2);
  std::size_t found = 0;
  for (int scene = 0; scene < 4; ++scene) {
    const float reach = scene < 2 ? 48 : 20;
    const GridGraph graph = random_curves(camera, 30, random);
    PieceGraph pieces = cut_into_pieces(camera, graph, 14, 10);
    add_random_crossings(6, pieces, random);
    std::set<int> crossed;
    for (const PieceCrossing& x : pieces.crossings) crossed.insert({x.a, x.b});
    std::vector<char> left_out;
    if (scene % 2 == 1) {
      for (std::size_t p = 0; p < pieces.pieces.size(); ++p)
        left_out.push_back(random.below(3) == 0 ? 1 : 0);
    }
    std::vector<NextPiece> expected;
    std::set<std::pair<int, int>> seen;
    for (std::size_t p = 0; p < pieces.pieces.size(); ++p) {
      const int a = static_cast<int>(p);
      if (crossed.count(a) != 0 || (!left_out.empty() && left_out[p] != 0)) continue;
      for (const float side : {1.F, -1.F}) {
        const int b = plain_next(graph, pieces, p, side, reach, left_out);
        if (b < 0 || !seen.insert({std::min(a, b), std::max(a, b)}).second) continue;
        const CurvePiece& own = pieces.pieces[p];
        const CurvePoint& middle = point_of(graph, own, (own.begin + own.end) / 2);
        expected.push_back({a, b, middle.position, middle.tangent(), side});
      }
    }
    const std::vector<NextPiece> result = next_pieces(camera, graph, pieces, reach, left_out);
    ASSERT_EQ(result.size(), expected.size());
    for (std::size_t i = 0; i < result.size(); ++i) {
      EXPECT_EQ(result[i].a, expected[i].a);
      EXPECT_EQ(result[i].b, expected[i].b);
      EXPECT_EQ(result[i].side, expected[i].side);
      EXPECT_EQ(result[i].pixel, expected[i].pixel);
      EXPECT_EQ(result[i].tangent, expected[i].tangent);
    }
    found += result.size();
  }
  EXPECT_GT(found, 60U);
}

TEST(NextPieces, CostIsLeastForTheNextLineAndTheSameFromBothSides) {
  std::vector<PieceLabel> labels;
  for (const int projector : {0, 1}) {
    for (int line = 3; line < 9; ++line) {
      PieceLabel label;
      label.pattern = {projector, 0};
      label.line = line;
      labels.push_back(label);
    }
  }
  for (const PieceLabel& a : labels) {
    for (const PieceLabel& b : labels) {
      EXPECT_EQ(next_piece_cost(a, b, 0), 0);
      for (const int order : {1, -1}) {
        const float cost = next_piece_cost(a, b, order);
        EXPECT_EQ(cost, next_piece_cost(b, a, -order));
        const int grows = a.pattern == b.pattern ? order * (b.line - a.line) : 3;
        if (grows == 1) {
          EXPECT_LT(cost, 0);  // what one hopes for
        } else if (grows == 2) {
          EXPECT_GT(cost, 0);
          EXPECT_LT(cost, 1);
        } else {
          EXPECT_GT(cost, 1);
        }
      }
    }
  }
  // The wrong order, or the same line twice, is worst.
  EXPECT_GT(next_piece_cost(labels[1], labels[0], 1), next_piece_cost(labels[0], labels[4], 1));
  EXPECT_GT(next_piece_cost(labels[1], labels[1], 1), next_piece_cost(labels[0], labels[8], 1));
}

TEST(NextPieces, WithoutCrossingsOnlyNextLinesAndOrderCount) {
  PieceLabel a;
  a.pattern = {0, 0};
  a.line = 5;
  PieceLabel b = a;
  for (const int order : {1, -1}) {
    for (int line = 0; line < 11; ++line) {
      b.line = line;
      const float cost = next_uncrossed_cost(a, b, order);
      EXPECT_EQ(cost, next_uncrossed_cost(b, a, -order));
      const int grows = order * (line - a.line);
      if (grows == 1) {
        EXPECT_LT(cost, -1);
      } else if (grows > 1) {
        EXPECT_EQ(cost, 0) << grows;  // a step in depth may be of any height
      } else {
        EXPECT_GT(cost, 1) << grows;
      }
    }
  }
  b.line = 6;
  EXPECT_EQ(next_uncrossed_cost(a, b, 0), 0);
  b.pattern.pattern = 1;
  EXPECT_EQ(next_uncrossed_cost(a, b, 1), 0);
}

TEST(NextPieces, LieWithinFourLineSpacings) {
  Rig rig =
      sample::two_by_two(sample::device_at<Camera>({560, -110, 80}, "cam0", 640, 480, 800),
                         sample::device_at<Projector>({500, 150, 0}, "proj0", 640, 480, 800),
                         sample::device_at<Projector>({500, 0, 150}, "proj1", 640, 480, 800), 120);
  for (const double pitch : {8., 40.}) {
    for (Projector& projector : rig.projectors) projector.patterns[0].pitch_px = pitch;
    const double spacing = pixels_at_center(rig, rig.cameras[0], line_spacing(rig));
    EXPECT_FLOAT_EQ(next_line_reach_px(rig, rig.cameras[0]),
                    pitch < 20 ? 48.F : static_cast<float>(4 * spacing));
  }
}

TEST(NextPieces, CountWhereLessThanATenthOfTheCurvesIsCrossed) {
  for (const int finer : {1, 4}) {  // the same picture with more pixels
    PieceGraph graph;
    graph.spacing_px = 10 * finer;
    // Twenty curves, in pieces of 20 points: two patterns would cross 20 * 200 / (2 * 10) times.
    for (int k = 0; k < 200 * finer; ++k) {
      CurvePiece piece;
      piece.begin = 20 * (k % 10);
      piece.end = piece.begin + 20;
      graph.pieces.push_back(piece);
    }
    graph.crossings.resize(19);
    EXPECT_TRUE(lacks_crossings(graph));
    graph.crossings.resize(21);
    EXPECT_FALSE(lacks_crossings(graph));
  }
}

}  // namespace
}  // namespace pencilscan
