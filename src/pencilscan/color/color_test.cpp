#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "pencilscan/color/color_calibration.h"
#include "pencilscan/color/color_json.h"
#include "pencilscan/color/color_response.h"
#include "pencilscan/color/lateral_color.h"
#include "pencilscan/core/random.h"
#include "pencilscan/pattern/solid_color.h"
#include "pencilscan/rig/sample_ring.h"

namespace pencilscan {
namespace {

constexpr int kSide = 160;

/// Images of a pattern whose edges pass through many pixels, stored with a gamma, noise and 8 bit.
struct GammaScene {
  double gamma = 1;
  double noise = 0.004;       ///< of stored values
  double noise_of_light = 0;  ///< as sensors have it, before gamma
  double flicker = 1;         ///< of the lamp in the inverse's image
};

struct GammaImages {
  cv::Mat white, black;
  std::vector<std::pair<cv::Mat, cv::Mat>> patterns;
};

GammaImages gamma_images(const GammaScene& scene) {
  Random random(3);
  GammaImages images;
  const auto draw = [&](auto share, double lamp) {
    cv::Mat image(kSide, kSide, CV_32F);
    for (int v = 0; v < kSide; ++v) {
      for (int u = 0; u < kSide; ++u) {
        const double albedo = 0.5 + 0.3 * std::sin(0.05 * u) * std::cos(0.07 * v);
        const double light = std::max(
            0.0, 0.02 + lamp * albedo * share(u, v) + random.normal(0, scene.noise_of_light));
        const double value = std::pow(light, 1 / scene.gamma) + random.normal(0, scene.noise);
        image.at<float>(v, u) = static_cast<float>(std::round(255 * value) / 255);
      }
    }
    return image;
  };
  const auto stripes = [](int u, int v) {
    return 0.5 + 0.5 * std::clamp(3 * std::sin(0.5 * u + 0.03 * v), -1.0, 1.0);
  };
  images.white = draw([](int, int) { return 1.0; }, 1);
  images.black = draw([](int, int) { return 0.0; }, 1);
  images.patterns.emplace_back(
      draw(stripes, 1), draw([&](int u, int v) { return 1 - stripes(u, v); }, scene.flicker));
  return images;
}

TEST(CameraGamma, IsFoundWhereAPatternAndItsInverseShareAPixel) {
  for (const GammaScene& scene :
       {GammaScene{}, GammaScene{.gamma = 2.2}, GammaScene{.gamma = 1.8, .flicker = 1.03},
        GammaScene{.gamma = 0.7}}) {
    const GammaImages images = gamma_images(scene);
    const auto found = camera_gamma(images.white, images.black, images.patterns);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->value, scene.gamma, 0.02 * scene.gamma);  // 8 bit and noise of one level
    EXPECT_LT(found->sigma, 0.02);
  }
}

/// A gamma spreads the noise of the dark over a tenth of the range: pixels that are dark by chance
/// must not be taken for those that an image leaves unlit.
TEST(CameraGamma, NoiseInTheDarkIsNoFlicker) {
  for (const double lamp : {1.0, 1.03}) {
    const GammaImages images =
        gamma_images({.gamma = 2.2, .noise = 0, .noise_of_light = 0.008, .flicker = lamp});
    const auto found = camera_gamma(images.white, images.black, images.patterns);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->value, 2.2, 2 * found->sigma) << lamp;
  }
}

TEST(CameraGamma, NeedsLitPixels) {
  GammaImages images = gamma_images({});
  images.white = images.black.clone();
  EXPECT_FALSE(camera_gamma(images.white, images.black, images.patterns));
}

/// Solid images of a coloured surface; the projector's response is value^projector_gamma.
std::map<std::string, cv::Mat> solid_views(const Mat3& matrix, double projector_gamma,
                                           cv::Mat& white, cv::Mat& black) {
  Random random(5);
  const Vec3 surface(0.9, 0.5, 0.3);
  const auto draw = [&](const Rgb& value) {
    cv::Mat image(kSide, kSide, CV_32FC3);
    Vec3 light;
    for (std::size_t k = 0; k < 3; ++k)
      light[static_cast<Eigen::Index>(k)] = 0.004 + std::pow(value[k], projector_gamma);
    for (int v = 0; v < kSide; ++v) {
      for (int u = 0; u < kSide; ++u) {
        const double shading = 0.3 + 0.5 * std::exp(-1e-4 * (u * u + v * v));
        const Vec3 seen = shading * surface.cwiseProduct(matrix * light) + Vec3::Constant(0.01);
        for (int c = 0; c < 3; ++c)
          image.at<cv::Vec3f>(v, u)[c] = static_cast<float>(seen[c] + random.normal(0, 0.003));
      }
    }
    return image;
  };
  white = draw({1, 1, 1});
  black = draw({0, 0, 0});
  std::map<std::string, cv::Mat> solids;
  for (const SolidImage& image : solid_images()) solids[image.name] = draw(image.value);
  return solids;
}

Mat3 leaky() {
  Mat3 matrix;
  matrix << 0.90, 0.08, 0.02,  //
      0.05, 0.88, 0.07,        //
      0.01, 0.11, 0.88;
  return matrix;
}

