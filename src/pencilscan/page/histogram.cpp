#include "pencilscan/page/histogram.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

namespace pencilscan {
namespace {

double round_up_to_two_digits(double value) {
  if (!(value > 0)) return 1;
  const double unit = std::pow(10.0, std::floor(std::log10(value)) - 1);
  return std::ceil(value / unit) * unit;
}

}  // namespace

nlohmann::ordered_json histogram(std::span<const float> values, int bins) {
  std::vector<float> sorted;
  for (const float value : values) {
    if (std::isfinite(value)) sorted.push_back(value);
  }
  if (sorted.empty()) return nullptr;
  std::sort(sorted.begin(), sorted.end());
  const auto at = [&](double share) {
    return static_cast<double>(
        sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))]);
  };
  const double high = round_up_to_two_digits(at(0.98));
  std::vector<std::size_t> counts(static_cast<std::size_t>(bins), 0);
  std::size_t above = 0;
  for (const float value : sorted) {
    if (static_cast<double>(value) > high) {
      ++above;
      continue;
    }
    const double bin = std::floor(std::max(0.0, static_cast<double>(value)) / high * bins);
    ++counts[static_cast<std::size_t>(std::min<double>(bin, bins - 1))];
  }
  return {{"high", high},           {"counts", counts},  {"above", above},
          {"count", sorted.size()}, {"median", at(0.5)}, {"p90", at(0.9)}};
}

}  // namespace pencilscan
