#include "pencilscan/pipeline/depth_output.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// One camera of 16 x 8 px and focal length 900 px.
Rig one_camera() {
  Rig rig;
  rig.cameras = {sample::device_at<Camera>({560, 0, 0}, "cam0", 16, 8, 900)};
  return rig;
}

/// Depth of that camera: `near` in the left half, `far` in the right one.
ShapeResult shape_of(float near, float far) {
  DepthMap map;
  map.columns = 4;
  map.rows = 2;
  for (int i = 0; i < 8; ++i) {
    DepthNode& node = map.nodes.emplace_back();
    node.w = 1 / (i % 4 < 2 ? near : far);
    node.reason = HoleReason::kMeasured;
  }
  ShapeResult shape;
  shape.depth.maps = {map};
  return shape;
}

class DepthMapFiles : public ::testing::Test {
 protected:
  std::vector<std::string> write(float near, float far, const Rig& rig = one_camera()) {
    auto warnings = write_depth_maps(folder_, rig, shape_of(near, far));
    png_ = read_stored_image(folder_ / "depth" / "cam0.png");
    return warnings;
  }
  [[nodiscard]] int png_at(int u) const { return png_.at<std::uint16_t>(0, u); }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  fs::path folder_ = temporary_.path();
  cv::Mat png_;
};

TEST_F(DepthMapFiles, ThePngCountsTenthsOfAMillimetre) {
  EXPECT_THAT(write(512.5F, 6400), IsEmpty());
  EXPECT_EQ(png_at(0), 5125);
  EXPECT_EQ(png_at(15), 64000);
}

TEST_F(DepthMapFiles, DepthsBeyondThePngAreTold) {
  EXPECT_THAT(write(512, 8000),
              ElementsAre(HasSubstr("depth/cam0.png holds 0 (none) in place of")));
  EXPECT_GT(png_at(0), 0);
  EXPECT_EQ(png_at(15), 0);
  EXPECT_THAT(write(8000, 8100),
              ElementsAre(HasSubstr("100 % of the depths, which reach 8100 mm")));
}

TEST_F(DepthMapFiles, StepsThatAreCoarseForTheRigAreTold) {
  Rig rig = one_camera();
  rig.unit_known = false;
  EXPECT_THAT(write(0.5F, 0.6F, rig),  // metres
              ElementsAre(HasSubstr("depth/cam0.png is coarse: its steps are 0.1 units")));
  EXPECT_THAT(write(50, 60, rig), IsEmpty());
}

}  // namespace
}  // namespace pencilscan
