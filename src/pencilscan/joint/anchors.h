#pragma once

#include <functional>
#include <span>
#include <vector>

#include "pencilscan/joint/next_lines.h"
#include "pencilscan/joint/stretches.h"

namespace pencilscan {

/// Which pieces crossings hold. `linked`: per piece, the pieces that its line follows from, on its
/// own curve and beside it. `is_crossed`: per piece, 1 where a crossing bears its line out. A piece
/// is held where links along its curve lead to such a piece; and so is a group of others that hang
/// together if a held curve is linked to it. By one alone a whole group may have the line of a
/// curve that goes on wrongly: two are asked of a group that `is_ambiguous`.
[[nodiscard]] std::vector<char> held_pieces(
    const PieceGraph& graph, const std::vector<std::vector<int>>& linked,
    std::vector<char> is_crossed,
    const std::function<bool(std::span<const int> group)>& is_ambiguous);

/// True where all pieces of a group could as well show lines of another pattern or other lines of
/// their own, all as far away: codes repeat, and projectors share them. Together those cost less
/// than half a wrong colour more. The group has more curves than a code word has lines: the colours
/// of fewer say nothing.
[[nodiscard]] bool is_ambiguous_group(const LabelledPieces& pieces,
                                      const std::vector<Decision>& decisions,
                                      const JointOptions& options, std::span<const int> group);

/// Pieces side by side vouch for each other, also for the lines of another projector. So what
/// neighbours (`beside`: next_pieces) said does not count for pieces that no crossings hold: it is
/// taken off their margins.
void leave_unanchored(const LabelledPieces& pieces, std::span<const NextPiece> beside,
                      const JointOptions& options, std::vector<Decision>& decisions);

}  // namespace pencilscan
