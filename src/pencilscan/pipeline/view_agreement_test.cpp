#include "pencilscan/pipeline/view_agreement.h"

#include <gtest/gtest.h>

#include "pencilscan/core/random.h"
#include "pencilscan/points/settle.h"
#include "pencilscan/rig/object_space.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

constexpr double kBallSeen = 60;

/// Points of a ball around `center` that the camera sees.
std::vector<MeasuredPoint> seen_points(const Camera& camera, const Vec3& center) {
  std::vector<MeasuredPoint> points;
  for (int i = 0; i < 120; ++i) {
    for (int k = 0; k < 240; ++k) {
      const double a = M_PI * (i + 0.5) / 120;
      const double b = 2 * M_PI * k / 240;
      const Vec3 normal(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
      const Vec3 x = center + kBallSeen * normal;
      if (normal.dot(camera.center() - x) <= 0) continue;
      const Vec2 pixel = camera.project(x).value();
      MeasuredPoint p;
      set_position(x, p);
      p.u = static_cast<float>(pixel.x());
      p.v = static_cast<float>(pixel.y());
      points.push_back(p);
    }
  }
  return points;
}

PairAgreement agreement(const Rig& rig, const Vec3& of_first, const Vec3& of_second) {
  const std::vector<std::vector<MeasuredPoint>> points{seen_points(rig.cameras[0], of_first),
                                                       seen_points(rig.cameras[1], of_second)};
  return ViewAgreement(rig, points).of(0, 1);
}

TEST(ViewAgreement, CamerasThatSeeOneBallAgreeAndThoseThatSeeTwoDoNot) {
  const Rig rig = sample::small_rig(480, 360, 110);
  const PairAgreement one = agreement(rig, Vec3::Zero(), Vec3::Zero());
  EXPECT_GT(one.same, 1000U);
  EXPECT_EQ(one.apart, 0U);
  EXPECT_FALSE(one.is_doubtful());
  // Towards both cameras, three line spacings.
  const PairAgreement two =
      agreement(rig, Vec3::Zero(), {3 * line_spacing(rig), 0, 0.4 * line_spacing(rig)});
  EXPECT_TRUE(two.is_doubtful());
  EXPECT_GT(two.apart, 5 * two.same);
  // What is far apart says nothing.
  const PairAgreement none = agreement(rig, {0, 0, 0}, {0, 0, 2.5 * kBallSeen});
  EXPECT_LT(none.same, one.same / 10);
}

/// How far cameras lie apart before a ball, of which one sees it `lines` line spacings aside.
ViewsApart apart_before_ball(const Rig& rig, std::size_t camera_aside, double lines) {
  constexpr float kSigma = 0.05F;
  Random random(3);
  std::vector<MeasuredPoint> points;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const Camera& camera = rig.cameras[c];
    const double aside = c == camera_aside ? lines * line_spacing(rig) : 0;
    for (MeasuredPoint p : seen_points(camera, {aside, 0, 0})) {
      const Vec3 way = (position_of(p) - camera.center()).normalized();
      set_position(position_of(p) + random.normal(0, kSigma) * way, p);
      p.camera = static_cast<std::uint8_t>(c);
      p.sigma = kSigma;
      points.push_back(p);
    }
  }
  return views_apart(rig, points, local_surfaces(rig, points, {}));
}

TEST(ViewAgreement, TwoBallsAFractionOfALineApartLieManyDeviationsApart) {
  const Rig rig = sample::small_rig(480, 360, 110);
  EXPECT_LT(apart_before_ball(rig, 0, 0).all.value(), 1.2);
  const ViewsApart apart = apart_before_ball(rig, 0, 0.2);
  EXPECT_GT(apart.all.value(), kMostApart);
  EXPECT_FALSE(apart.single().has_value());  // of two, nobody knows which
  // Out of each other's sight nothing can be said.
  const std::vector<MeasuredPoint> of_one = seen_points(rig.cameras[0], Vec3::Zero());
  EXPECT_FALSE(views_apart(rig, of_one, local_surfaces(rig, of_one, {})).all.has_value());
}

TEST(ViewAgreement, TheTwoSidesOfASheetSayNothingOfEachOther) {
  constexpr double kThickness = 0.3;  // line spacings
  Rig rig = sample::small_rig(480, 360, 110);
  rig.cameras[0] = sample::device_at<Camera>({560, 0, 80}, "cam0", 480, 360, 900);
  rig.cameras[1] = sample::device_at<Camera>({-560, 0, 80}, "cam1", 480, 360, 900);
  rig.projectors[1].device_from_world = look_at({-450, 100, 45}, Vec3::Zero());
  const auto apart = [&](int second_camera, int second_projector) {
    std::vector<MeasuredPoint> points;
    for (int side = 0; side < 2; ++side) {
      for (int i = 0; i < 6400; ++i) {
        MeasuredPoint p;
        p.camera = static_cast<std::uint8_t>(side == 0 ? 0 : second_camera);
        p.projector = static_cast<std::uint8_t>(side == 0 ? 0 : second_projector);
        set_position({(0.5 - side) * kThickness * line_spacing(rig), i % 80 - 39.5, i / 80 - 39.5},
                     p);
        const Vec2 pixel = rig.cameras[p.camera].project(position_of(p)).value();
        p.u = static_cast<float>(pixel.x());
        p.v = static_cast<float>(pixel.y());
        p.sigma = 0.05F;
        points.push_back(p);
      }
    }
    return views_apart(rig, points, local_surfaces(rig, points, {})).all;
  };
  EXPECT_FALSE(apart(1, 1).has_value());
  // From the same side, what they see lies apart.
  rig.cameras[1] = sample::device_at<Camera>({560, 90, 80}, "cam1", 480, 360, 900);
  EXPECT_GT(apart(1, 0).value(), kMostApart);
}

TEST(ViewAgreement, TheOneOfThreeCamerasThatLiesApartIsNamed) {
  Rig rig = sample::small_rig(480, 360, 110);
  rig.cameras.push_back(sample::device_at<Camera>({560, 0, 120}, "cam2", 480, 360, 900));
  EXPECT_FALSE(apart_before_ball(rig, 0, 0).single().has_value());
  for (const std::size_t camera : {0U, 1U, 2U})
    EXPECT_EQ(apart_before_ball(rig, camera, 0.1).single(), camera);
}

TEST(ViewAgreement, NamesTheCamerasOfDoubtfulPairs) {
  Rig rig = sample::small_rig(480, 360, 110);
  rig.cameras.push_back(sample::device_at<Camera>({560, 0, 120}, "cam2", 480, 360, 900));
  std::vector<std::vector<MeasuredPoint>> points;
  for (const Camera& camera : rig.cameras) points.push_back(seen_points(camera, Vec3::Zero()));
  EXPECT_EQ(ViewAgreement(rig, points).doubtful_pairs(), 0U);
  points[2] = seen_points(rig.cameras[2], {3 * line_spacing(rig), 0, 0});
  EXPECT_EQ(ViewAgreement(rig, points).doubtful_pairs(), 2U);
  EXPECT_EQ(ViewAgreement(rig, points).doubtful_cameras(), (std::vector<std::size_t>{0, 1, 2}));
}

}  // namespace
}  // namespace pencilscan
