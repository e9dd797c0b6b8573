#include "pencilscan/geometry/least_squares.h"

#include <Eigen/Dense>

namespace pencilscan {

Vec3 solve_symmetric(const Mat3& A, const Vec3& b) { return A.ldlt().solve(b); }

Vec6 solve_symmetric(const Mat6& A, const Vec6& b) { return A.ldlt().solve(b); }

Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  return A.ldlt().solve(B);
}

SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& A) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(A);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

Eigen::MatrixXd orthonormal_basis(const Eigen::MatrixXd& A) {
  return Eigen::HouseholderQR<Eigen::MatrixXd>(A).householderQ() *
         Eigen::MatrixXd::Identity(A.rows(), A.cols());
}

Eigen::Matrix4d fit_similarity(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to,
                               bool with_scale) {
  return Eigen::umeyama(from, to, with_scale);
}

}  // namespace pencilscan
