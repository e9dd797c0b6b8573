#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pencilscan/joint/piece_labels.h"

namespace pencilscan {

/// The darkness term: a label that places its piece where another camera sees no line at all, of no
/// projector, is hardly true. Whatever hides the piece from that camera would show lines itself.
///
/// How often true labels lie in the dark of a camera differs: of a well exposed one in a thousand,
/// of one that sees half of its lines every second. So each camera's share is taken from the frame:
/// from the labels that crossings support best (`scores`).
class Darkness {
 public:
  Darkness(const Rig& rig, std::span<const GridGraph> graphs,
           std::span<const LabelledPieces> pieces);

  /// Cost of every label of every piece of graphs[g]: that of the camera that speaks against it
  /// most, since what two cameras leave dark is mostly dark for one reason.
  [[nodiscard]] std::vector<std::vector<float>> costs(std::size_t g) const;

 private:
  /// Where a camera sees lines, in cells.
  struct View {
    int columns = 0;
    float cell_px = 1;
    std::vector<char> is_lit;  ///< a line is in the cell or beside it; empty: no lines at all
    float cost = 0;            ///< of a label in the dark
  };
  [[nodiscard]] static View make_view(const Rig& rig, const GridGraph& graph);
  /// Per label of graphs[g], per piece one after the other, and per view: kOut, kLit or kDark.
  [[nodiscard]] std::vector<char> look_from_others(std::size_t g) const;
  void weigh_views();

  const Rig& rig_;
  std::span<const GridGraph> graphs_;
  std::span<const LabelledPieces> pieces_;
  std::vector<View> views_;              ///< per graph
  std::vector<std::vector<char>> seen_;  ///< per graph: what look_from_others() gives
};

}  // namespace pencilscan
