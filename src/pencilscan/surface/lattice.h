#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace pencilscan {

/// Some of the nodes of a cubic lattice of cells^3 cells: sparse, in order of x, then y, then z.
/// Invariant: the nodes are sorted, none is there twice.
class Lattice {
 public:
  using Node = std::array<int, 3>;  ///< coordinates, each in [0, cells]
  static constexpr int kNone = -1;  ///< index of a node that is not there
  static constexpr int kMaxCells = 1024;

  /// The nodes of all blocks of block^3 cells that are marked: one byte per block, index
  /// (x * blocks + y) * blocks + z. cells: in [1, kMaxCells], a multiple of block.
  Lattice(int cells, int block, const std::vector<std::uint8_t>& marked);

  [[nodiscard]] int cells() const { return cells_; }
  [[nodiscard]] std::size_t size() const { return z_.size(); }
  [[nodiscard]] Node node(std::size_t i) const { return {x_[i], y_[i], z_[i]}; }
  [[nodiscard]] int z(std::size_t i) const { return z_[i]; }
  /// First node of column (x, y) and one past its last, in order of z; coordinates in [0, cells].
  [[nodiscard]] std::pair<std::size_t, std::size_t> column(int x, int y) const;
  /// kNone where it is not there; coordinates may lie outside.
  [[nodiscard]] int find(int x, int y, int z) const;
  /// The next node along an axis (0 x, 1 y, 2 z) and the one before; kNone where it is not there.
  [[nodiscard]] int next(int axis, std::size_t i) const {
    return next_[static_cast<std::size_t>(axis)][i];
  }
  [[nodiscard]] int previous(int axis, std::size_t i) const {
    return previous_[static_cast<std::size_t>(axis)][i];
  }
  /// Nodes of the cell whose least corner is node i: bit 0 of the place is x, bit 1 y, bit 2 z.
  /// False where one is not there.
  [[nodiscard]] bool corners(std::size_t i, std::array<int, 8>& corners) const;
  /// True where all six neighbours are there.
  [[nodiscard]] bool is_inner(std::size_t i) const;
  /// True on the surface of the whole cube.
  [[nodiscard]] bool is_at_wall(std::size_t i) const;

 private:
  void link();

  int cells_;
  std::vector<std::int16_t> x_, y_, z_;
  std::vector<std::uint32_t> column_;  ///< first node of column (x, y), and the end of the last
  std::array<std::vector<int>, 3> next_, previous_;
};

}  // namespace pencilscan
