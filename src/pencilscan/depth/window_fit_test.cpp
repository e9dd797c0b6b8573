// The window fitter against a model of its own: in double, exact in the projector, the blurred box
// integrated by quadrature, derivatives by finite differences, optima by brute force.
#include "pencilscan/depth/window_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "pencilscan/core/random.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

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
      const double w = q[0] + q[1] * x.x() + q[2] * x.y() + q[3] * x.x() * x.x() +
                       q[4] * x.x() * x.y() + q[5] * x.y() * x.y();
      result[static_cast<Eigen::Index>(i)] =
          blurred_lines(line(rays_[pattern][i], pattern, w), half_width, reach);
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

WindowLight some_light(std::size_t families) {
  WindowLight light{{0.5, 0.4}, {0.1, 0.05}, {{0.15, -0.1}, {-0.05, 0.12}}};
  light.offset.resize(families);
  light.tilt.resize(families);
  return light;
}

/// A slanted plane before the camera.
Quadric some_plane(const WindowModel& model, Random& random) {
  const Vec3 normal(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), -1);
  return model.plane(random.uniform(550, 590), normal);
}

/// The same, off by up to an eighth of a line, and tilted.
Quadric a_start_near(const WindowModel& model, const Quadric& q, Random& random) {
  const double of_line = 1 / std::abs(model.lines_per_w(0, q[0]));
  Quadric start = q;
  for (int c = 0; c < 3; ++c) start[c] += of_line * random.uniform(-0.125, 0.125);
  return start;
}

TEST(WindowFitter, FindsThePlaneThatMadeTheWindow) {
  Random random(3);
  for (const int half : {6, 8, 10}) {
    for (const int families : {1, 2}) {
      // So much blur that neighbouring lines meet, for the smaller windows.
      const double blur_px = half < 10 ? 2.0 : 0.8;
      WindowModel model(half, Vec2(100 + 5 * half, 95), families, blur_px);
      const Quadric truth = some_plane(model, random);
      model.show(truth, some_light(model.families()));
      const auto fit = model.settled_fit(a_start_near(model, truth, random));
      ASSERT_TRUE(fit);
      const double lines = std::abs(model.lines_per_w(0, truth[0]));
      // Single precision: w within 1e-7 of a coordinate of some dozen lines. The priors pull by
      // less.
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(lines * (fit->q[c] - truth[c]), 0, 1e-3) << c;
      for (int c = 3; c < 6; ++c) EXPECT_NEAR(lines * (fit->q[c] - truth[c]), 0, 1e-2) << c;
      EXPECT_LT(fit->misfit, 1e-2F);
      EXPECT_FALSE(fit->cut);
      EXPECT_EQ(fit->lit.count(), 2U);
      EXPECT_NEAR(fit->amplitude, 0.5F, 1e-2F);
    }
  }
}

// The bell is held as wide as it is at the optimum: the fitter lets it follow the slope between
// steps, not within. Less than 0.01 of chi^2 is less than a tenth of a standard deviation.
TEST(WindowFitter, NoNeighbourOfTheOptimumIsBetter) {
  Random random(4);
  for (const int families : {1, 2}) {
    WindowModel model(5, Vec2(120, 95), families);
    Quadric truth = some_plane(model, random);
    for (int c = 3; c < 6; ++c) truth[c] = random.uniform(-2e-6, 2e-6);  // a bow of 0.6 mm
    WindowLight light = some_light(model.families());
    model.show(truth, light);
    model.add_noise(random);
    const auto fit = model.settled_fit(a_start_near(model, truth, random));
    ASSERT_TRUE(fit);
    const auto reach = model.reach(fit->q);
    const double least = model.cost(fit->q, reach, light);
    const double sigma = std::sqrt(fit->variance);
    int checked = 0;
    for (const double step : {0.1 * sigma, sigma}) {
      for (int k = 0; k < 729; ++k) {
        Quadric q = fit->q;
        int digits = k;
        for (int c = 0; c < 6; ++c, digits /= 3) q[c] += (digits % 3 - 1) * step;
        if (k == 364) continue;  // no step at all
        WindowLight own = light;
        EXPECT_GT(model.cost(q, reach, own), least - 0.01) << k;
        ++checked;
      }
    }
    EXPECT_EQ(checked, 2 * 728);
  }
}

TEST(WindowFitter, UncertaintyIsThatOfFiniteDifferences) {
  Random random(5);
  for (const int families : {1, 2}) {
    WindowModel model(8, Vec2(118, 104), families);
    const Quadric truth = some_plane(model, random);
    WindowLight light = some_light(model.families());
    model.show(truth, light);
    model.add_noise(random);
    const auto fit = model.fit(truth);
    ASSERT_TRUE(fit);
    static_cast<void>(model.cost(fit->q, model.reach(fit->q), light));
    const WindowModel::Spread spread = model.spread(fit->q, light);
    const double inflate = std::max(1.0, static_cast<double>(fit->misfit));
    EXPECT_NEAR(fit->variance / (inflate * spread.variance), 1, 1e-2);
    const double slope = std::max(std::abs(model.lines_per_w(0, fit->q[0])),
                                  std::abs(model.lines_per_w(1, fit->q[0])));
    EXPECT_NEAR(static_cast<double>(fit->lines_per_w) / slope, 1, 1e-3);
  }
}

