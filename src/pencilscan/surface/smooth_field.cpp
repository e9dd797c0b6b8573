#include "pencilscan/surface/smooth_field.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "pencilscan/core/check.h"
#include "pencilscan/core/chunks.h"

namespace pencilscan {
namespace {

/// A known value counts as much as four differences to neighbours: Kazhdan and Hoppe (2013) use 4.
constexpr float kScreening = 4;
constexpr int kMostSteps = 300;
constexpr std::size_t kRun = 8192;  // nodes, one task

/// Sum over the nodes of what of_run(from, to) says of runs of them.
template <class OfRun>
double sum_over(std::size_t count, const OfRun& of_run) {
  return sum_of_runs(count, kRun, 0.0, of_run);
}

class Solver {
 public:
  Solver(const Lattice& lattice, const FieldData& data, std::vector<float>& values)
      : lattice_(lattice), data_(data), x_(values), free_(lattice.size()) {
    for (std::size_t i = 0; i < free_.size(); ++i) {
      free_[i] = lattice.is_inner(i) ? 1 : 0;
      if (!lattice.is_at_wall(i)) x_[i] += data.weight[i] * (data.target[i] - x_[i]);
    }
  }

  int solve(double tolerance) {
    const std::size_t n = x_.size();
    r_.assign(n, 0.F);
    p_.assign(n, 0.F);
    ap_.assign(n, 0.F);
    const auto unknowns =
        static_cast<double>(std::count(free_.begin(), free_.end(), std::uint8_t{1}));
    double rz = sum_over(n, [&](std::size_t from, std::size_t to) { return start(from, to); });
    int step = 0;
    // r / diagonal is how far a node is off; r . z, the sum of r^2 / diagonal, has at least six of
    // its squares.
    const double enough = 6 * tolerance * tolerance * unknowns;
    for (; step < kMostSteps && rz > enough; ++step) {
      const double pap = sum_over(n, [&](std::size_t from, std::size_t to) {
        double sum = 0;
        for (std::size_t i = from; i < to; ++i) {
          if (free_[i] == 0) continue;
          ap_[i] = diagonal(i) * p_[i] - neighbors(p_, i);
          sum += static_cast<double>(p_[i]) * static_cast<double>(ap_[i]);
        }
        return sum;
      });
      if (!(pap > 0)) break;
      const auto alpha = static_cast<float>(rz / pap);
      const double next = sum_over(n, [&](std::size_t from, std::size_t to) {
        double sum = 0;
        for (std::size_t i = from; i < to; ++i) {
          if (free_[i] == 0) continue;
          x_[i] += alpha * p_[i];
          r_[i] -= alpha * ap_[i];
          sum += static_cast<double>(r_[i]) * static_cast<double>(r_[i] / diagonal(i));
        }
        return sum;
      });
      const auto beta = static_cast<float>(next / rz);
      rz = next;
      parallel_for((n + kRun - 1) / kRun, [&](std::size_t r) {
        for (std::size_t i = r * kRun; i < std::min(n, (r + 1) * kRun); ++i) {
          if (free_[i] != 0) p_[i] = r_[i] / diagonal(i) + beta * p_[i];
        }
      });
    }
    return step;
  }

 private:
  [[nodiscard]] float diagonal(std::size_t i) const { return 6 + kScreening * data_.weight[i]; }

  [[nodiscard]] float neighbors(const std::vector<float>& v, std::size_t i) const {
    float sum = 0;
    for (int axis = 0; axis < 3; ++axis) {
      sum += v[static_cast<std::size_t>(lattice_.next(axis, i))] +
             v[static_cast<std::size_t>(lattice_.previous(axis, i))];
    }
    return sum;
  }

  /// What the differences of the targets ask of a node: minus their sum.
  [[nodiscard]] float right_side(std::size_t i) const {
    float sum = kScreening * data_.weight[i] * data_.target[i];
    if (!(data_.weight[i] > 0)) return sum;
    for (int axis = 0; axis < 3; ++axis) {
      for (const int neighbor : {lattice_.next(axis, i), lattice_.previous(axis, i)}) {
        const auto k = static_cast<std::size_t>(neighbor);
        sum += std::min(data_.weight[i], data_.weight[k]) * (data_.target[i] - data_.target[k]);
      }
    }
    return sum;
  }

  /// First residual and direction of a run; returns the run's r . z.
  double start(std::size_t from, std::size_t to) {
    double sum = 0;
    for (std::size_t i = from; i < to; ++i) {
      if (free_[i] == 0) continue;
      r_[i] = right_side(i) - diagonal(i) * x_[i] + neighbors(x_, i);
      p_[i] = r_[i] / diagonal(i);
      sum += static_cast<double>(r_[i]) * static_cast<double>(p_[i]);
    }
    return sum;
  }

  const Lattice& lattice_;
  const FieldData& data_;
  std::vector<float>& x_;
  std::vector<std::uint8_t> free_;
  std::vector<float> r_, p_, ap_;
};

}  // namespace

int solve_field(const Lattice& lattice, const FieldData& data, double tolerance,
                std::vector<float>& values) {
  PENCILSCAN_CHECK(values.size() == lattice.size() && data.target.size() == lattice.size() &&
                   data.weight.size() == lattice.size());
  return Solver(lattice, data, values).solve(tolerance);
}

}  // namespace pencilscan
