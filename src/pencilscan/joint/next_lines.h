#pragma once

#include <span>
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

/// True where so few curves cross that crossings cannot decide the lines, as with one projector
/// alone: less than a tenth of those of two patterns that overlap everywhere, where each curve
/// crosses one of the other pattern per line spacing. The lines then follow from their order and
/// their code (Zhang, Curless and Seitz 2002).
[[nodiscard]] bool lacks_crossings(const PieceGraph& graph);

/// The neighbours of all pieces that no curve crosses: on each side, the next piece of the same
/// family. It belongs to another curve, lies 1.5 to `reach_px` from the piece's middle, at most
/// 1 px off the normal there, and differs by at most 32 degrees in direction. Each pair comes once.
/// Pieces that are `left_out` (per piece; empty: none) are looked past.
[[nodiscard]] std::vector<NextPiece> next_pieces(const Camera& camera, const GridGraph& graph,
                                                 const PieceGraph& pieces, float reach_px,
                                                 std::span<const char> left_out = {});
/// How far off the next line may be: 48 px, or four line spacings where that is more. Light at 60
/// degrees doubles the spacing, and one line may be missing.
[[nodiscard]] float next_line_reach_px(const Rig& rig, const Camera& camera);

/// Cost of these labels for two pieces side by side. `order`: +1 where line numbers grow from a to
/// b in the image, -1 where they fall, 0 where that is not known.
[[nodiscard]] float next_piece_cost(const PieceLabel& a, const PieceLabel& b, int order);
/// The same where nothing crosses. Between lines that do not follow each other there may be a step
/// in depth of any height: how many are missing says nothing, only their order does.
[[nodiscard]] float next_uncrossed_cost(const PieceLabel& a, const PieceLabel& b, int order);

}  // namespace pencilscan
