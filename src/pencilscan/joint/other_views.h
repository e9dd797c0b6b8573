#pragma once

#include <span>
#include <vector>

#include "pencilscan/joint/piece_labels.h"
#include "pencilscan/view/cell_index.h"

namespace pencilscan {

/// The multi-view term. A label places its piece in space. Unless something hides that place,
/// another camera should see a curve of the same family, direction and line there. It sees one if a
/// point of its curves lies within 1.8 px across, 1 px along and 26 degrees. The cameras that have
/// a say are those whose axes lie within 75 degrees of the first camera's. Where there is none,
/// those within 105 degrees have a smaller say, if there are at least two.
class OtherViews {
 public:
  OtherViews(const Rig& rig, std::span<const GridGraph> graphs,
             std::span<const LabelledPieces> pieces);

  /// Leaves out labels: new_index[g][p][k] is what becomes of label k of piece p of graphs[g], -1
  /// if it is gone. The pieces given at first hold the labels that stay by then.
  void forget(std::span<const std::vector<std::vector<int>>> new_index);

  /// Cost of every label of every piece of graphs[g]; `beliefs` per graph, empty at first, when
  /// only places and directions count.
  [[nodiscard]] std::vector<std::vector<float>> costs(std::size_t g,
                                                      std::span<const PieceBeliefs> beliefs) const;

 private:
  /// A label of a piece, seen from another camera.
  struct Sighting {
    int piece = 0;
    int label = 0;
    int graph = 0;  ///< of the other camera
    int hit = -1;   ///< piece there; -1: nothing where it should be
    int same = -1;  ///< its label with the same line; -1: it has none
  };

  /// The graphs of the cameras that have a say in what one shows.
  struct Voices {
    std::vector<std::size_t> graphs;
    float hit_if_true = 0;  ///< probability that one of them sees a curve where a true label lies
  };

  struct Entry {
    Eigen::Vector2f position;
    Eigen::Vector2f tangent;
    int piece;
  };
  /// Curve points of one camera and family, by place.
  struct FamilyView {
    CellIndex index;
    std::vector<Entry> entries;  ///< in the index's order
  };
  using View = std::vector<FamilyView>;
  static constexpr int kCellPx = 2;

  /// The piece nearest to a place, of this direction; -1: none.
  [[nodiscard]] static int find(const FamilyView& view, const Eigen::Vector2f& position,
                                const Eigen::Vector2f& tangent);

  [[nodiscard]] View make_view(std::size_t g) const;
  [[nodiscard]] Voices voices_of(std::size_t g) const;
  [[nodiscard]] std::vector<Sighting> look_from_others(std::size_t g,
                                                       std::span<const View> views) const;

  const Rig& rig_;
  std::span<const GridGraph> graphs_;
  std::span<const LabelledPieces> pieces_;
  std::vector<Voices> voices_;                    ///< per graph
  std::vector<std::vector<Sighting>> sightings_;  ///< per graph
};

}  // namespace pencilscan
