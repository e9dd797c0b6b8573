#include "pencilscan/bundle/extra_variance.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {

double mean_extra_variance(double squares, double count, double chance, double gain) {
  constexpr double kFewest = 4;
  constexpr int kSteps = 1000;
  if (count < kFewest || !(chance > 0) || !(gain > 0)) return 0;
  // In units of chance: variances 1 + x, likelihood (1 + x)^(-n/2) exp(-q / (2 (1 + x))).
  const double q = squares / chance;
  const auto log_likelihood = [&](double x) {
    return -count / 2 * std::log1p(x) - q / (2 * (1 + x));
  };
  const double likeliest = std::max(0.0, q / count - 1);
  // The tail falls as x^(-n/2), from deviations of sqrt(2 / n) of the likeliest variance on.
  const double most = 10 * (1 + likeliest) * (likeliest / (1 + likeliest) + std::sqrt(2 / count));
  double sum = 0;
  double moment = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double s = std::sqrt(most) * (i + 0.5) / kSteps;
    const double p = std::exp(log_likelihood(s * s) - log_likelihood(likeliest));
    sum += p;
    moment += p * s * s;
  }
  return chance / gain * moment / sum;
}

}  // namespace pencilscan
