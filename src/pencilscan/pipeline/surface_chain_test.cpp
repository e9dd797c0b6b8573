#include "pencilscan/pipeline/surface_chain.h"

#include <gtest/gtest.h>

#include <numeric>

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

}  // namespace
}  // namespace pencilscan
