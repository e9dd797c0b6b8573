#include "pencilscan/pipeline/surface_chain.h"

#include <gtest/gtest.h>

#include <numeric>

#include "pencilscan/io/file.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/tracking/tracked_surface.h"

namespace pencilscan {
namespace {

TEST(SurfaceChain, ASurfaceIsLetGoOnceTheNextFrameIsMade) {
  const TemporaryFolder out("SurfaceChain");
  constexpr std::size_t kFrames = 6;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < kFrames; ++i) names.push_back("00000" + std::to_string(i));
  std::vector<std::size_t> own(kFrames);
  std::iota(own.begin(), own.end(), 0);
  SurfaceChain chain(out.path(), names, names, own, std::vector<char>(kFrames, 0));
  ASSERT_EQ(chain.steps().size(), kFrames);
  std::weak_ptr<const TrackedSurface> before;
  for (std::size_t step = 0; step < kFrames; ++step) {
    const FrameLinks links = chain.linked({}, step);
    EXPECT_EQ(links.before(), before.lock()) << step;
    auto made = std::make_shared<const TrackedSurface>();
    const std::weak_ptr<const TrackedSurface> handed_on = made;
    links.hand_on(std::move(made));
    chain.end(step, false);
    EXPECT_TRUE(before.expired()) << step;
    before = handed_on;
  }
  EXPECT_TRUE(before.expired()) << "nothing comes after the last frame";
}

TEST(SurfaceChain, GoesOnWhereItsFilesCannotBeWritten) {
  const TemporaryFolder out("SurfaceChainOnAFullDisk");
  write_text(out.path() / ".surfaces", "in the way of the folder");
  const std::vector<std::string> names = {"000000", "000001", "000002"};
  SurfaceChain chain(out.path(), names, names, {0, 1, 2}, {0, 0, 0});
  const auto made = std::make_shared<const TrackedSurface>();
  chain.linked({}, 0).hand_on(made);
  chain.end(0, false);
  chain.end(1, false);  // failed: what it got goes on
  EXPECT_EQ(chain.linked({}, 2).before(), made);
  chain.end(2, false);
}

TEST(SurfaceChain, WhatFollowsABrokenFrameIsToldSoWhateverItDoes) {
  const TemporaryFolder out("SurfaceChainBroken");
  const std::vector<std::string> names = {"000000", "000001", "000002"};
  SurfaceChain chain(out.path(), names, names, {0, 1, 2}, {0, 0, 0});
  chain.end(0, true);
  chain.end(1, false);
  EXPECT_THROW((void)chain.linked({}, 2).before(), ChainBroken);
  chain.end(2, false);
}

}  // namespace
}  // namespace pencilscan
