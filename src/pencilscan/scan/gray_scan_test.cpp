#include "pencilscan/scan/gray_scan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "pencilscan/simulation/render.h"

namespace pencilscan {
namespace {

constexpr double kRadius = 60;

Rig small_rig() {
  Rig rig;
  rig.cameras.resize(1);
  rig.projectors.resize(1);
  const auto place = [](Device& device, const Vec3& eye) {
    device.width = device.height = 128;
    device.K << 700, 0, 63.5, 0, 700, 63.5, 0, 0, 1;
    device.device_from_world = look_at(eye, Vec3::Zero());
  };
  rig.cameras[0].name = "cam0";
  rig.projectors[0].name = "proj0";
  place(rig.cameras[0], {800, 0, 0});
  place(rig.projectors[0], {760, 280, 60});
  return rig;
}

TEST(GrayScan, MeasuresASphere) {
  const Rig rig = small_rig();
  const SimulatedObject object(make_sphere(kRadius, 96));
  std::vector<PanelLight> lights;
  for (const auto& image : gray_code_sequence(128, 128))
    lights.push_back(gray_code_light(rig.projectors[0], image));
  const auto images = render_sequence(rig, 0, 0, object, lights);
  ASSERT_FALSE(images.empty());
  const DecodedView decoded =
      decode_gray_stack(make_gray_stack(128, 128, true, [&](std::size_t i) { return images[i]; }));
  const GrayScan scan = gray_scan(rig, 0, 0, decoded);
  ASSERT_GT(scan.points.size(), 500U);
  EXPECT_LT(scan.missed, scan.points.size() / 20);
  std::vector<double> errors;
  std::vector<double> angles;
  for (const SurfaceSample& sample : scan.samples) {
    errors.push_back(std::abs(sample.position.norm() - kRadius));
    angles.push_back(sample.normal.dot(sample.position.normalized()));
  }
  const auto middle = errors.begin() + std::ptrdiff_t(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  EXPECT_LT(*middle, 0.1);  // a panel pixel is 3 mm of depth here
  std::sort(angles.begin(), angles.end());
  EXPECT_GT(angles[angles.size() / 10], 0.97);  // outward
}

TEST(MisfitWarning, PairsOfWhichManyCodesFitNoPointAreNamed) {
  const std::vector<PairYield> right{{"proj0/cam0", 950, 50}, {"proj0/cam1", 5, 20}};
  EXPECT_FALSE(misfit_warning(right));  // wrong codes at edges; too few to tell
  std::vector<PairYield> wrong = right;
  wrong.push_back({"proj1/cam1", 200, 800});
  const auto warning = misfit_warning(wrong);
  ASSERT_TRUE(warning);
  EXPECT_THAT(*warning, testing::StartsWith("80 % of the codes of proj1/cam1 fit no point"));
}

}  // namespace
}  // namespace pencilscan
