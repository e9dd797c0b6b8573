#pragma once

// A model of depth's windows for tests: in double, exact in the projector, the blurred box
// integrated by quadrature.

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "pencilscan/core/random.h"
#include "pencilscan/depth/window_fit.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {

/// What the fitter does not tell of the light in a window.
struct WindowLight {
  std::vector<double> amplitude;      ///< per pattern
  std::vector<double> offset;         ///< per family
  std::vector<Eigen::Vector2d> tilt;  ///< per family: slope of the amplitude over half a window
};

/// The image of a window as window_fit.h defines it.
class WindowModel {
 public:
  static constexpr double kVariance = 4e-4;  // of image values

  /// families: 2, one per projector, or 1 that both share.
  WindowModel(int half, const Vec2& pixel, int families, double blur_px = 0.8)
      : half_(half), pixel_(pixel), blur_px_(blur_px) {
    for (int dv = -half; dv <= half; ++dv) {
      for (int du = -half; du <= half; ++du) {
        if (du * du + dv * dv <= (half + 0.5) * (half + 0.5)) offsets_.emplace_back(du, dv);
      }
    }
    const Camera& camera = rig_.cameras[0];
    light_.camera = &camera;
    light_.blur_px = static_cast<float>(blur_px);
    for (int p = 0; p < 2; ++p) {
      light_.patterns.emplace_back(rig_, camera, p, 0);
      light_.patterns.back().set_family(p % families);
      for (const Vec2& at : offsets_)
        rays_[static_cast<std::size_t>(p)].emplace_back(camera, rig_.projector(p), pixel + at);
    }
    for (int f = 0; f < families; ++f) {
      light_.families.emplace_back(camera.height, camera.width, CV_32FC1, cv::Scalar(0));
      light_.sampled.emplace_back();
      light_.noise.push_back({static_cast<float>(kVariance), 0});
    }
    light_.valid = cv::Mat(camera.height, camera.width, CV_8UC1, cv::Scalar(255));
  }

  [[nodiscard]] std::size_t size() const { return offsets_.size(); }
  [[nodiscard]] std::size_t families() const { return light_.families.size(); }
  /// Of pixel i, in radii.
  [[nodiscard]] Vec2 place(std::size_t i) const { return offsets_[i] / half_; }
  [[nodiscard]] double weight(std::size_t i) const { return 1 - 0.5 * place(i).squaredNorm(); }

  /// The plane through the camera's ray at a depth, with this normal in the camera's frame.
  [[nodiscard]] Quadric plane(double depth, const Vec3& normal) const {
    const Camera& camera = rig_.cameras[0];
    const Vec3 x = depth * camera.normalized_from_pixel(pixel_).homogeneous();
    const auto w = [&](const Vec2& at) {
      const Vec3 ray = camera.normalized_from_pixel(pixel_ + half_ * at).homogeneous();
      return normal.dot(ray) / normal.dot(x);
    };
    Quadric q = Quadric::Zero();
    q[0] = w(Vec2::Zero());
    q[1] = w(Vec2::UnitX()) - q[0];
    q[2] = w(Vec2::UnitY()) - q[0];
    return q;
  }

  /// Inverse depth of the surface at a place of the window: over the foot of its perpendicular on
  /// the tangent plane, the surface rises by the quadric's bow.
  [[nodiscard]] double inverse_depth(const Quadric& q, const Vec2& at) const {
    const Camera& camera = rig_.cameras[0];
    const auto plane = [&](const Vec2& x) { return q[0] + q[1] * x.x() + q[2] * x.y(); };
    const auto point = [&](const Vec2& x, double w) -> Vec3 {
      return camera.normalized_from_pixel(pixel_ + half_ * x).homogeneous() / w;
    };
    const Vec3 origin = point(Vec2::Zero(), q[0]);
    const Vec3 along = point(Vec2::UnitX(), plane(Vec2::UnitX())) - origin;
    const Vec3 down = point(Vec2::UnitY(), plane(Vec2::UnitY())) - origin;
    const Vec3 normal = along.cross(down).normalized();
    double rise = 0;
    for (int round = 0; round < 200; ++round) {
      const Vec3 x = point(at, plane(at) + rise);
      const Vec3 foot = x - normal.dot(x - origin) * normal;
      const Vec2 m = camera.normalized_from_pixel(pixel_);
      const Vec2 px = camera.pixel_slope(m) * (foot.head<2>() / foot.z() - m) / half_;
      rise = q[3] * px.x() * px.x() + q[4] * px.x() * px.y() + q[5] * px.y() * px.y();
    }
    return plane(at) + rise;
  }

