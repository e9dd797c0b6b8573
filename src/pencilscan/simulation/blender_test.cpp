#include "pencilscan/simulation/blender.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/simulation/other_renderers_fixture.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

class BlenderScene : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("pencilscan_blender_" + std::to_string(::getpid()));
    fs::remove_all(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path folder_;
};

TEST_F(BlenderScene, BlenderRendersTheSamePicture) {
  if (std::system("command -v blender > /dev/null 2>&1") != 0) GTEST_SKIP() << "no blender here";
  const Rig rig = two_projectors();
  const SimulatedObject object = ball_and_board();
  for (const bool falls_off : {true, false}) {
    SCOPED_TRACE(falls_off ? "light falls off" : "light does not fall off");
    RenderOptions options;
    options.inverse_square = falls_off;
    const fs::path folder = folder_ / (falls_off ? "square" : "even");
    write_blender_scene(folder, rig, object.surface(), {}, options);
    write_blender_object(folder, "000000", object);
    nlohmann::json scene = nlohmann::json::parse(read_file(folder / "scene.json"));
    scene["samples"] = 64;
    scene["bounces"] = 0;
    write_json(folder / "scene.json", scene);
    const std::string command =
        "cd '" + folder.string() + "' && blender -b -P render.py > log.txt 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0);
    const cv::Mat theirs = read_image(folder / "light" / "000000" / "cam0.png");
    const cv::Mat ours = cv::min(render_camera(rig, 0, object, line_lights(rig), options), 1.0);
    ASSERT_EQ(theirs.size(), ours.size());
    // All light per channel, then where it lies: paths are random, means over 5 x 5 pixels hardly.
    const cv::Scalar sum_ours = cv::mean(ours);
    const cv::Scalar sum_theirs = cv::mean(theirs);
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(sum_theirs[k] / sum_ours[k], 1, 0.003) << "channel " << k;
    }
    cv::Mat difference = theirs - ours;
    cv::blur(difference, difference, cv::Size(5, 5));
    EXPECT_LT(cv::norm(difference), 0.02 * cv::norm(ours));
  }
}

TEST_F(BlenderScene, BlenderLightsNoBackground) {
  if (std::system("command -v blender > /dev/null 2>&1") != 0) GTEST_SKIP() << "no blender here";
  const Rig rig = two_projectors();
  const SimulatedObject ball(make_sphere(40, 24));  // no part of it keeps light from another
  RenderOptions options;
  options.ambient = 0.1;
  write_blender_scene(folder_, rig, ball.surface(), {}, options);
  write_blender_object(folder_, "000000", ball);
  nlohmann::json scene = nlohmann::json::parse(read_file(folder_ / "scene.json"));
  scene["samples"] = 64;
  scene["bounces"] = 0;
  write_json(folder_ / "scene.json", scene);
  const std::string command =
      "cd '" + folder_.string() + "' && blender -b -P render.py > log.txt 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const cv::Mat theirs = read_image(folder_ / "light" / "000000" / "cam0.png");
  const cv::Mat ours = cv::min(render_camera(rig, 0, ball, line_lights(rig), options), 1.0);
  EXPECT_EQ(theirs.at<cv::Vec3f>(0, 0), cv::Vec3f(0, 0, 0));
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR(cv::mean(theirs)[k] / cv::mean(ours)[k], 1, 0.01) << "channel " << k;
}

TEST_F(BlenderScene, RefusesWhatBlenderLacks) {
  Rig rig = two_projectors();
  EXPECT_NO_THROW(check_blender_can_show(rig, {}, "rig.json"));
  Reflectance striped;
  striped.texture = {TextureKind::kStripes, 0.5, 60};
  EXPECT_THROW(check_blender_can_show(rig, striped, "rig.json"), InputError);
  rig.cameras[0].distortion[0] = 0.1;
  EXPECT_THROW(check_blender_can_show(rig, {}, "rig.json"), InputError);
}

}  // namespace
}  // namespace pencilscan
