#pragma once

#include <vector>

#include "pencilscan/joint/piece_labels.h"

namespace pencilscan {

/// What the pieces around one in the same image say of its labels: surfaces are mostly smooth, so
/// that a label whose depth differs little from theirs gains. That are the nearest six pieces of
/// other curves within 16 px of its middle, by every second of their points. Curves that cross it
/// are left out: crossings say that better.
class Surroundings {
 public:
  Surroundings(const Camera& camera, const GridGraph& graph, const LabelledPieces& pieces);

  /// Cost of every label of every piece, given the beliefs in the labels of all; empty beliefs say
  /// nothing.
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