  /// Slope of the line coordinate of a pattern with inverse depth, in the middle.
  [[nodiscard]] double lines_per_w(std::size_t pattern, double w) const {
    const RayInProjector ray(rig_.cameras[0], rig_.projectors[pattern], pixel_);
    constexpr double kStep = 1e-6;
    return (line(ray, pattern, w * (1 + kStep)) - line(ray, pattern, w * (1 - kStep))) /
           (2 * kStep * w);
  }

  /// Reach of the bell per pattern, in lines, for a surface of this slope.
  [[nodiscard]] std::array<double, 2> reach(const Quadric& q) const {
    std::array<double, 2> result{};
    for (std::size_t p = 0; p < 2; ++p) {
      const auto at = [&](const Vec2& d) {
        const RayInProjector ray(rig_.cameras[0], rig_.projectors[p], pixel_ + d);
        return line(ray, p, q[0] + (q[1] * d.x() + q[2] * d.y()) / half_);
      };
      constexpr double kStep = 1e-3;
      const Vec2 gradient((at({kStep, 0}) - at({-kStep, 0})) / (2 * kStep),
                          (at({0, kStep}) - at({0, -kStep})) / (2 * kStep));
      result[p] = 3 * blur_px_ * gradient.norm();
    }
    return result;
  }

  /// Profile of a pattern at every pixel.
  [[nodiscard]] Eigen::VectorXd profile(std::size_t pattern, const Quadric& q, double reach) const {
    const auto& p = rig_.projectors[pattern].patterns[0];
    const double half_width = 0.5 * p.line_width_px / p.pitch_px;
    Eigen::VectorXd result(static_cast<Eigen::Index>(size()));
    for (std::size_t i = 0; i < size(); ++i) {
      const Vec2 x = place(i);
      result[static_cast<Eigen::Index>(i)] =
          blurred_lines(line(rays_[pattern][i], pattern, inverse_depth(q, x)), half_width, reach);
    }
    return result;
  }