TEST(ColorResponse, MatrixIsThatOfTheDevicesNotOfTheSurface) {
  cv::Mat white, black;
  const auto solids = solid_views(leaky(), 2.2, white, black);
  const auto response = color_response(white, black, solids);
  ASSERT_TRUE(response);
  EXPECT_LT((response->matrix - leaky()).cwiseAbs().maxCoeff(), 0.003);
  EXPECT_LT(response->matrix_sigma.maxCoeff(), 0.003);
  ASSERT_TRUE(response->projector_gamma);
  EXPECT_NEAR(response->projector_gamma->value, 2.2, 0.1);  // by three levels, black level between
}

TEST(ColorResponse, NeedsAllThreeColours) {
  cv::Mat white, black;
  auto solids = solid_views(leaky(), 1, white, black);
  solids.erase("blue");
  EXPECT_FALSE(color_response(white, black, solids));
}

/// Displacements of every device and colour, drawn; against all colours together.
std::vector<ColorRegistration> drawn_registrations(const Rig& rig) {
  Random random(11);
  std::vector<ColorRegistration> all(device_count(rig));
  for (ColorRegistration& registration : all) {
    auto& [red, green, blue] = registration.colors;
    red = {Vec2(random.normal(0, 0.4), random.normal(0, 0.4)), 1 + random.normal(0, 4e-4)};
    blue = {Vec2(-red.shift_px), 2 - red.scale};
  }
  return all;
}

/// Points of a ball as every camera sees them under every projector.
std::vector<ColorSample> samples_of(const Rig& rig, const std::vector<ColorRegistration>& truth,
                                    double noise_px) {
  Random random(13);
  std::vector<ColorSample> samples;
  const std::size_t cameras = rig.cameras.size();
  for (std::size_t c = 0; c < cameras; ++c) {
    for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
      for (int i = 0; i < 150; ++i) {
        const Vec3 n = Vec3(random.normal(), random.normal(), random.normal()).normalized();
        const Device& camera = rig.cameras[c];
        const Device& projector = rig.projectors[p];
        const Vec3 x = 90 * n;
        if (n.dot(camera.center() - x) < 0 || n.dot(projector.center() - x) < 0) continue;
        ColorSample s;
        s.camera = c;
        s.projector = p;
        s.camera_pixel = *camera.project(x);
        s.panel_pixel = *projector.project(x);
        if (!camera.contains(s.camera_pixel) || !projector.contains(s.panel_pixel)) continue;
        const auto panel_at = [&](const Vec2& pixel) {
          const Ray ray = camera.ray(pixel);  // meets the tangent plane
          const double t = n.dot(x - ray.origin) / n.dot(ray.direction);
          return *projector.project(ray.origin + t * ray.direction);
        };
        s.panel_per_camera.col(0) = panel_at(s.camera_pixel + Vec2(1, 0)) - s.panel_pixel;
        s.panel_per_camera.col(1) = panel_at(s.camera_pixel + Vec2(0, 1)) - s.panel_pixel;
        if (s.panel_per_camera.norm() > 4) continue;
        for (s.color = 0; s.color < 3; ++s.color) {
          const Vec2 seen_at = truth[c].from_color(s.color, camera, s.camera_pixel);
          s.offset_px =
              truth[cameras + p].of_color(s.color, projector, panel_at(seen_at)) - s.panel_pixel;
          s.offset_px += Vec2(random.normal(0, noise_px), random.normal(0, noise_px));
          s.sigma_px = Vec2::Constant(noise_px);
          samples.push_back(s);
        }
      }
    }
  }
  return samples;
}

TEST(LateralColor, DevicesOfARingAreToldApart) {
  const Rig rig = sample::ring(3, 3);
  const auto truth = drawn_registrations(rig);
  auto samples = samples_of(rig, truth, 0.03);
  ASSERT_GT(samples.size(), 600U);
  for (std::size_t i = 0; i < samples.size(); i += 20)
    samples[i].offset_px.x() += 2;  // wrong codes
  const LateralColor found = estimate_lateral_color(rig, samples);
  double squares = 0;
  double count = 0;
  for (std::size_t d = 0; d < truth.size(); ++d) {
    for (std::size_t k = 0; k < 3; ++k) {
      const ColorDisplacementEstimate& e = found.devices[d][k];
      const Vec2 error = e.value.shift_px - truth[d].colors[k].shift_px;
      EXPECT_LT(error.norm(), 0.05) << d << " " << k;
      EXPECT_NEAR(e.value.scale, truth[d].colors[k].scale, 2e-4);
      EXPECT_TRUE(e.is_determined);
      squares += error.cwiseQuotient(e.shift_sigma_px).squaredNorm();
      count += 2;
    }
  }
  // Deviations are right to a factor of two.
  EXPECT_GT(std::sqrt(squares / count), 0.5);
  EXPECT_LT(std::sqrt(squares / count), 2.0);
}

