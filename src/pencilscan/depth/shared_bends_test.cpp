#include "pencilscan/depth/shared_bends.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <functional>

#include "pencilscan/core/random.h"
#include "pencilscan/depth/window_fit.h"

namespace pencilscan {
namespace {

constexpr int kHalf = 5;
constexpr int kStride = 4;
constexpr int kSide = 24;        // nodes
constexpr double kNoise = 1e-5;  // of a pixel's inverse depth, which is about kW
constexpr double kW = 1e-3;

/// Of a quadric that is fitted to all pixels of a disc.
Mat6 information_of_disc() {
  Mat6 sum = Mat6::Zero();
  for (int v = -kHalf; v <= kHalf; ++v) {
    for (int u = -kHalf; u <= kHalf; ++u) {
      if (u * u + v * v > kHalf * kHalf) continue;
      const double x = static_cast<double>(u) / kHalf, y = static_cast<double>(v) / kHalf;
      Quadric m;
      m << 1, x, y, x * x, x * y, y * y;
      sum += m * m.transpose();
    }
  }
  return sum / (kNoise * kNoise);
}

/// A map of windows, each of which knows its quadric as well as its noise lets it.
struct Windows {
  explicit Windows(const std::function<Quadric(double u, double v)>& truth, int seed = 1)
      : quadric(truth) {
    const Mat6 information = information_of_disc();
    const Mat6 covariance = information.inverse();
    const Mat6 root = covariance.llt().matrixL();
    Random random(static_cast<std::uint64_t>(seed));
    map.stride = kStride;
    map.columns = map.rows = kSide;
    map.nodes.resize(static_cast<std::size_t>(kSide) * kSide);
    fitted.half = kHalf;
    for (std::size_t i = 0; i < map.nodes.size(); ++i) {
      Quadric noise;
      for (int k = 0; k < 6; ++k) noise[k] = random.normal(0, 1);
      const Quadric q = true_quadric(i) + root * noise;
      set_quadric(q, kHalf, map.nodes[i]);
      map.nodes[i].sigma = static_cast<float>(std::sqrt(covariance(0, 0)) / (q[0] * q[0]));
      fitted.add(i, information);
    }
  }

  [[nodiscard]] Quadric true_quadric(std::size_t i) const {
    const Vec2 pixel = map.pixel(i);
    return quadric(pixel[0], pixel[1]);
  }

  /// Root mean square error of the depth, over what the nodes say of it.
  [[nodiscard]] double error(double& said) const {
    double squares = 0, variance = 0;
    for (std::size_t i = 0; i < map.nodes.size(); ++i) {
      const double w = true_quadric(i)[0];
      squares += std::pow((static_cast<double>(map.nodes[i].w) - w) / (w * w), 2);
      variance += std::pow(static_cast<double>(map.nodes[i].sigma), 2);
    }
    const auto n = static_cast<double>(map.nodes.size());
    said = std::sqrt(variance / n);
    return std::sqrt(squares / n);
  }

