#pragma once

#include <vector>

#include "pencilscan/joint/piece_labels.h"

namespace pencilscan {

/// The smoothness term: a label costs less if its depth is near the depth of the pieces around.
/// The neighbours of a piece are the nearest six pieces of other curves within 16 px of its middle
/// (every second point of them is looked at). Curves that cross the piece are not among them:
/// the crossing term compares those more exactly.
class Surroundings {
 public:
  Surroundings(const Camera& camera, const GridGraph& graph, const LabelledPieces& pieces);

  /// Cost of every label of every piece, given the beliefs in the labels of all pieces. Without
  /// beliefs all costs are 0.
  [[nodiscard]] std::vector<std::vector<float>> costs(const PieceBeliefs& beliefs) const;

 private:
  struct Neighbor {
    int piece = 0;
    int other = 0;
    Eigen::Vector2f place = Eigen::Vector2f::Zero();  ///< on the other, normalised coordinates
  };

  const LabelledPieces& pieces_;
  std::vector<Neighbor> neighbors_;
};

}  // namespace pencilscan
