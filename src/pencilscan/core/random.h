#pragma once

#include <cstdint>

namespace pencilscan {

/// Small seeded generator (PCG-XSH-RR 64/32, O'Neill 2014) with its own distributions, so that a
/// seed gives the same numbers with every standard library. `stream` separates independent uses
/// (a row of an image, a frame) from one seed.
class Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0);

  std::uint32_t bits();
  double uniform();  ///< in [0, 1)
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  double normal();  ///< mean 0, standard deviation 1
  double normal(double mean, double sigma) { return mean + sigma * normal(); }
  std::uint32_t below(std::uint32_t n);  ///< in [0, n), n >= 1

 private:
  std::uint64_t state_;
  std::uint64_t increment_;
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace pencilscan
