// The worked examples of docs/extending.md: they compile, work, and stand in the page as they are.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <regex>
#include <string>

#include "extending/division_lens.h"
#include "extending/nearest_line.h"
#include "pencilscan/exchange/exchanged_device.h"
#include "pencilscan/io/file.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/rig/sample_devices.h"
#include "pencilscan/simulation/panel_light.h"
#include "pencilscan/simulation/render.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {
namespace {

TEST(Extending, ANewSolutionMethodNamesLines) {
  constexpr double kRadius = 95;
  const Rig rig = sample::small_rig(480, 360, 110);
  const SimulatedObject object(make_sphere(kRadius, 48));
  const auto lights = line_lights(rig);
  Frame frame;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c)
    frame.images.push_back(cv::min(render_camera(rig, c, object, lights), 1.0));
  PointOptions options;
  options.method = example::kNearestLine.defaults;
  const PointResult found = detect_frame(rig, frame, options);
  const Labeling labeling =
      example::kNearestLine.solve(rig, found.families, found.graphs, options.method);
  const auto points = triangulate(rig, found.graphs, labeling, {});
  std::size_t right = 0;
  for (const MeasuredPoint& p : points)
    right += std::abs(Vec3(p.x, p.y, p.z).norm() - kRadius) < 1 ? 1 : 0;
  EXPECT_GT(points.size(), 2000U);
  EXPECT_GT(static_cast<double>(right), 0.8 * static_cast<double>(points.size()));
}

TEST(Extending, AForeignCameraModelIsImported) {
  constexpr double kLambda = -0.12;
  ExchangedDevice camera;
  camera.device = sample::small_rig(640, 480, 100).cameras[0];
  camera.given = {true, true, true};
  camera.lens = example::division_lens(kLambda);
  ExchangedRig file;
  file.devices.push_back(camera);
  const Rig rig = join_rig(file, {}).rig;
  ASSERT_EQ(rig.cameras.size(), 1U);
  const Vec2 straight(0.15, -0.1);
  const Vec2 shown = example::division_lens(kLambda)(straight);
  EXPECT_NEAR((shown / (1 + kLambda * shown.squaredNorm()) - straight).norm(), 0, 1e-12);
  const Vec2 miss = distort(rig.cameras[0].distortion, straight) - shown;
  EXPECT_LT(rig.cameras[0].K(0, 0) * miss.norm(), 0.1);
}

TEST(Extending, ThePageShowsWhatIsCompiled) {
  const std::string root = PENCILSCAN_SOURCE_DIR;
  const std::string page = read_file(root + "/docs/extending.md");
  std::string code;
  for (const char* file : {"nearest_line.cpp", "division_lens.cpp", "extending_test.cpp"})
    code += read_file(root + "/tests/extending/" + file);
  const std::regex block("```cpp\n([^`]*)```");
  std::size_t blocks = 0;
  for (auto at = std::sregex_iterator(page.begin(), page.end(), block);
       at != std::sregex_iterator(); ++at, ++blocks)
    EXPECT_NE(code.find((*at)[1].str()), std::string::npos) << (*at)[1].str();
  EXPECT_GE(blocks, 4U);
}

}  // namespace
}  // namespace pencilscan
