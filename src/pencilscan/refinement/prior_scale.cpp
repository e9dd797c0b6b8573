#include "pencilscan/refinement/prior_scale.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

constexpr double kLeastScale = 1e-3;  // a thousandth of a pixel: no correction at all
constexpr int kStepsOfTwo = 4;        // the maximum is flat: a fifth of the scale decides nothing

}  // namespace

double likely_prior_scale(const Eigen::MatrixXd& information, const Eigen::VectorXd& found,
                          std::span<const Eigen::Index> apart) {
  // With the unit prior (H + 1) found = b, the gradient of the data at no correction.
  const Eigen::VectorXd gradient = information * found + found;
  std::vector<Eigen::Index> rest;
  for (Eigen::Index i = 0; i < found.size(); ++i)
    if (std::find(apart.begin(), apart.end(), i) == apart.end()) rest.push_back(i);
  if (rest.empty()) return 1;
  Eigen::MatrixXd H = information(rest, rest);
  Eigen::VectorXd b = gradient(rest);
  if (!apart.empty()) {
    // What the others leave when these are free within their own prior.
    const auto n = static_cast<Eigen::Index>(apart.size());
    const Eigen::MatrixXd own = information(apart, apart) + Eigen::MatrixXd::Identity(n, n);
    const Eigen::MatrixXd solved = solve_symmetric(own, information(apart, rest));
    H -= information(rest, apart) * solved;
    b -= solved.transpose() * gradient(apart);
  }
  const SymmetricEigen axes = symmetric_eigen(H);
  const Eigen::VectorXd along = axes.vectors.transpose() * b;
  const auto evidence = [&](double s) {
    double sum = 0;
    for (Eigen::Index i = 0; i < along.size(); ++i) {
      const double gain = 1 + std::max(0.0, axes.values[i]) * s * s;
      sum += along[i] * along[i] * s * s / gain - std::log(gain);
    }
    return sum;
  };
  double best = 1;
  for (double s = 1; s > kLeastScale; s *= std::exp2(-1.0 / kStepsOfTwo))
    if (evidence(s) > evidence(best)) best = s;
  return best;
}

}  // namespace pencilscan
