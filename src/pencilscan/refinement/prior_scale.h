#pragma once

#include <Eigen/Core>
#include <span>

namespace pencilscan {

/// How large corrections are, over what their prior says, as far as the data tell: the s in (0, 1]
/// that maximises the evidence of x ~ N(0, s^2) where data have this information (n x n) and
/// x = `found` (n) is most likely with s = 1 (D. MacKay, Bayesian interpolation, Neural Computation
/// 4, 1992, eq. 4.10 for a linear model). Rows of `apart` keep their prior. Without it a rig that
/// needs no correction is moved by what noise says along the directions that it tells little of.
[[nodiscard]] double likely_prior_scale(const Eigen::MatrixXd& information,
                                        const Eigen::VectorXd& found,
                                        std::span<const Eigen::Index> apart = {});

}  // namespace pencilscan