TEST(WindowFitter, APatternIsLitFromEightDeviationsOfItsAmplitudeOn) {
  Random random(9);
  for (const int families : {1, 2}) {
    WindowModel model(8, Vec2(118, 104), families);
    const Quadric truth = some_plane(model, random);
    WindowLight light = some_light(model.families());
    light.amplitude = {0.08, 0.04};  // more than the share of the largest that is asked, too
    const double least = 8 * std::sqrt(model.spread(truth, light).of_amplitude[1]);
    for (const double share : {0.9, 1.1}) {
      light.amplitude[1] = share * least;
      model.show(truth, light);
      const auto fit = model.settled_fit(truth);
      ASSERT_TRUE(fit);
      EXPECT_TRUE(fit->lit.test(0));
      EXPECT_EQ(fit->lit.test(1), share > 1) << families << " " << share;
    }
  }
}

TEST(WindowFitter, SigmaIsTheScatterOverDrawsOfNoise) {
  Random random(6);
  WindowModel model(7, Vec2(110, 90), 2);
  const Quadric truth = some_plane(model, random);
  const WindowLight light = some_light(2);
  constexpr int kDraws = 400;
  double sum = 0;
  double sum2 = 0;
  double variance = 0;
  double misfit = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    model.show(truth, light);
    model.add_noise(random);
    const auto fit = model.fit(truth);
    ASSERT_TRUE(fit);
    sum += fit->q[0] - truth[0];
    sum2 += std::pow(fit->q[0] - truth[0], 2);
    variance += fit->variance / kDraws;
    misfit += static_cast<double>(fit->misfit) / kDraws;
  }
  const WindowModel::Spread spread = model.spread(truth, light);
  const double scatter = std::sqrt(sum2 / kDraws);
  // A deviation of 400 draws is known to 1 / sqrt(800) = 3.5 %; three of that.
  EXPECT_NEAR(scatter / std::sqrt(spread.scatter2), 1, 0.11);
  EXPECT_LT(std::abs(sum / kDraws), 3 * scatter / std::sqrt(kDraws));
  // Weights below one hold pixels for noisier than they are: sigma is above the scatter, little.
  EXPECT_GT(std::sqrt(variance), 0.95 * scatter);
  EXPECT_LT(std::sqrt(variance), 1.25 * scatter);
  // Eight and four unknowns of some 150 values, twice, are fitted away.
  EXPECT_NEAR(misfit, 1 - 12.0 / (2.0 * static_cast<double>(model.size())), 0.03);
}

TEST(WindowFitter, ASideWithoutLightIsCutOffAndADarkMiddleIsNoSurface) {
  Random random(7);
  WindowModel model(8, Vec2(118, 104), 2);
  const Quadric truth = some_plane(model, random);
  const WindowLight light = some_light(2);
  const auto darken = [&](auto is_dark) {
    model.show(truth, light);
    model.add_noise(random);
    for (std::size_t f = 0; f < 2; ++f) {
      for (std::size_t i = 0; i < model.size(); ++i) {
        if (is_dark(model.place(i))) model.value(f, i) = static_cast<float>(light.offset[f]);
      }
    }
    return model.fit(truth);
  };
  const auto whole = darken([](const Vec2&) { return false; });
  ASSERT_TRUE(whole);
  EXPECT_FALSE(whole->cut);
  constexpr double kSideStart = 0.2;  // of the fitter
  for (int side = 0; side < 8; ++side) {
    const double angle = side * std::numbers::pi / 4;
    const Vec2 way(std::cos(angle), std::sin(angle));
    const auto cut = darken([&](const Vec2& x) { return x.dot(way) > kSideStart; });
    ASSERT_TRUE(cut) << side;
    EXPECT_TRUE(cut->cut) << side;
    EXPECT_LT(std::abs(cut->q[0] - truth[0]), 4 * std::sqrt(cut->variance)) << side;
    EXPECT_GT(cut->variance, 1.2 * whole->variance) << side;
    EXPECT_LT(cut->misfit, 1.5F) << side;  // what is dark does not count
  }
  EXPECT_FALSE(darken([](const Vec2& x) { return x.norm() < 0.5; }));
}

TEST(WindowFitter, PixelsThatAreSaturatedOrNotSampledSayNothing) {
  Random random(8);
  WindowModel model(8, Vec2(118, 104), 2);
  const Quadric truth = some_plane(model, random);
  model.show(truth, some_light(2));
  model.add_noise(random);
  CameraLight& light = model.light();
  light.sampled[1] = cv::Mat(light.valid.size(), CV_8UC1, cv::Scalar(255));
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (i % 7 == 3) light.valid.at<std::uint8_t>(model.pixel_of(i)) = 0;
    if (i % 5 == 2) light.sampled[1].at<std::uint8_t>(model.pixel_of(i)) = 0;
  }
  const auto fit = model.fit(truth);
  ASSERT_TRUE(fit);
  EXPECT_LT(std::abs(fit->q[0] - truth[0]), 4 * std::sqrt(fit->variance));
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (i % 7 == 3) model.value(0, i) = model.value(1, i) = 1;
    if (i % 5 == 2) model.value(1, i) = -3;
  }
  const auto same = model.fit(truth);
  ASSERT_TRUE(same);
  EXPECT_EQ(same->q, fit->q);
  EXPECT_EQ(same->variance, fit->variance);
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (i % 9 < 5) light.valid.at<std::uint8_t>(model.pixel_of(i)) = 0;
  }
  EXPECT_FALSE(model.fit(truth));  // more than half
}

}  // namespace
}  // namespace pencilscan
