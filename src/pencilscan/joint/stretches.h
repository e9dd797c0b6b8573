#pragma once

#include <span>
#include <vector>

#include "pencilscan/joint/min_sum.h"
#include "pencilscan/joint/next_lines.h"
#include "pencilscan/joint/piece_labels.h"

namespace pencilscan {

/// What the joint solution says of a piece.
struct Decision {
  int label = -1;    ///< index in the piece's labels; -1: outlier
  float margin = 0;  ///< how much more the next best label costs
};

/// The best label of each piece by its min-marginals, laid out as PairwiseEnergy::unary with
/// "outlier" as the last label of each piece.
[[nodiscard]] std::vector<Decision> decisions_of(const LabelledPieces& pieces,
                                                 std::span<const float> costs);

/// Pieces that follow each other on a curve and were given one line.
struct Stretch {
  std::size_t first = 0;
  std::size_t last = 0;  ///< inclusive
};

[[nodiscard]] std::vector<Stretch> same_line_stretches(const LabelledPieces& pieces,
                                                       const std::vector<Decision>& decisions);

/// The energy of the pieces with each stretch as one variable, which takes a line for all its
/// pieces. A piece that cannot show the line is an outlier then. Pieces of no stretch are left out.
struct TiedEnergy {
  std::vector<std::vector<PatternLine>> lines;  ///< per stretch: what its variable may be
  PairwiseEnergy energy;
};

[[nodiscard]] TiedEnergy tie_pieces(const LabelledPieces& pieces, const PairwiseEnergy& energy,
                                    std::span<const Stretch> stretches);

/// What whole stretches say of each piece's line: how much more the best other line of its stretch
/// costs in the energy that is tied so. 0 where that prefers another line, and for pieces without
/// one.
[[nodiscard]] std::vector<float> margins_of_stretches(const LabelledPieces& pieces,
                                                      const PairwiseEnergy& energy,
                                                      const std::vector<Decision>& decisions,
                                                      int rounds, float damping);

/// Pieces that may be ghosts: those of stretches of which more than half has less than .3 of the
/// height of a line beside it (`beside`: next_pieces), and such pieces without a line.
[[nodiscard]] std::vector<char> faint_pieces(const GridGraph& graph, const LabelledPieces& pieces,
                                             std::span<const NextPiece> beside,
                                             const std::vector<Decision>& decisions);

/// Without crossings only the code and other views tell lines apart: where a line a whole period
/// away is possible too, all along a stretch, the margin is what other views and darkness say
/// against it. One camera alone leaves such a stretch ambiguous (margin 0).
void leave_periodic(const Rig& rig, const LabelledPieces& pieces, const PairwiseEnergy& energy,
                    std::vector<Decision>& decisions);

}  // namespace pencilscan
