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

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

/// A camera whose pixels are not square, its axis not in the middle; two projectors, one distorted.
Rig camera_and_projectors() {
  Rig rig;
  Camera camera;
  camera.name = "cam0";
  camera.width = 200;
  camera.height = 150;
  camera.K << 400, 0, 93, 0, 410, 80, 0, 0, 1;
  camera.device_from_world = look_at({900, 100, 300}, Vec3::Zero(), 0.2);
  rig.cameras.push_back(camera);
  for (const double side : {-1.0, 1.0}) {
    Projector projector;
    projector.name = side < 0 ? "proj0" : "proj1";
    projector.width = 320;
    projector.height = 240;
    projector.K << 640, 0, 150, 0, 640, 118, 0, 0, 1;
    projector.device_from_world = look_at({800, 500 * side, 250}, Vec3::Zero(), 0.3 * side);
    LinePattern pattern;
    pattern.pitch_px = 24;
    pattern.line_width_px = 9;
    if (side > 0) {
      pattern.axis = Axis::kRow;
      pattern.colors = {"red", "yellow"};
      projector.distortion = {0.4, 0, 0.01, -0.02, 0};
    }
    projector.patterns = {pattern};
    rig.projectors.push_back(projector);
  }
  rig.volume = Sphere{Vec3::Zero(), 120};
  return rig;
}

/// A ball in front of a board, so that shadows fall.
SimulatedObject ball_before_board() {
  TriangleMesh mesh = make_box({10, 500, 500}, {-80, 0, 0});
  const TriangleMesh ball = make_sphere(70, 40);
  const int base = static_cast<int>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), ball.vertices.begin(), ball.vertices.end());
  for (const auto& f : ball.faces) mesh.faces.push_back({f[0] + base, f[1] + base, f[2] + base});
  Reflectance surface;
  surface.smooth = false;
  return SimulatedObject(mesh, surface);
}

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
  const Rig rig = camera_and_projectors();
  const SimulatedObject object = ball_before_board();
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

TEST_F(BlenderScene, RefusesWhatBlenderLacks) {
  Rig rig = camera_and_projectors();
  EXPECT_NO_THROW(check_blender_can_show(rig, {}, "rig.json"));
  Reflectance striped;
  striped.texture = {TextureKind::kStripes, 0.5, 60};
  EXPECT_THROW(check_blender_can_show(rig, striped, "rig.json"), InputError);
  rig.cameras[0].distortion[0] = 0.1;
  EXPECT_THROW(check_blender_can_show(rig, {}, "rig.json"), InputError);
}

}  // namespace
}  // namespace pencilscan
