#include "pencilscan/joint/min_sum.h"

#include <algorithm>
#include <limits>

#include "pencilscan/core/lanes.h"

namespace pencilscan {
namespace {

/// Smallest sums of a table with a vector along its rows and one along its columns.
struct TableMinima {
  std::vector<float> of_columns;  ///< out[j] = min_i cavity_a[i] + table[i, j]
  std::vector<float> of_rows;     ///< out[i] = min_j cavity_b[j] + table[i, j]
};

/// Both directions at once, so that the table is read once; >= kLanes columns. The last columns of
/// a row are read together with some before them, which does a minimum no harm; their minima stay
/// in a register: what is written in one block and read in another stalls.
PENCILSCAN_CLONES
void scan_wide_table(const float* table, const float* cavity_a, const float* cavity_b, int rows,
                     int columns, float* of_rows, float* of_columns) {
  Lanes worst;
  fill(std::numeric_limits<float>::max(), worst);
  const int whole = columns / kLanes * kLanes;
  const int last = columns - kLanes;
  Lanes last_b;
  load(cavity_b + last, last_b);
  Lanes last_column = worst;
  for (int i = 0; i < rows; ++i) {
    const float* row = table + static_cast<std::ptrdiff_t>(i) * columns;
    const float a = cavity_a[i];
    __builtin_prefetch(row + 512);
    __builtin_prefetch(row + 528);
    Lanes value;
    load(row + last, value);
    const Lanes last_from_a = value + a;
    last_column = last_from_a < last_column ? last_from_a : last_column;
    Lanes best = value + last_b;
    for (int j = 0; j < whole; j += kLanes) {
      Lanes column;
      Lanes b;
      load(row + j, value);
      load(of_columns + j, column);
      load(cavity_b + j, b);
      const Lanes from_a = value + a;
      const Lanes from_b = value + b;
      store(from_a < column ? from_a : column, of_columns + j);
      best = from_b < best ? from_b : best;
    }
    float lowest = best[0];
    for (int k = 1; k < kLanes; ++k) lowest = std::min(lowest, best[k]);
    of_rows[i] = lowest;
  }
  Lanes column;
  load(of_columns + last, column);
  store(last_column < column ? last_column : column, of_columns + last);
}

void scan_narrow_table(const float* table, const float* cavity_a, const float* cavity_b, int rows,
                       int columns, float* of_rows, float* of_columns) {
  for (int i = 0; i < rows; ++i) {
    const float* row = table + static_cast<std::ptrdiff_t>(i) * columns;
    float lowest = std::numeric_limits<float>::max();
    for (int j = 0; j < columns; ++j) {
      of_columns[j] = std::min(of_columns[j], cavity_a[i] + row[j]);
      lowest = std::min(lowest, cavity_b[j] + row[j]);
    }
    of_rows[i] = lowest;
  }
}

void scan_table(const float* table, const std::vector<float>& cavity_a,
                const std::vector<float>& cavity_b, TableMinima& minima) {
  minima.of_rows.resize(cavity_a.size());
  minima.of_columns.assign(cavity_b.size(), std::numeric_limits<float>::max());
  const auto scan = cavity_b.size() >= kLanes ? scan_wide_table : scan_narrow_table;
  scan(table, cavity_a.data(), cavity_b.data(), static_cast<int>(cavity_a.size()),
       static_cast<int>(cavity_b.size()), minima.of_rows.data(), minima.of_columns.data());
}

}  // namespace

std::vector<float> min_sum(const PairwiseEnergy& energy, int rounds, float damping) {
  // Messages to b and to a, per edge; beliefs = unary + all incoming messages.
  std::vector<std::size_t> to_b(energy.edges.size());
  std::vector<std::size_t> to_a(energy.edges.size());
  std::size_t size = 0;
  for (std::size_t e = 0; e < energy.edges.size(); ++e) {
    to_b[e] = size;
    size += static_cast<std::size_t>(energy.labels(energy.edges[e].b));
    to_a[e] = size;
    size += static_cast<std::size_t>(energy.labels(energy.edges[e].a));
  }
  std::vector<float> messages(size, 0.F);
  std::vector<float> beliefs = energy.unary;
  std::vector<float> cavity_a;
  std::vector<float> cavity_b;
  TableMinima minima;
  for (int round = 0; round < rounds; ++round) {
    std::vector<float> next = energy.unary;
    for (std::size_t e = 0; e < energy.edges.size(); ++e) {
      const auto& edge = energy.edges[e];
      const float* table = energy.tables.data() + edge.table;
      const auto first_a = static_cast<std::size_t>(energy.first[static_cast<std::size_t>(edge.a)]);
      const auto first_b = static_cast<std::size_t>(energy.first[static_cast<std::size_t>(edge.b)]);
      const auto set_cavity = [&](int node, std::size_t first, std::size_t message,
                                  std::vector<float>& cavity) {
        cavity.resize(static_cast<std::size_t>(energy.labels(node)));
        for (std::size_t i = 0; i < cavity.size(); ++i)
          cavity[i] = beliefs[first + i] - messages[message + i];
      };
      const auto update = [&](const std::vector<float>& out, std::size_t message,
                              std::size_t first) {
        const float lowest = *std::min_element(out.begin(), out.end());
        for (std::size_t i = 0; i < out.size(); ++i) {
          float& m = messages[message + i];
          m = damping * m + (1 - damping) * (out[i] - lowest);
          next[first + i] += m;
        }
      };
      // Both directions read the beliefs of the last round and the messages as they were then.
      set_cavity(edge.a, first_a, to_a[e], cavity_a);
      set_cavity(edge.b, first_b, to_b[e], cavity_b);
      scan_table(table, cavity_a, cavity_b, minima);
      update(minima.of_rows, to_a[e], first_a);
      update(minima.of_columns, to_b[e], first_b);
    }
    beliefs.swap(next);
  }
  return beliefs;
}

}  // namespace pencilscan
