#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <span>
#include <vector>

#include "pencilscan/core/disjoint_sets.h"
#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/random.h"
#include "pencilscan/core/tally.h"

namespace pencilscan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(DisjointSets, AreThoseOfASearchThroughTheLinks) {
  constexpr int kElements = 60;
  Random rng(7);
  for (int links = 0; links < 60; links += 5) {
    DisjointSets sets(kElements);
    std::vector<std::set<int>> neighbors(kElements);
    for (int k = 0; k < links; ++k) {
      const int a = static_cast<int>(rng.uniform() * kElements);
      const int b = static_cast<int>(rng.uniform() * kElements);
      sets.join(a, b);
      neighbors[static_cast<std::size_t>(a)].insert(b);
      neighbors[static_cast<std::size_t>(b)].insert(a);
    }
    for (int start = 0; start < kElements; ++start) {
      std::set<int> reached = {start};
      std::vector<int> waiting = {start};
      while (!waiting.empty()) {
        const int at = waiting.back();
        waiting.pop_back();
        for (const int next : neighbors[static_cast<std::size_t>(at)])
          if (reached.insert(next).second) waiting.push_back(next);
      }
      EXPECT_EQ(sets.root(start), *reached.begin());
    }
  }
}

struct Vote {
  int group = 0;
  float weight = 0;
};

TEST(EvenlyPicked, IsInOrderEvenAndNeverMoreThanThereAre) {
  const std::vector<int> values{0, 1, 2, 3, 4, 5, 6};
  EXPECT_THAT(evenly_picked(values, 3), ElementsAre(0, 2, 4));
  EXPECT_EQ(evenly_picked(values, 7), values);
  EXPECT_EQ(evenly_picked(std::span(values), 9), values);
  EXPECT_THAT(evenly_picked(values, 0), IsEmpty());
  EXPECT_THAT(evenly_picked(std::vector<int>{}, 3), IsEmpty());
}

TEST(Tally, IsTheSumOfTheStrongestOfEachGroup) {
  Random rng(3);
  std::vector<Vote> votes;
  std::map<int, float> strongest;
  for (int k = 0; k < 40; ++k) {
    votes.push_back({k / 7, static_cast<float>(static_cast<int>(rng.uniform() * 64))});
    float& best = strongest[votes.back().group];
    best = std::max(best, votes.back().weight);
  }
  float sum = 0;
  for (const auto& [group, best] : strongest) sum += best;
  const auto weight = [](const Vote& vote) { return vote.weight; };
  EXPECT_EQ(tally(votes, weight), sum);
  EXPECT_EQ(tally(std::vector<Vote>{}, weight), 0.F);
}

}  // namespace
}  // namespace pencilscan