  std::function<Quadric(double, double)> quadric;
  DepthMap map;
  FittedWindows fitted;
};

/// A surface of one bend.
Quadric smooth(double u, double v) {
  const double bow = 2e-8, x = u - 40, y = v - 50;  // 1/mm, per px^2
  Quadric q;
  q << kW + bow * (x * x + x * y / 2), bow * kHalf * (2 * x + y / 2), bow * kHalf * x / 2,
      bow * kHalf * kHalf, bow * kHalf * kHalf / 2, 0;
  return q;
}

TEST(ShareBends, WindowsOfOneBendKnowTheirDepthBetterAndSaySo) {
  Windows windows(smooth);
  double said = 0;
  const double before = windows.error(said);
  EXPECT_NEAR(said / before, 1, 0.1);
  share_bends(windows.fitted, windows.map);
  const double after = windows.error(said);
  // A known bend halves the deviation. What noise alone sets apart, theirs and the node's own, the
  // prior takes for differences of the surface, so independent neighbours give a quarter of that.
  EXPECT_LT(after, 0.9 * before);
  EXPECT_GT(after, 0.5 * before);
  EXPECT_GT(said / after, 0.85);
  EXPECT_LT(said / after, 1.1);
}

TEST(ShareBends, WhereBendsDifferEachWindowKeepsItsOwn) {
  Random random(7);
  const Mat6 covariance = information_of_disc().inverse();
  std::vector<Quadric> quadrics(static_cast<std::size_t>(kSide) * kSide, Quadric::Zero());
  for (Quadric& q : quadrics) {
    q[0] = kW;
    for (int k = 3; k < 6; ++k) q[k] = random.normal(0, 10 * std::sqrt(covariance(k, k)));
  }
  Windows windows([&](double u, double v) {
    return quadrics[static_cast<std::size_t>(v / kStride * kSide + u / kStride)];
  });
  const DepthMap before = windows.map;
  share_bends(windows.fitted, windows.map);
  std::size_t moved = 0;
  for (std::size_t i = 0; i < before.nodes.size(); ++i) {
    const double way = 1 / static_cast<double>(windows.map.nodes[i].w) -
                       1 / static_cast<double>(before.nodes[i].w);
    moved += std::abs(way) > 0.5 * static_cast<double>(before.nodes[i].sigma) ? 1 : 0;
  }
  EXPECT_LT(moved, before.nodes.size() / 20);
}

TEST(ShareBends, BesideAnotherSurfaceDepthIsNoWorse) {
  Windows windows([](double u, double v) {
    if (u < kSide / 2 * kStride) return smooth(u, v);
    Quadric q = Quadric::Zero();  // behind it, and slanted
    q[0] = 0.9 * kW + 1e-6 * u;
    q[1] = 1e-6 * kHalf;
    return q;
  });
  const auto error_beside_step = [&] {
    double squares = 0;
    for (int row = 0; row < kSide; ++row) {
      for (int column = kSide / 2 - 2; column < kSide / 2 + 2; ++column) {
        const std::size_t i = windows.map.index(row, column);
        squares +=
            std::pow(static_cast<double>(windows.map.nodes[i].w) - windows.true_quadric(i)[0], 2);
      }
    }
    return squares;
  };
  const double before = error_beside_step();
  share_bends(windows.fitted, windows.map);
  EXPECT_LT(error_beside_step(), before);
}

TEST(ShareBends, CutWindowsSayNothing) {
  Windows windows(smooth);
  Windows without(smooth);
  for (int row = 0; row < kSide; ++row) {
    windows.map.nodes[windows.map.index(row, 4)].cut = true;
    without.map.nodes[without.map.index(row, 4)].w = 0;
  }
  FittedWindows whole;
  whole.half = kHalf;
  for (std::size_t k = 0; k < windows.fitted.nodes.size(); ++k) {
    const std::size_t i = windows.fitted.nodes[k];
    if (!windows.map.nodes[i].cut) whole.add(i, windows.fitted.information[k]);
  }
  share_bends(whole, windows.map);
  share_bends(whole, without.map);
  for (const std::size_t i : whole.nodes) {
    EXPECT_EQ(windows.map.nodes[i].w, without.map.nodes[i].w) << i;
    EXPECT_EQ(windows.map.nodes[i].sigma, without.map.nodes[i].sigma) << i;
  }
}

TEST(ShareBends, AWindowWithFewNeighborsStaysAsItIs) {
  Windows windows(smooth);
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      if (row > 1 || column > 2) windows.map.nodes[windows.map.index(row, column)].w = 0;
    }
  }
  FittedWindows six;
  six.half = kHalf;
  for (std::size_t k = 0; k < windows.fitted.nodes.size(); ++k) {
    const std::size_t i = windows.fitted.nodes[k];
    if (windows.map.nodes[i].measured()) six.add(i, windows.fitted.information[k]);
  }
  ASSERT_EQ(six.nodes.size(), 6U);
  const DepthMap before = windows.map;
  share_bends(six, windows.map);
  for (const std::size_t i : six.nodes) EXPECT_EQ(windows.map.nodes[i].w, before.nodes[i].w);
}

}  // namespace
}  // namespace pencilscan
