#include "pencilscan/simulation/light_transport.h"

#include <gtest/gtest.h>

#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/pattern/gray_code.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

/// Two cameras and two projectors before a ball, that mix colours differently.
class LivePictures : public ::testing::Test {
 protected:
  LivePictures() : rig_(sample::small_rig(240, 180, 110)), ball_(make_sphere(60, 60)) {
    rig_.cameras[0].K(0, 0) = rig_.cameras[0].K(1, 1) = 450;
    rig_.cameras[0].distortion = {-0.1, 0.05, 0.001, 0, 0};
    Mat3 mix;
    mix << 0.9, 0.1, 0, 0.05, 0.9, 0.05, 0, 0.2, 0.8;
    rig_.cameras[0].color_matrix_by_projector["proj1"] = mix;
    options_.ambient = 0.02;
    options_.samples = 2;
  }

  [[nodiscard]] static cv::Mat bytes(const cv::Mat& gray) {
    cv::Mat rgb;
    cv::merge(std::vector<cv::Mat>(3, gray), rgb);
    return rgb;
  }

  Rig rig_;
  SimulatedObject ball_;
  RenderOptions options_;
};

TEST_F(LivePictures, AreThoseOfTheRendererForGrayCodes) {
  FilmOptions film;
  film.pixelated = true;
  film.black_level = 0.01;
  const LightTransport transport(rig_, 0, ball_, options_);
  for (const std::size_t i : {std::size_t{0}, std::size_t{7}, std::size_t{20}, std::size_t{39}}) {
    std::vector<PanelLight> lights;
    std::vector<PanelPicture> panels;
    for (const Projector& projector : rig_.projectors) {
      const auto sequence = gray_code_sequence(projector.width, projector.height);
      lights.push_back(gray_code_light(projector, sequence[i], film));
      panels.push_back({bytes(render_gray_code(sequence[i], projector.width, projector.height)),
                        Vec3::Ones(), film.black_level});
    }
    const cv::Mat expected = render_camera(rig_, 0, ball_, lights, options_);
    const cv::Mat live = transport.render(panels);
    EXPECT_GT(cv::mean(expected)[1], 0.01) << i;
    EXPECT_LT(cv::norm(live, expected, cv::NORM_INF), 1e-5) << i;
  }
}

TEST_F(LivePictures, AreThoseOfTheRendererForLines) {
  FilmOptions film;
  film.pixelated = true;
  std::vector<PanelPicture> panels;
  for (const Projector& projector : rig_.projectors) {
    cv::Mat panel;
    render_patterns(projector.patterns, projector.width, projector.height)
        .convertTo(panel, CV_8U, 255);
    panels.push_back({panel, Vec3::Ones(), 0});
  }
  const auto lights = line_lights(rig_, film);
  for (std::size_t c = 0; c < 2; ++c) {
    const cv::Mat expected = render_camera(rig_, c, ball_, lights, options_);
    const cv::Mat live = LightTransport(rig_, c, ball_, options_).render(panels);
    EXPECT_GT(cv::mean(expected)[2], 0.005);
    EXPECT_LT(cv::norm(live, expected, cv::NORM_INF), 0.5 / 255 + 1e-5);  // panels have 8 bits
  }
}

TEST_F(LivePictures, GainsScaleEachColour) {
  options_.ambient = 0;
  const LightTransport transport(rig_, 1, ball_, options_);
  const cv::Mat white(512, 640, CV_8UC3, cv::Scalar::all(255));
  const cv::Mat plain = transport.render(std::vector<PanelPicture>{{white, Vec3::Ones(), 0}, {}});
  const cv::Mat half = transport.render(std::vector<PanelPicture>{{white, Vec3(0.5, 1, 0), 0}, {}});
  const cv::Scalar a = cv::mean(plain);
  const cv::Scalar b = cv::mean(half);
  EXPECT_NEAR(b[0], 0.5 * a[0], 1e-6);
  EXPECT_NEAR(b[1], a[1], 1e-6);
  EXPECT_EQ(b[2], 0);
  EXPECT_EQ(cv::mean(transport.render(std::vector<PanelPicture>(2))), cv::Scalar());
}

TEST_F(LivePictures, AreTheSameBytesForAnyThreadCount) {
  const auto render = [&](int threads) {
    const ThreadLimit limit(threads);
    std::vector<PanelPicture> panels(2);
    panels[0].light = cv::Mat(512, 640, CV_8UC3, cv::Scalar(9, 80, 200));
    return LightTransport(rig_, 0, ball_, options_).render(panels);
  };
  EXPECT_EQ(cv::norm(render(1), render(4), cv::NORM_INF), 0);
}

TEST_F(LivePictures, RefuseRegisteredColours) {
  rig_.cameras[0].color_registration.colors[0].shift_px = {1, 0};
  EXPECT_THROW(LightTransport(rig_, 0, ball_, options_), InputError);
}

}  // namespace
}  // namespace pencilscan
