#include "pencilscan/joint/anchors.h"

#include <gtest/gtest.h>

#include <span>
#include <utility>
#include <vector>

namespace pencilscan {
namespace {

/// Curves of three pieces each; pieces of a curve are linked to the next, and whole curves to those
/// beside them as given.
struct Curves {
  Curves(int count, const std::vector<std::pair<int, int>>& beside) {
    for (int c = 0; c < count; ++c) {
      for (int k = 0; k < 3; ++k) {
        CurvePiece piece;
        piece.curve = c;
        graph.pieces.push_back(piece);
      }
    }
    linked.resize(graph.pieces.size());
    is_crossed.resize(graph.pieces.size(), 0);
    is_paired.resize(graph.pieces.size(), 0);
    for (int c = 0; c < count; ++c) {
      link(3 * c, 3 * c + 1);
      link(3 * c + 1, 3 * c + 2);
    }
    for (const auto& [a, b] : beside) link(3 * a + 1, 3 * b + 1);
  }
  void link(int a, int b) {
    linked[static_cast<std::size_t>(a)].push_back(b);
    linked[static_cast<std::size_t>(b)].push_back(a);
  }
  void unlink(int a, int b) {
    std::erase(linked[static_cast<std::size_t>(a)], b);
    std::erase(linked[static_cast<std::size_t>(b)], a);
  }
  /// Per curve, how many of its pieces are held.
  [[nodiscard]] std::vector<int> held() const {
    const std::vector<char> is_held = held_pieces(
        graph, linked, is_crossed, is_paired, [&](std::span<const int>) { return is_ambiguous; });
    std::vector<int> count(graph.pieces.size() / 3, 0);
    for (std::size_t p = 0; p < is_held.size(); ++p) count[p / 3] += is_held[p];
    return count;
  }

