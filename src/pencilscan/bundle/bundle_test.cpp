#include "pencilscan/bundle/bundle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>

#include "pencilscan/bundle/reprojection.h"
#include "pencilscan/bundle/sample_tracks.h"
#include "pencilscan/bundle/triangulation.h"
#include "pencilscan/bundle/uncertainty.h"

namespace pencilscan {
namespace {

using namespace sample;

TEST(Reprojection, JacobianMatchesFiniteDifferences) {
  const Rig rig = ring(1, 1);
  BundleDevice device = bundle_device(rig.cameras[0]);
  device.inner[kP1] = 0.01;
  device.inner[kP2] = -0.02;
  device.inner[kK3] = 0.05;
  const Vec3 point(40, -60, 30);
  const TrackView view{0, Vec2(600, 500), 0.1};
  const ViewLinearization at = linearize(device, point, view);
  constexpr double kTolerance = 1e-4;  // of central differences with these steps
  for (Eigen::Index i = 0; i < 18; ++i) {
    const double step = i < 6 ? 1e-6 : i < 10 ? 1e-3 : 1e-6;
    const auto moved = [&](double by) {
      BundleDevice d = device;
      Vec3 x = point;
      if (i < 6)
        d.pose[static_cast<std::size_t>(i)] += by;
      else if (i < 15)
        d.inner[static_cast<std::size_t>(i - 6)] += by;
      else
        x[i - 15] += by;
      return linearize(d, x, view).residual;
    };
    const Vec2 numeric = (moved(step) - moved(-step)) / (2 * step);
    Vec2 analytic = at.point.col(std::max<Eigen::Index>(i - 15, 0));
    if (i < 6) analytic = at.pose.col(i);
    if (i >= 6 && i < 15) analytic = at.inner.col(i - 6);
    EXPECT_LT((numeric - analytic).norm(), kTolerance * (1 + analytic.norm())) << i;
  }
}

/// Largest deviation of the derivatives of a cost from central differences, relative to their size.
double derivative_error(const ceres::CostFunction& cost,
                        std::vector<std::vector<double>> parameters) {
  const auto evaluate = [&](double** jacobians) {
    std::vector<const double*> at;
    for (const auto& block : parameters) at.push_back(block.data());
    Vec2 residual;
    EXPECT_TRUE(cost.Evaluate(at.data(), residual.data(), jacobians));
    return residual;
  };
  std::vector<std::vector<double>> rows;
  std::vector<double*> jacobians;
  for (const auto& block : parameters) rows.emplace_back(2 * block.size());
  for (auto& block : rows) jacobians.push_back(block.data());
  evaluate(jacobians.data());
  double worst = 0;
  for (std::size_t b = 0; b < parameters.size(); ++b) {
    for (std::size_t i = 0; i < parameters[b].size(); ++i) {
      const double step = 1e-6 * std::max(1.0, std::abs(parameters[b][i]));
      const auto moved = [&](double by) {
        const double value = std::exchange(parameters[b][i], parameters[b][i] + by);
        const Vec2 residual = evaluate(nullptr);
        parameters[b][i] = value;
        return residual;
      };
      const Vec2 numeric = (moved(step) - moved(-step)) / (2 * step);
      const Vec2 exact(rows[b][i], rows[b][parameters[b].size() + i]);
      worst = std::max(worst, (numeric - exact).norm() / (1 + exact.norm()));
    }
  }
  return worst;
}

TEST(Reprojection, DerivativesAreExactForAnyTurnAndLens) {
  const HeldInner held{{0.03, -0.02, 0.01}, 4.0};
  const std::vector<double> inner{900, 910, 320, 240, -0.2, 0.05, 0.01, -0.02, 0.03};
  for (const double angle : {0.0, 1e-9, 1e-4, 0.5, 3.1}) {
    const Vec3 axis = angle * Vec3(0.1, -0.2, 0.9).normalized();
    const std::vector<double> pose{axis.x(), axis.y(), axis.z(), 20, -10, 800};
    const std::vector<double> board{0.3 - angle, 0.1, -0.2, 5, 6, -30};
    EXPECT_LT(
        derivative_error(ReprojectionCost({{300, 200}, 0.5, held}), {pose, inner, {40, -60, 30}}),
        1e-5)
        << angle;
    EXPECT_LT(derivative_error(BoardCost({{300, 200}, 0.5, held}, {70, -40}), {pose, inner, board}),
              1e-5)
        << angle;
  }
}

TEST(Reprojection, AgreesWithTheDeviceModel) {
  const Rig rig = ring(1, 1);
  const Vec3 point(40, -60, 30);
  const auto error = view_error(bundle_device(rig.projectors[0]), point,
                                {0, *rig.projectors[0].project(point), 1});
  ASSERT_TRUE(error.has_value());
  EXPECT_LT(error->norm(), 1e-9);
}

TEST(BundleDevice, KeepsSkewAndDenominatorOfAGivenDevice) {
  Device given = ring(1, 1).cameras[0];
  given.K(0, 1) = 20;
  given.distortion[Distortion::kK4] = 0.02;
  const BundleDevice device = bundle_device(given);
  Device back = given;
  set_device(device, back);
  EXPECT_EQ(back.K, given.K);
  const Vec3 point(40, -160, 90);
  const Vec2 pixel = *given.project(point);
  constexpr double kRoundingPx = 1e-9;
  EXPECT_LT(view_error(device, point, {0, pixel, 1})->norm(), kRoundingPx);
  const ViewLinearization at = linearize(device, point, {0, pixel, 1});
  EXPECT_LT(at.residual.norm(), kRoundingPx);
  constexpr double kOfUndistorting = 1e-7;
  EXPECT_LT((device_ray(device, pixel).head<2>() - given.normalized_from_pixel(pixel)).norm(),
            kOfUndistorting);
}

/// Devices that see parts of a sensor have it far from the middle.
TEST(Uncertainty, WhereThePrincipalPointLiesSaysNothingOfTheImagesSize) {
  const Rig truth = ring(2, 2);
  const auto judged = [&](double off_px) {
    BundleProblem problem;
    for (std::size_t d = 0; d < device_count(truth); ++d) {
      problem.devices.push_back(bundle_device(device_at(truth, d)));
      BundleDevice& device = problem.devices.back();
      device.present = true;
      device.prior_sigma.fill(0);  // its values are held: priors do not count
      device.prior[kCx] += off_px;
    }
    problem.tracks = tracks_of(truth, {.count = 400});
    for (Track& track : problem.tracks)  // neighbours share an error
      for (TrackView& view : track.views) view.pixel.y() += view.pixel.x() < 500 ? 0.2 : -0.2;
    triangulate_all(problem, 0.01);
    return uncertainty(problem, {});
  };
  const Uncertainty in_the_middle = judged(0);
  const Uncertainty at_the_edge = judged(600);
  EXPECT_GT(in_the_middle.shared_px, 0.05);
  EXPECT_EQ(at_the_edge.shared_px, in_the_middle.shared_px);
  EXPECT_EQ(at_the_edge.volume_median, in_the_middle.volume_median);
}

/// Ratio of the largest to the smallest stated shared error of scenes that differ in noise only.
double shared_error_ratio(double shared_px) {
  const Rig truth = ring(2, 2);
  double least = std::numeric_limits<double>::infinity();
  double most = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    BundleProblem problem;
    for (std::size_t d = 0; d < device_count(truth); ++d) {
      problem.devices.push_back(bundle_device(device_at(truth, d)));
      problem.devices.back().present = true;
      problem.devices.back().prior_sigma.fill(0);
    }
    problem.tracks = tracks_of(truth, {.count = 400, .noise_seed = seed});
    for (Track& track : problem.tracks)
      for (std::size_t i = 1; i < track.views.size(); ++i) {
        TrackView& view = track.views[i];
        view.pixel.y() += shared_px * (view.pixel.x() < 500 ? 1 : -1);
      }
    triangulate_all(problem, 0.01);
    const double shared = uncertainty(problem, {}).shared_px;
    least = std::min(least, shared);
    most = std::max(most, shared);
  }
  return most / least;
}

/// A threshold on what residuals show of shared errors made it 0 in some and 0.02 px in others.
TEST(Uncertainty, EqualScenesShareErrorsAlike) {
  // Eight scenes lie within three deviations of chance, each of which makes 2.5 of the variance.
  const double most = std::sqrt(std::pow(2.5, 3));
  for (const double shared_px : {0.0, 0.005, 0.01, 0.02})
    EXPECT_LT(shared_error_ratio(shared_px), most) << shared_px;
}

/// A start that cannot be adjusted must not look like the best one.
TEST(Adjust, WhatCannotBeTakenCostsInfinitely) {
  const Rig truth = ring(1, 1);
  BundleProblem problem;
  for (std::size_t d = 0; d < device_count(truth); ++d) {
    problem.devices.push_back(bundle_device(device_at(truth, d)));
    problem.devices.back().present = true;
  }
  problem.tracks = tracks_of(truth, {.count = 50});
  triangulate_all(problem, 0.01);
  EXPECT_TRUE(std::isfinite(adjust(problem, {}).cost));
  const Device& camera = truth.cameras[0];
  problem.points[0] = camera.center() - 100 * camera.forward();  // behind it
  problem.used[0] = 1;
  EXPECT_EQ(adjust(problem, {}).cost, std::numeric_limits<double>::infinity());
}

/// Against priors, a quarter of the weight is twice the deviation.
TEST(Adjust, AQuarterOfTheWeightIsTwiceTheDeviation) {
  const Rig truth = ring(2, 2);
  const auto adjusted = [&](double noise_factor, double weight) {
    BundleProblem problem;
    for (std::size_t d = 0; d < device_count(truth); ++d) {
      problem.devices.push_back(bundle_device(device_at(truth, d)));
      BundleDevice& device = problem.devices.back();
      device.present = true;
      device.prior_sigma.fill(0);
      device.prior_sigma[kFx] = 30;
      device.prior_sigma[kFy] = 1e-6;
      device.prior[kFx] += 30;  // data and prior disagree
    }
    problem.tracks = tracks_of(truth, {.count = 60, .noise_px = 0.5});
    triangulate_all(problem, 0.01);
    for (Track& track : problem.tracks)
      for (std::size_t i = 1; i < track.views.size(); ++i) track.views[i].sigma_px *= noise_factor;
    adjust(problem, {.free_inner = 1U << kFx | 1U << kFy,
                     .loss_scale = 1e3,  // squares: the loss itself has no scale
                     .track_weight = weight,
                     .max_iterations = 200,
                     .function_tolerance = 1e-14});
    return problem.devices[0].inner[kFx];
  };
  const double truth_fx = truth.cameras[0].K(0, 0);
  EXPECT_NEAR(adjusted(2, 1), adjusted(1, 0.25), 0.01);
  EXPECT_GT(adjusted(2, 1), truth_fx + 1);  // not decided by the data alone
  EXPECT_GT(std::abs(adjusted(2, 1) - adjusted(1, 1)), 0.1);
}

}  // namespace
}  // namespace pencilscan
