#include "pencilscan/solution/min_sum.h"

#include <algorithm>
#include <limits>

namespace pencilscan {
namespace {

/// out[j] = min_i cavity[i] + table[i, j], normalised to minimum 0.
void send_forward(const float* table, const std::vector<float>& cavity, int rows, int columns,
                  std::vector<float>& out) {
  out.assign(static_cast<std::size_t>(columns), std::numeric_limits<float>::max());
  for (int i = 0; i < rows; ++i) {
    const float c = cavity[static_cast<std::size_t>(i)];
    const float* row = table + static_cast<std::ptrdiff_t>(i) * columns;
    for (int j = 0; j < columns; ++j)
      out[static_cast<std::size_t>(j)] = std::min(out[static_cast<std::size_t>(j)], c + row[j]);
  }
}

void send_backward(const float* table, const std::vector<float>& cavity, int rows, int columns,
                   std::vector<float>& out) {
  out.resize(static_cast<std::size_t>(rows));
  for (int i = 0; i < rows; ++i) {
    const float* row = table + static_cast<std::ptrdiff_t>(i) * columns;
    float best = std::numeric_limits<float>::max();
    for (int j = 0; j < columns; ++j)
      best = std::min(best, cavity[static_cast<std::size_t>(j)] + row[j]);
    out[static_cast<std::size_t>(i)] = best;
  }
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
  std::vector<float> cavity;
  std::vector<float> out;
  for (int round = 0; round < rounds; ++round) {
    std::vector<float> next = energy.unary;
    for (std::size_t e = 0; e < energy.edges.size(); ++e) {
      const auto& edge = energy.edges[e];
      const int rows = energy.labels(edge.a);
      const int columns = energy.labels(edge.b);
      const float* table = energy.tables.data() + edge.table;
      const auto first_a = static_cast<std::size_t>(energy.first[static_cast<std::size_t>(edge.a)]);
      const auto first_b = static_cast<std::size_t>(energy.first[static_cast<std::size_t>(edge.b)]);
      const auto update = [&](std::size_t message, std::size_t first) {
        const float lowest = *std::min_element(out.begin(), out.end());
        for (std::size_t i = 0; i < out.size(); ++i) {
          float& m = messages[message + i];
          m = damping * m + (1 - damping) * (out[i] - lowest);
          next[first + i] += m;
        }
      };
      // Both directions read the beliefs of the last round and the messages as they were then.
      std::vector<float>& c = cavity;
      c.resize(static_cast<std::size_t>(rows));
      for (std::size_t i = 0; i < c.size(); ++i)
        c[i] = beliefs[first_a + i] - messages[to_a[e] + i];
      send_forward(table, c, rows, columns, out);
      std::vector<float> forward = out;
      c.resize(static_cast<std::size_t>(columns));
      for (std::size_t i = 0; i < c.size(); ++i)
        c[i] = beliefs[first_b + i] - messages[to_b[e] + i];
      send_backward(table, c, rows, columns, out);
      update(to_a[e], first_a);
      out.swap(forward);
      update(to_b[e], first_b);
    }
    beliefs.swap(next);
  }
  return beliefs;
}

}  // namespace pencilscan
