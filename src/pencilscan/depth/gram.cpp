#include "pencilscan/depth/gram.h"

#include <cstddef>

#include "pencilscan/core/lanes.h"

namespace pencilscan {
namespace {

PENCILSCAN_INLINE float sum(const Lanes& x) {
  return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

/// Three columns by three: as many sums as fit into the registers.
template <int M, int N>
PENCILSCAN_INLINE void block(const float* J, int rows, int columns, int first, int second,
                             float* result) {
  Lanes sums[M][N] = {};
  for (int r = 0; r < rows; r += kLanes) {
    Lanes b[N];
    for (int n = 0; n < N; ++n) load(J + static_cast<std::ptrdiff_t>(second + n) * rows + r, b[n]);
    for (int m = 0; m < M; ++m) {
      Lanes a;
      load(J + static_cast<std::ptrdiff_t>(first + m) * rows + r, a);
      for (int n = 0; n < N; ++n) sums[m][n] += a * b[n];
    }
  }
  for (int m = 0; m < M; ++m) {
    for (int n = 0; n < N; ++n) {
      const float s = sum(sums[m][n]);
      result[(first + m) * columns + second + n] = s;
      result[(second + n) * columns + first + m] = s;
    }
  }
}

template <int M>
PENCILSCAN_INLINE void block_row(const float* J, int rows, int columns, int first, float* result) {
  int second = first;
  for (; second + 3 <= columns; second += 3) block<M, 3>(J, rows, columns, first, second, result);
  if (columns - second == 2) block<M, 2>(J, rows, columns, first, second, result);
  if (columns - second == 1) block<M, 1>(J, rows, columns, first, second, result);
}

}  // namespace

PENCILSCAN_CLONES void gram(const float* J, int rows, int columns, float* result) {
  int first = 0;
  for (; first + 3 <= columns; first += 3) block_row<3>(J, rows, columns, first, result);
  if (columns - first == 2) block_row<2>(J, rows, columns, first, result);
  if (columns - first == 1) block_row<1>(J, rows, columns, first, result);
}

}  // namespace pencilscan
