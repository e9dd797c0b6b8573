#include "pencilscan/surface/lattice.h"

#include <algorithm>

#include "pencilscan/core/check.h"

namespace pencilscan {

Lattice::Lattice(int cells, int block, const std::vector<std::uint8_t>& marked) : cells_(cells) {
  PENCILSCAN_CHECK(cells >= 1 && cells <= kMaxCells && block >= 1 && cells % block == 0);
  const int blocks = cells / block;
  const auto row = [&](int bx, int by) {
    return static_cast<std::size_t>(bx * blocks + by) * static_cast<std::size_t>(blocks);
  };
  PENCILSCAN_CHECK(marked.size() == row(blocks, 0));
  column_.assign(static_cast<std::size_t>((cells + 1) * (cells + 1)) + 1, 0);
  // Blocks that hold a plane of nodes: two at their borders.
  const auto first_block = [&](int at) { return std::max(at - 1, 0) / block; };
  const auto last_block = [&](int at) { return std::min(at, cells - 1) / block; };
  std::vector<std::uint8_t> there(static_cast<std::size_t>(blocks));
  for (int x = 0; x <= cells; ++x) {
    for (int y = 0; y <= cells; ++y) {
      std::fill(there.begin(), there.end(), std::uint8_t{0});
      for (int bx = first_block(x); bx <= last_block(x); ++bx) {
        for (int by = first_block(y); by <= last_block(y); ++by) {
          const std::uint8_t* const of_row = marked.data() + row(bx, by);
          for (std::size_t bz = 0; bz < there.size(); ++bz) there[bz] |= of_row[bz];
        }
      }
      int from = 0;  // the first node that the column does not have yet
      for (int bz = 0; bz < blocks; ++bz) {
        if (there[static_cast<std::size_t>(bz)] == 0) continue;
        for (int z = std::max(from, bz * block); z <= (bz + 1) * block; ++z) {
          x_.push_back(static_cast<std::int16_t>(x));
          y_.push_back(static_cast<std::int16_t>(y));
          z_.push_back(static_cast<std::int16_t>(z));
        }
        from = (bz + 1) * block + 1;
      }
      column_[static_cast<std::size_t>(x * (cells + 1) + y) + 1] =
          static_cast<std::uint32_t>(z_.size());
    }
  }
  link();
}

std::pair<std::size_t, std::size_t> Lattice::column(int x, int y) const {
  const auto c = static_cast<std::size_t>(x * (cells_ + 1) + y);
  return {column_[c], column_[c + 1]};
}

void Lattice::link() {
  const std::size_t side = static_cast<std::size_t>(cells_) + 1;
  for (auto* links : {&next_, &previous_}) {
    for (std::vector<int>& of_axis : *links) of_axis.assign(size(), kNone);
  }
  /// Nodes of two columns at the same height are neighbours along the axis.
  const auto join = [&](std::size_t axis, std::size_t from, std::size_t to) {
    std::uint32_t b = column_[to];
    for (std::uint32_t a = column_[from]; a < column_[from + 1]; ++a) {
      while (b < column_[to + 1] && z_[b] < z_[a]) ++b;
      if (b == column_[to + 1]) return;
      if (z_[b] != z_[a]) continue;
      next_[axis][a] = static_cast<int>(b);
      previous_[axis][b] = static_cast<int>(a);
    }
  };
  for (std::size_t x = 0; x < side; ++x) {
    for (std::size_t y = 0; y < side; ++y) {
      const std::size_t column = x * side + y;
      if (x + 1 < side) join(0, column, column + side);
      if (y + 1 < side) join(1, column, column + 1);
      for (std::uint32_t i = column_[column]; i + 1 < column_[column + 1]; ++i) {
        if (z_[i] + 1 != z_[i + 1]) continue;
        next_[2][i] = static_cast<int>(i + 1);
        previous_[2][i + 1] = static_cast<int>(i);
      }
    }
  }
}

int Lattice::find(int x, int y, int z) const {
  if (x < 0 || y < 0 || z < 0 || x > cells_ || y > cells_ || z > cells_) return kNone;
  const auto [first, last] = column(x, y);
  const auto begin = z_.begin() + static_cast<std::ptrdiff_t>(first);
  const auto end = z_.begin() + static_cast<std::ptrdiff_t>(last);
  const auto at = std::lower_bound(begin, end, z);
  return at != end && *at == z ? static_cast<int>(at - z_.begin()) : kNone;
}

bool Lattice::corners(std::size_t i, std::array<int, 8>& corners) const {
  corners[0] = static_cast<int>(i);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t half = std::size_t{1} << axis;
    for (std::size_t k = 0; k < half; ++k) {
      const int next = next_[axis][static_cast<std::size_t>(corners[k])];
      if (next == kNone) return false;
      corners[half + k] = next;
    }
  }
  return true;
}

bool Lattice::is_inner(std::size_t i) const {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (next_[axis][i] == kNone || previous_[axis][i] == kNone) return false;
  }
  return true;
}

bool Lattice::is_at_wall(std::size_t i) const {
  const auto at_end = [&](int k) { return k == 0 || k == cells_; };
  return at_end(x_[i]) || at_end(y_[i]) || at_end(z_[i]);
}

}  // namespace pencilscan
