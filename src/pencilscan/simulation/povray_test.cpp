#include "pencilscan/simulation/povray.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/io/image.h"
#include "pencilscan/simulation/other_renderers_fixture.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

TEST(WritePovrayScene, PovrayRendersTheSamePicture) {
  if (std::system("command -v povray > /dev/null 2>&1") != 0) GTEST_SKIP() << "no povray here";
  const fs::path folder =
      fs::temp_directory_path() / ("pencilscan_povray_" + std::to_string(::getpid()));
  const Rig rig = two_projectors();
  Reflectance surface;
  surface.specular = 0.2;
  surface.texture = {TextureKind::kStripes, 0.5, 60};
  const SimulatedObject object = ball_and_board(surface);
  RenderOptions options;
  options.ambient = 0.05;
  write_povray_scene(folder, rig, object, options);
  const std::string command = "cd '" + folder.string() + "' && povray cam0.ini > log.txt 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << "see " << folder;
  const cv::Mat theirs = read_image(folder / "cam0.png");
  const cv::Mat ours = cv::min(render_camera(rig, 0, object, line_lights(rig), options), 1.0);
  ASSERT_EQ(theirs.size(), ours.size());
  // All light per channel, then where it lies: POV-Ray takes 3 x 3 points a pixel, we integrate
  // lines, so single pixels at edges differ and means over 5 x 5 pixels hardly.
  const cv::Scalar sum_ours = cv::mean(ours);
  const cv::Scalar sum_theirs = cv::mean(theirs);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(sum_theirs[k] / sum_ours[k], 1, 0.01) << "channel " << k;
  cv::Mat difference = theirs - ours;
  cv::blur(difference, difference, cv::Size(5, 5));
  const double rms = cv::norm(difference) / std::sqrt(3.0 * 200 * 150);
  EXPECT_LT(rms, 0.02 * cv::norm(ours) / std::sqrt(3.0 * 200 * 150));
  fs::remove_all(folder);
}

TEST(CheckPovrayCanShow, RefusesWhatPovrayLacks) {
  Rig rig = two_projectors();
  EXPECT_NO_THROW(check_povray_can_show(rig, {}, "rig.json"));
  rig.cameras[0].distortion[0] = 0.1;
  EXPECT_THROW(check_povray_can_show(rig, {}, "rig.json"), InputError);
}

}  // namespace
}  // namespace pencilscan
