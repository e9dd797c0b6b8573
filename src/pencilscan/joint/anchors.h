#pragma once

#include <functional>
#include <span>
#include <vector>

#include "pencilscan/joint/next_lines.h"
#include "pencilscan/joint/stretches.h"

namespace pencilscan {

/// Which pieces crossings hold; 1: held. `linked`: per piece, the pieces that its line follows
/// from, on its own curve and beside it. `is_crossed`: per piece, 1 where a crossing bears its line
/// out. `is_paired`: per piece, 1 where a crossing does so whose two curves agree with no other
/// (before a room).
/// Each of them may have chosen the line that meets the other's, among all of its colours.
///   1. A crossed piece is held.
///   2. A piece is held where links along its own curve lead to a crossed piece.
///   3. The other pieces form groups, by their links. All pieces of a group are held where a held
///      curve is linked to it. A group that `is_ambiguous` needs two such curves: a single one may
///      go on along the wrong line, and the whole group with it. Pairs hold their group, too, but
///      not one that `is_ambiguous`, however many they are.
[[nodiscard]] std::vector<char> held_pieces(
    const PieceGraph& graph, const std::vector<std::vector<int>>& linked,
    std::vector<char> is_crossed, const std::vector<char>& is_paired,
    const std::function<bool(std::span<const int> group)>& is_ambiguous);

/// True where a group of pieces could as well show other lines, because codes repeat and projectors
/// share them. The other lines are of any pattern, and all the same number of lines away. Together
/// they cost less than half a wrong colour more than the group's own. A group is never ambiguous if
/// it has no more curves than a code word has lines: the colours of so few curves say nothing.
[[nodiscard]] bool is_ambiguous_group(const LabelledPieces& pieces,
                                      const std::vector<Decision>& decisions,
                                      const JointOptions& options, std::span<const int> group);

/// What holds the lines of pieces.
struct Anchors {
  std::vector<std::vector<int>> linked;  ///< per piece: as held_pieces() takes them
  std::vector<int> neighbors;            ///< per piece: how many beside it vouch for its line
  std::vector<char> is_held;             ///< per piece
};

/// `beside`: the neighbours, as next_pieces() gives them.
[[nodiscard]] Anchors find_anchors(const LabelledPieces& pieces, std::span<const NextPiece> beside,
                                   const JointOptions& options,
                                   const std::vector<Decision>& decisions);

/// Takes what neighbours said off the margins of pieces that no crossings hold. Pieces side by side
/// vouch for each other, and they do so for the lines of a wrong projector, too.
void leave_unanchored(const Anchors& anchors, std::vector<Decision>& decisions);

}  // namespace pencilscan
