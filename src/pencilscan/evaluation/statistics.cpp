#include "pencilscan/evaluation/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "pencilscan/core/check.h"

namespace pencilscan {
namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

std::vector<double> ranks(std::span<const double> values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t i, std::size_t j) { return values[i] < values[j]; });
  std::vector<double> rank(values.size());
  for (std::size_t i = 0; i < order.size();) {
    std::size_t end = i + 1;
    while (end < order.size() && values[order[end]] == values[order[i]]) ++end;
    for (std::size_t k = i; k < end; ++k) {
      rank[order[k]] = 0.5 * static_cast<double>(i + end - 1);
    }
    i = end;
  }
  return rank;
}

}  // namespace

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return kNothing;
  std::sort(values.begin(), values.end());
  const double position = q * static_cast<double>(values.size() - 1);
  const auto low = static_cast<std::size_t>(position);
  const std::size_t high = std::min(low + 1, values.size() - 1);
  const double fraction = position - static_cast<double>(low);
  if (fraction == 0) return values[low];  // an infinite neighbour must not turn it into NaN
  return (1 - fraction) * values[low] + fraction * values[high];
}

double rank_correlation(std::span<const double> a, std::span<const double> b) {
  PENCILSCAN_CHECK(a.size() == b.size());
  if (a.size() < 2) return 0;
  const auto ra = ranks(a);
  const auto rb = ranks(b);
  const double mean = 0.5 * static_cast<double>(a.size() - 1);
  double aa = 0;
  double bb = 0;
  double ab = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    aa += (ra[i] - mean) * (ra[i] - mean);
    bb += (rb[i] - mean) * (rb[i] - mean);
    ab += (ra[i] - mean) * (rb[i] - mean);
  }
  return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0;
}

DistanceFigures distance_figures(std::span<const double> distances_mm) {
  DistanceFigures figures{distances_mm.size(), kNothing, kNothing, kNothing, kNothing};
  if (distances_mm.empty()) return figures;
  constexpr double kGrossMm = 2;
  double squares = 0;
  Share gross;
  for (const double d : distances_mm) {
    squares += d * d;
    gross.add(d > kGrossMm);
  }
  figures.median_mm = quantile({distances_mm.begin(), distances_mm.end()}, 0.5);
  figures.p90_mm = quantile({distances_mm.begin(), distances_mm.end()}, 0.9);
  figures.rms_mm = std::sqrt(squares / static_cast<double>(distances_mm.size()));
  figures.share_above_2mm = gross.value();
  return figures;
}

double Share::value() const {
  return count > 0 ? static_cast<double>(hits) / static_cast<double>(count) : kNothing;
}

SigmaFigures sigma_figures(std::span<const double> sigmas, std::span<const double> errors) {
  PENCILSCAN_CHECK(sigmas.size() == errors.size());
  SigmaFigures figures;
  for (std::size_t i = 0; i < sigmas.size(); ++i) {
    figures.below_one.add(errors[i] < sigmas[i]);
    figures.below_two.add(errors[i] < 2 * sigmas[i]);
  }
  figures.rank_correlation = rank_correlation(sigmas, errors);
  std::vector<std::size_t> order(sigmas.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t i, std::size_t j) { return sigmas[i] < sigmas[j]; });
  constexpr std::size_t kTenths = 10;
  for (std::size_t k = 0; k < kTenths; ++k) {
    Share share;
    for (std::size_t i = k * order.size() / kTenths; i < (k + 1) * order.size() / kTenths; ++i) {
      share.add(errors[order[i]] < sigmas[order[i]]);
    }
    figures.tenths.push_back(share.value());
  }
  return figures;
}

}  // namespace pencilscan
