#pragma once

#include <Eigen/Core>
#include <array>

namespace pencilscan {

/// Sums of w x^i y^j for i + j <= 4 by rising degree: 1, x, y, xx, xy, yy, xxx, ... yyyy. The
/// normal equations of a quadric over (x, y) hold nothing else. Returns their matrix (6 x 6) for
/// the coefficients of 1, x, y, xx, xy, yy.
template <typename Number>
[[nodiscard]] Eigen::Matrix<Number, 6, 6> quadric_normal_matrix(const std::array<Number, 15>& s) {
  Eigen::Matrix<Number, 6, 6> N;
  N << s[0], s[1], s[2], s[3], s[4], s[5],    //
      s[1], s[3], s[4], s[6], s[7], s[8],     //
      s[2], s[4], s[5], s[7], s[8], s[9],     //
      s[3], s[6], s[7], s[10], s[11], s[12],  //
      s[4], s[7], s[8], s[11], s[12], s[13],  //
      s[5], s[8], s[9], s[12], s[13], s[14];
  return N;
}

}  // namespace pencilscan
