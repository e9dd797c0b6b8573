#include "pencilscan/guided/merged_lines.h"

#include <gtest/gtest.h>

#include "pencilscan/core/random.h"
#include "pencilscan/detection/curve_rendering.h"
#include "pencilscan/detection/refine.h"

namespace pencilscan {
namespace {

constexpr int kSize = 120;
constexpr float kWidth = 1.2F;
constexpr LineName kNamed{{0, 0}, 7};
constexpr LineName kMissing{{1, 0}, 7};

/// A line down the picture that bends a little.
Curve line_at(float u, float amplitude) {
  Curve curve;
  for (int v = 10; v < kSize - 10; ++v) {
    CurvePoint p;
    const auto y = static_cast<float>(v);
    p.position = {u + 0.002F * (y - 60) * (y - 60), y};
    p.normal = Eigen::Vector2f(1, -0.004F * (y - 60)).normalized();
    p.amplitude = amplitude;
    p.width_px = kWidth;
    curve.points.push_back(p);
  }
  return curve;
}

/// A picture of two lines `apart` px from each other, of which one has a name and the other may be
/// dark, and the one curve that was detected.
struct Scene {
  Camera camera;
  std::vector<Curve> curves;
  std::vector<LabeledRun> runs;
  std::vector<PredictedPoint> predicted;
  std::vector<cv::Mat> unexplained;
  Curve missing;

  Scene(float apart, float amplitude_of_missing) {
    camera.width = camera.height = kSize;
    const Curve named = line_at(55, 0.4F);
    missing = line_at(55 + apart, amplitude_of_missing);
    cv::Mat light = render_curves({named, missing}, {kSize, kSize});
    Random random(5);
    for (int v = 0; v < kSize; ++v) {
      for (int u = 0; u < kSize; ++u)
        light.at<float>(v, u) += static_cast<float>(random.normal(0, 0.01));
    }
    const float middle = amplitude_of_missing > 0 ? 55 + 0.4F * apart : 55;
    curves = refine_curves(light, {line_at(middle, 0)});
    for (std::size_t k = 0; k < curves.size(); ++k) {
      subtract_curve(curves[k], light);
      const auto count = static_cast<int>(curves[k].points.size());
      runs.push_back({static_cast<int>(k), 0, count,
                      CurveLabel{kNamed.pattern, kNamed.line, 1.0 * kNamed.line, 1}});
    }
    unexplained = {light};
    for (const CurvePoint& p : named.points)
      predicted.push_back({kNamed.pattern, kNamed.line, p.position, p.normal, 12, 0.1F, 0});
  }

  [[nodiscard]] MergedLines::Fit fit() const {
    const std::vector<char> subtracted(curves.size(), 1);
    Curve guess = missing;
    for (CurvePoint& p : guess.points) p.amplitude = 0;
    return MergedLines(camera, curves, runs, subtracted, predicted, unexplained)
        .fit(guess, kMissing);
  }
};

/// Points of a fit that lie on the missing line and show most of its light.
std::size_t right_points(const MergedLines::Fit& fit, const Curve& truth) {
  std::size_t right = 0;
  for (const Curve& piece : fit.pieces) {
    for (const CurvePoint& p : piece.points) {
      for (const CurvePoint& q : truth.points) {
        if ((p.position - q.position).norm() > 0.6F) continue;
        const bool is_on_it = std::abs((p.position - q.position).dot(q.normal)) < 0.25F;
        right += is_on_it && p.amplitude > 0.5F * q.amplitude ? 1 : 0;
        break;
      }
    }
  }
  return right;
}

TEST(MergedLines, TheOneWithoutANameIsFoundAtItsOwnPlace) {
  for (const float apart : {2.F, 2.5F, 3.F}) {
    const Scene scene(apart, 0.3F);
    ASSERT_FALSE(scene.curves.empty());
    double pulled = 0;  // of the curve, from the line whose name it has
    for (const CurvePoint& p : scene.curves[0].points)
      pulled += static_cast<double>(p.position.x()) - 55 -
                0.002 * (p.position.y() - 60) * (p.position.y() - 60);
    EXPECT_GT(pulled / static_cast<double>(scene.curves[0].points.size()), 0.3)
        << "the two made one curve, at " << apart;
    const MergedLines::Fit fit = scene.fit();
    EXPECT_GT(fit.beside, 9 * scene.missing.points.size() / 10);
    EXPECT_GT(right_points(fit, scene.missing), 8 * scene.missing.points.size() / 10)
        << "at " << apart;
  }
}

TEST(MergedLines, AnUnlitOneHasNoLight) {
  const Scene scene(2.5F, 0);
  const MergedLines::Fit fit = scene.fit();
  EXPECT_GT(fit.beside, 9 * scene.missing.points.size() / 10) << "it was looked for";
  for (const Curve& piece : fit.pieces) {
    for (const CurvePoint& p : piece.points) EXPECT_LT(p.amplitude, 0.1F) << "of .4 beside it";
  }
}

TEST(MergedLines, WithoutACurveBesideItThereIsNoFit) {
  Scene scene(2.5F, 0.3F);
  scene.runs.clear();
  const MergedLines::Fit fit = scene.fit();
  EXPECT_EQ(fit.beside, 0U);
  EXPECT_TRUE(fit.pieces.empty());
}

}  // namespace
}  // namespace pencilscan
