// What runs on several threads, once, for the thread sanitizer: a program of its own, so that
// preset tsan builds no other test's code.
#include <gtest/gtest.h>

#include "pencilscan/core/parallel.h"
#include "pencilscan/pipeline/sample_frame.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

TEST(Races, NoneWhilePointsAreMeasured) {
  const Rig rig = sample::small_rig(480, 360, 110);
  const SimulatedObject ball(make_sphere(95, 48));
  PhotographyOptions photo;
  photo.render.samples = 1;
  const Frame frame = sample::photographed_frame(rig, ball, photo);
  const ThreadLimit limit(4);
  EXPECT_FALSE(sample::labelled_points(rig, frame).points.empty());
}

}  // namespace
}  // namespace pencilscan
