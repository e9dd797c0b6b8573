#pragma once

namespace pencilscan {

/// What `count` independent numbers of mean 0 have in variance beyond `chance` each, `squares` the
/// sum of their squares, with variances chance + gain x: the posterior mean of x, all deviations
/// sqrt(x) >= 0 being alike likely beforehand (A. Gelman, "Prior distributions for variance
/// parameters in hierarchical models", Bayesian Analysis 1, 2006). Steady in `squares`: where
/// chance alone explains them it is what chance may hide, about half its own deviation,
/// chance sqrt(2 / count) / gain. 0 of fewer than four numbers, whose posterior has no mean.
[[nodiscard]] double mean_extra_variance(double squares, double count, double chance, double gain);

}  // namespace pencilscan
