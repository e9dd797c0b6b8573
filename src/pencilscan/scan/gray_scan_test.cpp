#include "pencilscan/scan/gray_scan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "pencilscan/core/random.h"
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

/// What small_rig() decodes of the plane through the origin across the camera's axis, with noise
/// in the places where rows, and where columns, change; camera px.
DecodedView decoded_plane(const Rig& rig, const Vec2& noise_px) {
  const Camera& camera = rig.cameras[0];
  const Vec3 normal = camera.center().normalized();
  const auto panel = [&](int u, int v) {
    const Ray ray = camera.ray(Vec2(u, v));
    const double depth = -ray.origin.dot(normal) / ray.direction.dot(normal);
    return *rig.projectors[0].project(ray.origin + depth * ray.direction);
  };
  Random random(5);
  DecodedView view;
  view.state.create(128, 128);
  view.state.setTo(static_cast<std::uint8_t>(PixelState::kValid));
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto k = static_cast<Eigen::Index>(axis);
    view.code[axis].create(128, 128);
    for (std::size_t direction = 0; direction < 2; ++direction) {
      auto& crossing = view.crossing[axis][direction];
      crossing.create(128, 128);
      for (int v = 0; v < 128; ++v) {
        for (int u = 0; u < 128; ++u) {
          const double here = panel(u, v)[k];
          const double next = direction == 0 ? panel(u + 1, v)[k] : panel(u, v + 1)[k];
          view.code[axis](v, u) = static_cast<int>(std::lround(here));
          const double edge = std::floor(std::max(here, next) - 0.5) + 0.5;
          const double at = (edge - here) / (next - here) + noise_px[k] * random.normal();
          const bool changes = std::lround(here) != std::lround(next) && at >= 0 && at <= 1;
          crossing(v, u) = changes ? cv::Vec2f(static_cast<float>(at), static_cast<float>(edge))
                                   : cv::Vec2f(-1, -1);
        }
      }
    }
  }
  return view;
}

TEST(GrayScan, SigmaIsWhatTheCoordinateAlongTheEpipolarLineMakes) {
  Rig rig = small_rig();
  // The baseline lies across the columns: rows say nothing of depth.
  rig.projectors[0].device_from_world = look_at({760, 280, 0}, Vec3::Zero());
  const auto median_sigma = [&](const Vec2& noise_px) {
    std::vector<double> sigmas;
    for (const SurfaceSample& sample : gray_scan(rig, 0, 0, decoded_plane(rig, noise_px)).samples)
      sigmas.push_back(sample.sigma);
    EXPECT_GT(sigmas.size(), 1000U);
    std::nth_element(sigmas.begin(), sigmas.begin() + std::ssize(sigmas) / 2, sigmas.end());
    return sigmas[sigmas.size() / 2];
  };
  const double exact = median_sigma({0, 0});
  EXPECT_NEAR(median_sigma({0, 0.15}), exact, 0.02 * exact);
  EXPECT_GT(median_sigma({0.15, 0}), 1.5 * exact);
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