  /// Image values of a family.
  [[nodiscard]] Eigen::VectorXd image(std::size_t family, const Quadric& q,
                                      const std::array<double, 2>& reach,
                                      const WindowLight& light) const {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(size()));
    for (std::size_t p = 0; p < 2; ++p) {
      if (p % families() == family) sum += light.amplitude[p] * profile(p, q, reach[p]);
    }
    for (std::size_t i = 0; i < size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      sum[k] = light.offset[family] + (1 + light.tilt[family].dot(place(i))) * sum[k];
    }
    return sum;
  }

  void show(std::size_t family, const Eigen::VectorXd& values) {
    for (std::size_t i = 0; i < size(); ++i)
      value(family, i) = static_cast<float>(values[static_cast<Eigen::Index>(i)]);
  }
  void show(const Quadric& q, const WindowLight& light) {
    for (std::size_t f = 0; f < families(); ++f) show(f, image(f, q, reach(q), light));
  }
  void add_noise(Random& random) {
    for (std::size_t f = 0; f < families(); ++f) {
      for (std::size_t i = 0; i < size(); ++i)
        value(f, i) += static_cast<float>(random.normal(0, std::sqrt(kVariance)));
    }
  }
  float& value(std::size_t family, std::size_t i) {
    return light_.families[family].at<float>(pixel_of(i));
  }
  [[nodiscard]] cv::Point pixel_of(std::size_t i) const {
    const Vec2 at = pixel_ + offsets_[i];
    return {static_cast<int>(at.x()), static_cast<int>(at.y())};
  }
  CameraLight& light() { return light_; }

  [[nodiscard]] std::optional<WindowFit> fit(const Quadric& start) const {
    return WindowFitter(light_, half_).fit(pixel_, start, 30);
  }
  /// The fitter rests as soon as the middle does. Started there again, slopes come to rest too.
  [[nodiscard]] std::optional<WindowFit> settled_fit(const Quadric& start) const {
    std::optional<WindowFit> result = fit(start);
    for (int again = 0; again < 3 && result; ++again) result = fit(result->q);
    return result;
  }

  /// What the fitter minimises: chi^2 of the shown image with the weak priors on the slope of
  /// albedo (0.3 over the window) and on curvature (a bow of 6); with the best light for this
  /// surface, given the blur and a first guess of the light.
  [[nodiscard]] double cost(const Quadric& q, const std::array<double, 2>& reach,
                            WindowLight& light) const {
    double sum = 0;
    for (int c = 3; c < 6; ++c) sum += std::pow(q[c] / (6 * q[0] * q[0]), 2);
    std::array<Eigen::VectorXd, 2> profiles{profile(0, q, reach[0]), profile(1, q, reach[1])};
    for (std::size_t f = 0; f < families(); ++f) {
      double of_family = 0;
      for (int round = 0; round < 5; ++round) of_family = improve_light(f, profiles, light);
      sum += of_family;
    }
    return sum;
  }

  /// Variances of the inverse depth in the middle and of the amplitudes: of least squares with the
  /// fitter's weights as it means them, and what white noise really does to q[0].
  struct Spread {
    double variance = 0;
    std::vector<double> of_amplitude;
    double scatter2 = 0;
  };
  [[nodiscard]] Spread spread(const Quadric& q, const WindowLight& light) const {
    const std::array<double, 2> bell = reach(q);
    const auto pixels = static_cast<Eigen::Index>(size());
    const auto count = static_cast<Eigen::Index>(6 + 2 + 3 * families());
    const auto all = static_cast<Eigen::Index>(families()) * pixels;
    Eigen::MatrixXd J(all, count);
    const auto model = [&](Eigen::Index unknown, double step) {
      Quadric surface = q;
      WindowLight lit = light;
      if (unknown < 6) {
        surface[unknown] += step * q[0];
      } else if (unknown < 8) {
        lit.amplitude[static_cast<std::size_t>(unknown - 6)] += step;
      } else {
        const auto f = static_cast<std::size_t>(unknown - 8) / 3;
        const auto k = (unknown - 8) % 3;
        (k == 0 ? lit.offset[f] : lit.tilt[f][k - 1]) += step;
      }
      Eigen::VectorXd values(all);
      for (std::size_t f = 0; f < families(); ++f)
        values.segment(static_cast<Eigen::Index>(f) * pixels, pixels) =
            image(f, surface, bell, lit);
      return values;
    };
    constexpr double kStep = 1e-6;
    for (Eigen::Index c = 0; c < count; ++c)
      J.col(c) = (model(c, kStep) - model(c, -kStep)) / (2 * kStep);
    Eigen::VectorXd weights(all);
    for (Eigen::Index i = 0; i < all; ++i)
      weights[i] = weight(static_cast<std::size_t>(i % pixels)) / kVariance;
    Eigen::MatrixXd H = J.transpose() * weights.asDiagonal() * J;
    for (Eigen::Index c = 3; c < 6; ++c) H(c, c) += 1 / std::pow(6 * q[0], 2);
    for (Eigen::Index c = 8; c < count; ++c) H(c, c) += (c - 8) % 3 == 0 ? 0 : 11;
    const Eigen::MatrixXd inverse = H.llt().solve(Eigen::MatrixXd::Identity(count, count));
    const Eigen::VectorXd gain = (weights.asDiagonal() * J * inverse.col(0)) * std::sqrt(kVariance);
    return {inverse(0, 0) * q[0] * q[0],
            {inverse(6, 6), inverse(7, 7)},
            gain.squaredNorm() * q[0] * q[0]};
  }

 private:
  /// Lines at the integers, boxes of this half width, blurred by (1 - u^2)^3 of this reach. On the
  /// part of a box within reach that is a polynomial of degree 6: four points of Gauss and Legendre
  /// integrate it exactly.
  static double blurred_lines(double l, double half_width, double reach) {
    constexpr std::array<double, 4> kPoint = {-0.861136311594053, -0.339981043584856,
                                              0.339981043584856, 0.861136311594053};
    constexpr std::array<double, 4> kWeight = {0.347854845137454, 0.652145154862546,
                                               0.652145154862546, 0.347854845137454};
    double sum = 0;
    for (double n = std::floor(l) - 1; n <= l + 2; ++n) {
      const double low = std::max(n - half_width, l - reach);
      const double high = std::min(n + half_width, l + reach);
      if (low >= high) continue;
      for (std::size_t k = 0; k < 4; ++k) {
        const double u = (0.5 * (low + high) + 0.5 * (high - low) * kPoint[k] - l) / reach;
        sum += 0.5 * (high - low) * kWeight[k] * 35 / 32 / reach * std::pow(1 - u * u, 3);
      }
    }
    return sum;
  }

  [[nodiscard]] double line(const RayInProjector& ray, std::size_t pattern, double w) const {
    const LinePattern& p = rig_.projectors[pattern].patterns[0];
    return p.coordinate((*ray.pixel(1 / w))[static_cast<Eigen::Index>(p.axis)]);
  }

  /// One step of Gauss and Newton for the light of a family; the cost before it.
  double improve_light(std::size_t family, const std::array<Eigen::VectorXd, 2>& profiles,
                       WindowLight& light) const {
    Eigen::Matrix<double, 5, 5> H = Eigen::Matrix<double, 5, 5>::Zero();
    Eigen::Matrix<double, 5, 1> g = Eigen::Matrix<double, 5, 1>::Zero();
    Eigen::Vector2d& tilt = light.tilt[family];
    double chi2 = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      const double envelope = 1 + tilt.dot(place(i));
      Eigen::Matrix<double, 5, 1> row = Eigen::Matrix<double, 5, 1>::Zero();
      double sum = 0;
      for (std::size_t p = 0; p < 2; ++p) {
        if (p % families() != family) continue;
        const double value = profiles[p][static_cast<Eigen::Index>(i)];
        row[static_cast<Eigen::Index>(p)] = envelope * value;
        sum += light.amplitude[p] * value;
      }
      row[2] = 1;
      row.tail<2>() = sum * place(i);
      const auto seen = static_cast<double>(light_.families[family].at<float>(pixel_of(i)));
      const double r = seen - light.offset[family] - envelope * sum;
      const double w = weight(i) / kVariance;
      chi2 += w * r * r;
      H += w * row * row.transpose();
      g += w * r * row;
    }
    const double cost = chi2 + 11 * tilt.squaredNorm();
    for (Eigen::Index p = 0; p < 2; ++p) {
      if (H(p, p) == 0) H(p, p) = 1;  // of the other family
    }
    H.bottomRightCorner<2, 2>() += 11 * Eigen::Matrix2d::Identity();
    g.tail<2>() -= 11 * tilt;
    const Eigen::Matrix<double, 5, 1> step = H.llt().solve(g);
    for (std::size_t p = 0; p < 2; ++p) light.amplitude[p] += step[static_cast<Eigen::Index>(p)];
    light.offset[family] += step[2];
    tilt += step.tail<2>();
    return cost;
  }

  Rig rig_ = sample::small_rig(240, 200, 70);
  CameraLight light_;
  int half_;
  Vec2 pixel_;
  double blur_px_;
  std::vector<Vec2> offsets_;
  std::array<std::vector<RayInProjector>, 2> rays_;
};

}  // namespace pencilscan
