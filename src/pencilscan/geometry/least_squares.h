#pragma once

#include "pencilscan/geometry/types.h"

namespace pencilscan {

// Eigen's decompositions take the compiler seconds in every file that uses them, and many files
// need the same few: they are compiled once, here.

/// x of A x = b, of symmetric A (LDLT); not finite where A has no inverse.
[[nodiscard]] Vec3 solve_symmetric(const Mat3& A, const Vec3& b);
[[nodiscard]] Vec6 solve_symmetric(const Mat6& A, const Vec6& b);
/// The same of many right sides; n x n and n x m.
[[nodiscard]] Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

struct SymmetricEigen {
  Eigen::VectorXd values;   ///< ascending
  Eigen::MatrixXd vectors;  ///< columns, orthonormal
};

/// Of an n x n matrix, whose lower triangle counts.
[[nodiscard]] SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& A);

/// Orthonormal columns that span those of A, n x m with m <= n (Householder QR).
[[nodiscard]] Eigen::MatrixXd orthonormal_basis(const Eigen::MatrixXd& A);

/// The motion, with one scale if asked for, that brings `from` onto `to` at least squares, as a
/// homogeneous matrix; points are columns, three or more. S. Umeyama, Least-squares estimation of
/// transformation parameters between two point patterns, PAMI 1991.
[[nodiscard]] Eigen::Matrix4d fit_similarity(const Eigen::Matrix3Xd& from,
                                             const Eigen::Matrix3Xd& to, bool with_scale);

}  // namespace pencilscan
