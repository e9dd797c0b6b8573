#include "pencilscan/labeling/labeling.h"

#include <gtest/gtest.h>

#include <array>

namespace pencilscan {
namespace {

TEST(Undecided, APointHasOneReason) {
  using enum UndecidedReason;
  std::vector<UndecidedRun> undecided = {{0, 0, 10, kAmbiguous},
                                         {0, 10, 20, kNoCrossing},
                                         {0, 20, 30, kAmbiguous},
                                         {1, 0, 30, kAmbiguous}};
  add_undecided({0, 8, 22, kContradicted}, undecided);
  add_undecided({1, 10, 20, kContradicted}, undecided);
  const auto points = undecided_points(undecided, {});
  EXPECT_EQ(points[static_cast<std::size_t>(kAmbiguous)], 8U + 8U + 20U);
  EXPECT_EQ(points[static_cast<std::size_t>(kNoCrossing)], 0U);
  EXPECT_EQ(points[static_cast<std::size_t>(kContradicted)], 14U + 10U);
  for (const UndecidedRun& run : undecided) EXPECT_LT(run.begin, run.end);
}

}  // namespace
}  // namespace pencilscan
