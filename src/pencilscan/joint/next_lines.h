#pragma once

#include <vector>

#include "pencilscan/joint/piece_labels.h"

namespace pencilscan {

/// Two pieces of one family side by side with nothing between them.
struct NextPiece {
  int a = 0;
  int b = 0;
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();    ///< on a
  Eigen::Vector2f tangent = Eigen::Vector2f::Zero();  ///< of a there, unit
  float side = 1;  ///< +1: b lies on the side of the normal (tangent.y, -tangent.x), else -1
};

/// True where so few curves cross that crossings cannot decide the lines: one projector alone. Its
/// lines then follow from their order and the code only, as in Zhang, Curless and Seitz 2002.
[[nodiscard]] bool lacks_crossings(const PieceGraph& graph);

/// The next piece of its family on both sides of each that nothing crosses: of another curve, from
/// 1.5 to 48 px away from its middle, within 1 px of square to it, and of its own direction within
/// 32 degrees. Every pair once.
[[nodiscard]] std::vector<NextPiece> next_pieces(const Camera& camera, const GridGraph& graph,
                                                 const PieceGraph& pieces);

/// Cost of two pieces side by side having these labels; `order` is by how many lines the label
/// grows, by sign, from a to b (0: unknown).
[[nodiscard]] float next_piece_cost(const PieceLabel& a, const PieceLabel& b, int order);

}  // namespace pencilscan
