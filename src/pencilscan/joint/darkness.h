#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "pencilscan/joint/piece_labels.h"

namespace pencilscan {

/// The darkness term: a label that places its piece where another camera sees no light of any
/// projector is hardly true. Whatever hides the piece from that camera would be lit itself.
///
/// How often true labels lie in a camera's dark depends on the camera: one in a thousand for a well
/// exposed one, half of them for one that sees half of the light. So each camera's share is taken
/// from the frame: from labels whose `scores` lead those of all others of their piece clearly.
class Darkness {
 public:
  Darkness(const Rig& rig, std::span<const GridGraph> graphs,
           std::span<const LabelledPieces> pieces);

  /// Cost of every label of every piece of graphs[g]. Of all cameras, the one that speaks against a
  /// label most counts, alone: a place that two cameras leave dark is mostly dark for one reason.
  [[nodiscard]] std::vector<std::vector<float>> costs(std::size_t g) const;

 private:
  /// Per label of graphs[g], per piece one after the other, and per view: its Sight, or kOut.
  [[nodiscard]] std::vector<std::uint8_t> look_from_others(std::size_t g) const;
  void weigh_views();

  const Rig& rig_;
  std::span<const GridGraph> graphs_;
  std::span<const LabelledPieces> pieces_;
  /// Per graph: cost of a label where it sees that.
  std::vector<std::array<float, kSights>> weights_;
  std::vector<std::vector<std::uint8_t>> seen_;  ///< per graph: what look_from_others() gives
};

}  // namespace pencilscan