TEST(LateralColor, OfAParallelPairOnlyTheSumIsKnownAndThatIsSaid) {
  Rig rig = sample::ring(1, 1);
  std::vector<ColorSample> samples;
  Random random(17);
  const Vec2 sum(0.5, -0.3);
  for (int i = 0; i < 400; ++i) {
    ColorSample s;
    s.color = 0;
    s.camera_pixel = s.panel_pixel = Vec2(random.uniform(0, 600), random.uniform(0, 400));
    s.panel_per_camera.setIdentity();
    s.offset_px = sum + Vec2(random.normal(0, 0.02), random.normal(0, 0.02));
    s.sigma_px = Vec2(0.02, 0.02);
    samples.push_back(s);
  }
  const LateralColor found = estimate_lateral_color(rig, samples);
  const ColorDisplacementEstimate& camera = found.devices[0][0];
  const ColorDisplacementEstimate& projector = found.devices[1][0];
  EXPECT_FALSE(camera.is_determined);
  EXPECT_FALSE(projector.is_determined);
  EXPECT_LT((projector.value.shift_px - camera.value.shift_px - sum).norm(), 0.02);
  EXPECT_NEAR(found.explained_rms_px, sum.norm(), 0.02);
}

/// A plane that a camera sees under Gray codes, its light displaced by `shift` camera px.
DecodedView decoded_plane(double shift) {
  constexpr int kPanel = 256;
  const auto sequence = gray_code_sequence(kPanel, kPanel);
  const auto image = [&](std::size_t number) {
    Random random(19, number);
    const GrayCodeImage& shown = sequence[number];
    cv::Mat result(kSide, kSide, CV_32F);
    const auto below = [](double x, double edge) {
      return 0.5 * std::erfc((x - edge) / 0.6 / M_SQRT2);
    };
    for (int v = 0; v < kSide; ++v) {
      for (int u = 0; u < kSide; ++u) {
        const Vec2 panel(20 + 0.9 * (u - shift) + 0.07 * v, 15 - 0.05 * (u - shift) + 0.8 * v);
        const double x = panel[shown.axis == Axis::kColumn ? 0 : 1];
        double light = shown.kind == GrayCodeImage::Kind::kWhite ? 1 : 0;
        if (shown.kind == GrayCodeImage::Kind::kBit)
          for (int i = static_cast<int>(x) - 5; i < static_cast<int>(x) + 7; ++i)
            if (i >= 0 && i < kPanel && shown.bright(i))
              light += below(x, i + 0.5) - below(x, i - 0.5);
        result.at<float>(v, u) = static_cast<float>(0.05 + 0.6 * light + random.normal(0, 0.004));
      }
    }
    return result;
  };
  return decode_gray_stack(make_gray_stack(kPanel, kPanel, true, image));
}

TEST(ColorSamples, OffsetsOfChannelsAreThoseOfTheirImages) {
  const DecodedView grey = decoded_plane(0);
  const std::array<DecodedView, 3> channels{decoded_plane(0.5), grey, decoded_plane(-0.5)};
  const auto samples = color_samples(0, 0, grey, channels);
  ASSERT_GT(samples.size(), 100U);
  std::array<std::vector<double>, 3> offsets;
  for (const ColorSample& s : samples) offsets[s.color].push_back(s.offset_px.x());
  for (std::size_t k = 0; k < 3; ++k) {
    ASSERT_FALSE(offsets[k].empty());
    std::nth_element(offsets[k].begin(), offsets[k].begin() + std::ptrdiff_t(offsets[k].size() / 2),
                     offsets[k].end());
    EXPECT_NEAR(offsets[k][offsets[k].size() / 2], -0.9 * 0.5 * (1.0 - static_cast<double>(k)),
                0.02);
  }
}

/// Whether captures of which nothing was decoded are grey nobody knows.
TEST(ColorCalibration, SaysNothingOfCapturesThatWereLeftOut) {
  const Rig rig = sample::ring(1, 2);
  EXPECT_TRUE(ColorCollector(rig).result().remarks.empty());
}

TEST(ColorCalibration, WritesWhatWasFoundAndFillsPairsWithoutSolids) {
  Rig rig = sample::ring(1, 2);
  ColorCalibration color;
  color.gamma = {MeasuredNumber{2.2, 0.01}};
  color.responses[{0, 0}] = {leaky(), Mat3::Constant(0.001), std::nullopt};
  color.lateral.devices.resize(3);
  color.lateral.devices[2][0].value.shift_px = Vec2(0.25, 0);
  set_colors(color, rig);
  EXPECT_EQ(rig.cameras[0].gamma, 2.2);
  EXPECT_EQ(rig.cameras[0].color_matrix_for(rig.projectors[1].name), leaky());
  EXPECT_TRUE(rig.projectors[1].color_registration.none());  // too little to matter
  color.displaces_lines = true;
  set_colors(color, rig);
  EXPECT_EQ(rig.projectors[1].color_registration.colors[0].shift_px, Vec2(0.25, 0));
  const nlohmann::json json = color_json(rig, color);
  EXPECT_EQ(json["responses"].size(), 1U);
  EXPECT_EQ(json["registration"]["devices"].size(), 3U);
}

}  // namespace
}  // namespace pencilscan
