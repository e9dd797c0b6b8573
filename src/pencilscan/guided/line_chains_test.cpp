// Chains of predicted points against a search over all orders of them.
#include "pencilscan/guided/line_chains.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <tuple>
#include <vector>

#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

constexpr float kFarthestLink = 2.5F;  // px, line_chains.h

std::tuple<int, int, int> rank_of(const PredictedPoint& p) {
  return {p.pattern.projector, p.pattern.pattern, p.line};
}

float gap(const PredictedPoint& a, const PredictedPoint& b) {
  return (a.position - b.position).norm();
}

float length_of(const LineChain& chain) {
  float sum = 0;
  for (std::size_t i = 1; i < chain.size(); ++i) sum += gap(chain[i - 1], chain[i]);
  return sum;
}

/// Points along arcs of random lines, some 1 px apart with wider gaps, in any order.
std::vector<PredictedPoint> points_of_random_lines(Random& random) {
  std::vector<PredictedPoint> points;
  for (int line = 0; line < 4; ++line) {
    PredictedPoint p;
    p.pattern = {static_cast<int>(random.below(2)), static_cast<int>(random.below(2))};
    p.line = static_cast<int>(random.below(3));
    for (const PredictedPoint& other : points) {
      if (name_of(other) == name_of(p)) p.line = 3 + line;  // each name once
    }
    p.position = {static_cast<float>(random.uniform(10, 20)),
                  static_cast<float>(random.uniform(10, 20))};
    auto angle = static_cast<float>(random.uniform(0, 6.28));
    const auto bend = static_cast<float>(random.uniform(-0.15, 0.15));
    const std::uint32_t count = 2 + random.below(6);
    for (std::uint32_t i = 0; i < count; ++i) {
      p.normal = {std::sin(angle), -std::cos(angle)};
      p.patch = points.size();
      points.push_back(p);
      const double step = random.below(4) == 0 ? random.uniform(2.6, 4) : random.uniform(0.7, 1.7);
      p.position += static_cast<float>(step) * Eigen::Vector2f(std::cos(angle), std::sin(angle));
      angle += bend;
    }
  }
  for (std::size_t i = points.size(); i > 1; --i)
    std::swap(points[i - 1], points[random.below(static_cast<std::uint32_t>(i))]);
  return points;
}

/// The groups that links of at most 2.5 px between points of one line leave, each in the order, of
/// all orders, that makes the shortest way through it.
std::vector<LineChain> shortest_ways(const std::vector<PredictedPoint>& points) {
  std::vector<std::size_t> group(points.size());
  std::iota(group.begin(), group.end(), 0U);
  for (std::size_t round = 0; round < points.size(); ++round) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      for (std::size_t j = 0; j < points.size(); ++j) {
        if (name_of(points[i]) == name_of(points[j]) && gap(points[i], points[j]) <= kFarthestLink)
          group[i] = group[j] = std::min(group[i], group[j]);
      }
    }
  }
  std::vector<LineChain> ways;
  for (std::size_t g = 0; g < points.size(); ++g) {
    LineChain order;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (group[i] == g) order.push_back(points[i]);
    }
    if (order.empty()) continue;
    const auto before = [](const PredictedPoint& a, const PredictedPoint& b) {
      return a.patch < b.patch;
    };
    std::sort(order.begin(), order.end(), before);
    LineChain best = order;
    while (std::next_permutation(order.begin(), order.end(), before)) {
      if (length_of(order) < length_of(best)) best = order;
    }
    ways.push_back(best);
  }
  return ways;
}

/// What points a chain holds, in its order, from whichever end.
std::vector<std::size_t> order_of(const LineChain& chain) {
  std::vector<std::size_t> order;
  for (const PredictedPoint& p : chain) order.push_back(p.patch);
  if (order.front() > order.back()) std::reverse(order.begin(), order.end());
  return order;
}

TEST(ChainPoints, AreTheShortestWaysThroughAllPointsOfALine) {
  Random random(1);
  std::size_t longest = 0;
  for (int scene = 0; scene < 40; ++scene) {
    const std::vector<PredictedPoint> points = points_of_random_lines(random);
    const std::vector<LineChain> chains = chain_points(points);
    std::set<std::vector<std::size_t>> found;
    std::set<std::vector<std::size_t>> expected;
    for (const LineChain& chain : chains) {
      for (const PredictedPoint& p : chain) EXPECT_EQ(name_of(p), name_of(chain.front()));
      found.insert(order_of(chain));
      longest = std::max(longest, chain.size());
    }
    for (const LineChain& way : shortest_ways(points)) expected.insert(order_of(way));
    EXPECT_EQ(found, expected) << scene;
    EXPECT_TRUE(std::is_sorted(chains.begin(), chains.end(), [](const auto& a, const auto& b) {
      return rank_of(a.front()) < rank_of(b.front());
    }));
  }
  EXPECT_GE(longest, 6U);
}

TEST(ChainPoints, HoldEveryPointOfAnyCloudOnceAndLinkOnlyNeighbours) {
  Random random(2);
  for (int scene = 0; scene < 20; ++scene) {
    std::vector<PredictedPoint> points(60);
    for (std::size_t i = 0; i < points.size(); ++i) {
      PredictedPoint& p = points[i];
      p.line = static_cast<int>(random.below(2));
      p.position = {static_cast<float>(random.uniform(0, 12)),
                    static_cast<float>(random.uniform(0, 12))};
      const auto angle = static_cast<float>(random.uniform(0, 6.28));
      p.normal = {std::cos(angle), std::sin(angle)};
      p.patch = i;
    }
    std::vector<int> times(points.size(), 0);
    for (const LineChain& chain : chain_points(points)) {
      for (std::size_t i = 0; i < chain.size(); ++i) {
        ++times[chain[i].patch];
        if (i == 0) continue;
        EXPECT_EQ(chain[i].line, chain[0].line);
        EXPECT_LE(gap(chain[i - 1], chain[i]), kFarthestLink);
      }
    }
    EXPECT_EQ(times, std::vector<int>(points.size(), 1));
  }
}

}  // namespace
}  // namespace pencilscan
