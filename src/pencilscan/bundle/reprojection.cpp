#include "pencilscan/bundle/reprojection.h"

#include <cmath>

#include "pencilscan/geometry/cross_matrix.h"

namespace pencilscan {
namespace {

/// What the exponential of a rotation by `angle` and its derivative are made of.
struct AngleFactors {
  double sine;       ///< sin(angle) / angle
  double cosine;     ///< (1 - cos(angle)) / angle^2
  double remaining;  ///< (angle - sin(angle)) / angle^3
};

AngleFactors angle_factors(double square) {
  // Two terms of the series are exact to rounding there: the third is below square^2 / 100.
  constexpr double kSmall = 1e-7;
  if (square < kSmall) return {1 - square / 6, 0.5 - square / 24, 1.0 / 6 - square / 120};
  const double angle = std::sqrt(square);
  const double sine = std::sin(angle);
  return {sine / angle, (1 - std::cos(angle)) / square, (angle - sine) / (square * angle)};
}

struct Turn {
  Mat3 generator;  ///< [axis]x
  Mat3 square;     ///< of the generator
  AngleFactors factors;
  Mat3 rotation;
};

/// Rodrigues' formula.
Turn turn_of(const double* pose) {
  const Vec3 axis(pose[0], pose[1], pose[2]);
  Turn turn;
  turn.generator = cross_matrix(axis);
  turn.square = turn.generator * turn.generator;
  turn.factors = angle_factors(axis.squaredNorm());
  turn.rotation =
      Mat3::Identity() + turn.factors.sine * turn.generator + turn.factors.cosine * turn.square;
  return turn;
}

Vec3 translation_of(const double* pose) { return {pose[3], pose[4], pose[5]}; }

/// Nothing at or behind the pinhole.
std::optional<Vec2> straight_of(const Vec3& in_device) {
  constexpr double kLeastDepth = 1e-6;
  if (!(in_device.z() > kLeastDepth)) return std::nullopt;
  return in_device.head<2>() / in_device.z();
}

Eigen::Matrix2d focal_matrix(const double* inner, const HeldInner& held) {
  Eigen::Matrix2d K;
  K << inner[kFx], held.skew, 0, inner[kFy];
  return K;
}

template <int kColumns>
using Rows = Eigen::Matrix<double, 2, kColumns, Eigen::RowMajor>;

template <int kColumns>
void write_divided(const Rows<kColumns>& from, double sigma, double* to) {
  if (to == nullptr) return;
  Eigen::Map<Rows<kColumns>> rows(to);
  rows = from / sigma;
}

/// A point that a pose moves, and how it changes with the pose and with the point that is moved.
struct MovedPoint {
  Vec3 point;
  Eigen::Matrix<double, 3, 6> by_pose;
  Mat3 by_point;
};

MovedPoint moved_point(const double* pose, const Vec3& point) {
  const Turn turn = turn_of(pose);
  MovedPoint moved;
  moved.by_point = turn.rotation;
  moved.point = turn.rotation * point + translation_of(pose);
  // d (R X) / d axis = -R [X]x Jr, Jr the right Jacobian of rotations (Chirikjian, "Stochastic
  // Models, Information Theory, and Lie Groups", volume 2, 2012, section 10.8).
  const Mat3 right = Mat3::Identity() - turn.factors.cosine * turn.generator +
                     turn.factors.remaining * turn.square;
  moved.by_pose.leftCols<3>() = -turn.rotation * (cross_matrix(point) * right);
  moved.by_pose.rightCols<3>().setIdentity();
  return moved;
}

/// Where a device shows a point, and how that changes.
struct ShownPoint {
  Vec2 pixel;
  Rows<6> by_pose;
  Rows<kIntrinsics> by_inner;
  Rows<3> by_point;
};

std::optional<ShownPoint> shown_point(const double* pose, const double* inner,
                                      const HeldInner& held, const Vec3& point) {
  const MovedPoint moved = moved_point(pose, point);
  const auto straight = straight_of(moved.point);
  if (!straight) return std::nullopt;
  const Distortion lens{lens_coefficients(inner, held.denominator)};
  const Vec2 bent = distort(lens, *straight);
  const Eigen::Matrix2d K = focal_matrix(inner, held);
  const Eigen::Matrix2d by_straight = K * distortion_slope(lens, *straight);
  Eigen::Matrix<double, 2, 3> by_moved;
  by_moved << by_straight, -by_straight * *straight;
  by_moved /= moved.point.z();

  ShownPoint shown;
  shown.pixel = K * bent + Vec2(inner[kCx], inner[kCy]);
  shown.by_pose = by_moved * moved.by_pose;
  shown.by_point = by_moved * moved.by_point;
  shown.by_inner << bent.x(), 0, 1, 0, 0, 0, 0, 0, 0,  //
      0, bent.y(), 0, 1, 0, 0, 0, 0, 0;
  shown.by_inner.rightCols<Distortion::kBrown>() = K * distortion_by_brown(lens, *straight);
  return shown;
}

/// What both costs share; `parameters` and `jacobians` begin with those of the device. The
/// derivative by the point: nothing without `jacobians`.
struct Evaluated {
  bool is_shown = false;
  Rows<3> by_point = Rows<3>::Zero();
};

Evaluated evaluate(const SeenPixel& seen, const double* const* parameters, const Vec3& point,
                   double* residual, double** jacobians) {
  Eigen::Map<Vec2> whitened(residual);
  if (jacobians == nullptr) {
    const auto pixel = shown_pixel(parameters[0], parameters[1], seen.held, point);
    if (pixel) whitened = (*pixel - seen.pixel) / seen.sigma;
    return {pixel.has_value()};
  }
  const auto shown = shown_point(parameters[0], parameters[1], seen.held, point);
  if (!shown) return {};
  whitened = (shown->pixel - seen.pixel) / seen.sigma;
  write_divided<6>(shown->by_pose, seen.sigma, jacobians[0]);
  write_divided<kIntrinsics>(shown->by_inner, seen.sigma, jacobians[1]);
  return {true, shown->by_point};
}

}  // namespace

std::optional<Vec2> shown_pixel(const double* pose, const double* inner, const HeldInner& held,
                                const Vec3& point) {
  const auto straight = straight_of(turn_of(pose).rotation * point + translation_of(pose));
  if (!straight) return std::nullopt;
  const Vec2 bent = distort({lens_coefficients(inner, held.denominator)}, *straight);
  return focal_matrix(inner, held) * bent + Vec2(inner[kCx], inner[kCy]);
}

bool ReprojectionCost::Evaluate(const double* const* parameters, double* residual,
                                double** jacobians) const {
  const Vec3 point(parameters[2][0], parameters[2][1], parameters[2][2]);
  const Evaluated at = evaluate(seen_, parameters, point, residual, jacobians);
  if (at.is_shown && jacobians != nullptr) write_divided<3>(at.by_point, seen_.sigma, jacobians[2]);
  return at.is_shown;
}

bool BoardCost::Evaluate(const double* const* parameters, double* residual,
                         double** jacobians) const {
  const MovedPoint moved = moved_point(parameters[2], {position_.x(), position_.y(), 0});
  const Evaluated at = evaluate(seen_, parameters, moved.point, residual, jacobians);
  if (at.is_shown && jacobians != nullptr)
    write_divided<6>(at.by_point * moved.by_pose, seen_.sigma, jacobians[2]);
  return at.is_shown;
}

}  // namespace pencilscan