  PieceGraph graph;
  std::vector<std::vector<int>> linked;
  std::vector<char> is_crossed;
  std::vector<char> is_paired;
  bool is_ambiguous = true;
};

TEST(HeldPieces, HangOnACrossingOfTheirOwnCurve) {
  Curves curves(2, {});
  EXPECT_EQ(curves.held(), std::vector<int>({0, 0}));
  curves.is_crossed[2] = 1;
  EXPECT_EQ(curves.held(), std::vector<int>({3, 0}));
  // The curve jumps to another line between its first pieces.
  curves.unlink(0, 1);
  EXPECT_EQ(curves.held(), std::vector<int>({2, 0}));
}

TEST(HeldPieces, OrOnTwoCurvesThatAreHeld) {
  // A row of five; then a sixth beside nothing.
  Curves curves(6, {{0, 1}, {1, 2}, {2, 3}, {3, 4}});
  curves.is_crossed[0] = 1;
  EXPECT_EQ(curves.held(), std::vector<int>({3, 0, 0, 0, 0, 0}));
  curves.is_crossed[12] = 1;
  EXPECT_EQ(curves.held(), std::vector<int>({3, 3, 3, 3, 3, 0}));
  // Each half hangs on one curve.
  curves.unlink(7, 10);
  EXPECT_EQ(curves.held(), std::vector<int>({3, 0, 0, 0, 3, 0}));
  // That is enough where nothing else is possible.
  curves.is_ambiguous = false;
  EXPECT_EQ(curves.held(), std::vector<int>({3, 3, 3, 3, 3, 0}));
  curves.is_crossed[12] = 0;
  EXPECT_EQ(curves.held(), std::vector<int>({3, 3, 3, 0, 0, 0}));
}

TEST(HeldPieces, TwoLinksToOneCurveAreOne) {
  Curves curves(3, {{0, 1}, {1, 2}});
  curves.link(0, 3);
  curves.is_crossed[1] = 1;
  EXPECT_EQ(curves.held(), std::vector<int>({3, 0, 0}));
}

/// Curves of one piece with lines 10, 11, ... of projector 0, and as cheap those of projector 1
/// eight below.
LabelledPieces two_readings(int count) {
  LabelledPieces pieces;
  for (int c = 0; c < count; ++c) {
    CurvePiece piece;
    piece.curve = c;
    pieces.graph.pieces.push_back(piece);
    std::vector<PieceLabel> labels(2);
    labels[0].pattern = {0, 0};
    labels[0].line = 10 + c;
    labels[1].pattern = {1, 0};
    labels[1].line = 2 + c;
    pieces.labels.push_back(labels);
  }
  return pieces;
}

TEST(AmbiguousGroup, CouldShowOtherLinesAllAsFarAway) {
  LabelledPieces pieces = two_readings(4);
  const std::vector<Decision> decisions(4, Decision{0, 8.F});
  const std::vector<int> group = {0, 1, 2, 3};
  EXPECT_TRUE(is_ambiguous_group(pieces, decisions, {}, group));
  pieces.labels[2][1].cost = 3;  // about a wrong colour
  EXPECT_FALSE(is_ambiguous_group(pieces, decisions, {}, group));
  pieces.labels[2][1].cost = 1;
  EXPECT_TRUE(is_ambiguous_group(pieces, decisions, {}, group));
  pieces.labels[3][1].line = 6;  // not as far away as the others
  EXPECT_FALSE(is_ambiguous_group(pieces, decisions, {}, group));
  pieces.labels[3].pop_back();
  EXPECT_FALSE(is_ambiguous_group(pieces, decisions, {}, group));
}

TEST(AmbiguousGroup, HasMoreLinesThanACodeWord) {
  const LabelledPieces pieces = two_readings(3);
  const std::vector<Decision> decisions(3, Decision{0, 8.F});
  EXPECT_FALSE(is_ambiguous_group(pieces, decisions, {}, std::vector<int>{0, 1, 2}));
}

TEST(HeldPieces, PairsDoNotHoldAnAmbiguousGroup) {
  Curves curves(4, {{0, 1}, {1, 2}, {2, 3}});
  curves.is_paired[0] = curves.is_paired[9] = 1;
  EXPECT_EQ(curves.held(), std::vector<int>({0, 0, 0, 0}));
  curves.is_ambiguous = false;
  EXPECT_EQ(curves.held(), std::vector<int>({3, 3, 3, 3}));
}

TEST(Anchors, PairsOfCurvesThatAgreeWithNoOtherDoNotHoldLinesAPeriodOff) {
  // Four curves of one pattern side by side, which may as well show other lines, and two of another
  // pattern. All lie at one depth.
  LabelledPieces pieces = two_readings(6);
  pieces.shows_room = true;
  for (std::size_t c = 0; c < 6; ++c) {
    for (PieceLabel& label : pieces.labels[c]) {
      label.q = {0, 0, 1};
      label.inverse_depth_per_px = 0.001F;
    }
    if (c >= 4) pieces.labels[c][0].pattern = {2, 0};
  }
  const auto cross = [&](int a, int b) {
    PieceCrossing crossing;
    crossing.a = a;
    crossing.b = b;
    pieces.graph.crossings.push_back(crossing);
  };
  std::vector<NextPiece> beside(3);
  for (int c = 0; c < 3; ++c) {
    beside[static_cast<std::size_t>(c)].a = c;
    beside[static_cast<std::size_t>(c)].b = c + 1;
  }
  const auto held = [&] {
    const std::vector<char> all =
        find_anchors(pieces, beside, {}, std::vector<Decision>(6, Decision{0, 8.F})).is_held;
    return std::vector<char>(all.begin(), all.begin() + 4);
  };
  cross(0, 4);
  cross(3, 5);
  EXPECT_EQ(held(), std::vector<char>({0, 0, 0, 0}));
  cross(3, 4);  // 4 agrees with two now
  EXPECT_EQ(held(), std::vector<char>({1, 1, 1, 1}));
}

}  // namespace
}  // namespace pencilscan
