#include "pencilscan/uncertainty/error_model.h"

#include <gtest/gtest.h>

namespace pencilscan {
namespace {

SurfaceEvidence usual() { return {0.2F, 0.1F, 0.F, 0.F, 2.F}; }

TEST(ErrorModel, SigmaOfASurfaceIsALength) {
  SurfaceEvidence twice = usual();
  twice.bend = 0.05F;
  const double once = surface_sigma(twice);
  for (float* length : {&twice.predicted, &twice.scatter, &twice.bend}) *length *= 2;
  EXPECT_NEAR(surface_sigma(twice), 2 * once, 1e-6);
}

TEST(ErrorModel, PredictionAndScatterCountAlike) {
  SurfaceEvidence expected = usual();
  expected.predicted *= 4;
  SurfaceEvidence seen = usual();
  seen.scatter *= 4;
  EXPECT_NEAR(surface_sigma(expected), 2 * surface_sigma(usual()), 1e-6);
  EXPECT_NEAR(surface_sigma(seen), 2 * surface_sigma(usual()), 1e-6);
}

TEST(ErrorModel, MoreCamerasAreSurerOneSideAndBendLessSo) {
  SurfaceEvidence more = usual();
  more.cameras = 4;
  EXPECT_LT(surface_sigma(more), surface_sigma(usual()));
  SurfaceEvidence rim = usual();
  rim.one_sidedness = 0.6F;
  EXPECT_GT(surface_sigma(rim), 1.3 * surface_sigma(usual()));
  SurfaceEvidence edge = usual();
  edge.bend = 1;
  EXPECT_GT(surface_sigma(edge), 2 * surface_sigma(usual()));
}

TEST(ErrorModel, ExactDataIsNotWithoutError) {
  EXPECT_GT(surface_sigma({0, 0, 0, 0, 6}), 0.001);
  EXPECT_GT(point_sigma({0.1F, 0.05F, 0, true}), 0.01);
}

TEST(ErrorModel, APointIsLessSureTheFartherItWasOff) {
  const double near = point_sigma({0.3F, 0.1F, 0.05F, true});
  const double far = point_sigma({0.3F, 0.1F, 0.5F, true});
  const double off = point_sigma({0.3F, 0.1F, 5.F, false});
  EXPECT_LT(near, 0.1);
  EXPECT_GT(far, near);
  EXPECT_GT(off, 2) << "point and surface contradict each other";
  EXPECT_GT(point_sigma({0.3F, 0, 0, false}), 0.3) << "a point alone";
}

PointEvidence evidence_of(float of_margin, bool settled) {
  PointEvidence evidence;
  evidence.confidence = of_margin;
  evidence.settled = settled;
  return evidence;
}

TEST(ErrorModel, NoLabelIsCertain) {
  EXPECT_LT(confidence_on_lines(1), 1);
  EXPECT_GT(confidence_on_lines(1), 0.999F);
  EXPECT_LT(confidence_on_surface(evidence_of(1, true)), 1);
  EXPECT_GE(confidence_on_lines(0), 0);
  EXPECT_GE(confidence_on_surface(evidence_of(0, true)), 0);
}

TEST(ErrorModel, ASurfaceMakesLabelsSurer) {
  float before = 0;
  for (const float of_margin : {0.9F, 0.99F, 0.999F, 0.9999F}) {
    const float alone = confidence_on_lines(of_margin);
    const float settled = confidence_on_surface(evidence_of(of_margin, true));
    EXPECT_GT(settled, alone);
    EXPECT_GT(alone, before) << "surer by margins: surer";
    EXPECT_LT(confidence_on_surface(evidence_of(of_margin, false)), settled);
    before = alone;
  }
  EXPECT_LT(confidence_on_surface(evidence_of(1, false)), 0.99F) << "it contradicts the surface";
}

}  // namespace
}  // namespace pencilscan
