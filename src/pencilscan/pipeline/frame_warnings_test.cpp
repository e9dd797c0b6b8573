#include "pencilscan/pipeline/frame_warnings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pencilscan/pipeline/disagreement_warnings.h"
#include "pencilscan/pipeline/light_warnings.h"
#include "pencilscan/pipeline/line_contrast.h"
#include "pencilscan/planning/ring.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

// Programs find the figures that core/warning.h promises for a code.
TEST(FrameWarnings, DoubtfulNamesAreNoRigThatIsOff) {
  EXPECT_STREQ(to_string(rig_warning({1000, 0.3, 0.1, {}}, RigInFrame::kAsGiven).code),
               "rig-is-off");
  EXPECT_STREQ(to_string(naming_warning("projector proj0").code), "names-doubtful");
}

// Light that spreads below a surface moves the lines of all devices.
TEST(FrameWarnings, WhatAllDevicesMissIsNoFaultOfOne) {
  const Rig rig = sample::small_rig(480, 360, 110);
  const std::size_t cameras = rig.cameras.size();
  ASSERT_GE(cameras, 2U);
  std::vector<CrossingDisagreement> of_devices(cameras + rig.projectors.size(),
                                               {1000, 0.2, 0.2, {}});
  of_devices[0].median_px = 0.52;
  EXPECT_TRUE(device_warning(rig, of_devices)) << "2.6 times noise, the others one";
  for (std::size_t c = 1; c < cameras; ++c) of_devices[c].median_px = 0.44;
  EXPECT_FALSE(device_warning(rig, of_devices)) << "all miss by twice the noise";
  EXPECT_TRUE(device_that_is_off(of_devices)) << "such a rig still does not fit";
}

Rig rig_of_four_projectors() {
  Rig rig = sample::small_rig(480, 360, 110);
  rig.projectors.resize(4, rig.projectors[0]);
  for (std::size_t p = 0; p < 4; ++p) rig.projectors[p].name = "proj" + std::to_string(p);
  return rig;
}

// Where noise explains more than right devices miss, one that is off stands out from its kind.
TEST(FrameWarnings, ADeviceThatIsFarFromItsKindIsNamedBelowTheLimitOfAll) {
  const Rig rig = rig_of_four_projectors();
  const std::size_t cameras = rig.cameras.size();
  std::vector<CrossingDisagreement> of_devices(cameras + 4, {700, 0.11, 0.22, {}});
  of_devices[cameras + 3] = {190, 0.29, 0.15, {}};
  const auto warning = device_warning(rig, of_devices);
  ASSERT_TRUE(warning);
  EXPECT_EQ(warning->device, "proj3");
  EXPECT_THAT(warning->text, testing::Not(testing::HasSubstr("(or ")));
  of_devices[0] = {150, 0.45, 0.22, {}};
  EXPECT_THAT(device_warning(rig, of_devices).value().text,
              testing::HasSubstr("(or camera " + rig.cameras[0].name));
  of_devices[0] = {700, 0.11, 0.22, {}};
  of_devices[cameras + 1].median_px = 0.24;
  EXPECT_FALSE(device_warning(rig, of_devices)) << "two miss alike";
  of_devices[cameras + 1].median_px = 0.11;
  of_devices[cameras + 3].median_px = 0.17;
  EXPECT_FALSE(device_warning(rig, of_devices)) << "noise explains it";
}

// Two weaker signs together: it has few crossings, and these miss.
TEST(FrameWarnings, AProjectorThatLacksCrossingsIsNamedWhereTheyMiss) {
  const Rig rig = rig_of_four_projectors();
  const std::size_t cameras = rig.cameras.size();
  std::vector<CrossingDisagreement> of_devices(cameras + 4, {330, 0.22, 0.26, {}});
  of_devices[cameras + 2] = {74, 0.23, 0.144, {}};
  const auto warning = device_warning(rig, of_devices);
  ASSERT_TRUE(warning);
  EXPECT_EQ(warning->device, "proj2");
  for (std::size_t d = 0; d < cameras; ++d) of_devices[d].median_px = 0.25;
  of_devices[cameras + 2].median_px = 0.19;
  EXPECT_EQ(device_warning(rig, of_devices).value().device, "proj2");
  of_devices[cameras + 2] = {74, 0.165, 0.144, {}};
  EXPECT_FALSE(device_warning(rig, of_devices)) << "noise explains them";
  of_devices[cameras + 2] = {190, 0.23, 0.144, {}};
  EXPECT_FALSE(device_warning(rig, of_devices)) << "it has as many as others";
  of_devices[cameras + 2] = {40, 0.23, 0.144, {}};
  EXPECT_FALSE(device_warning(rig, of_devices)) << "chance";
}

// A camera that turned keeps few crossings, and shares its misses with the projectors.
TEST(FrameWarnings, TheDeviceThatMissesMostIsNamedThoughItsCrossingsAreFew) {
  const Rig rig = sample::small_rig(480, 360, 110);
  const std::size_t cameras = rig.cameras.size();
  std::vector<CrossingDisagreement> of_devices(cameras + rig.projectors.size(),
                                               {1000, 0.06, 0.06, {}});
  of_devices[cameras].median_px = 0.16;
  of_devices[1] = {150, 0.26, 0.06, {}};
  const auto warning = device_warning(rig, of_devices);
  ASSERT_TRUE(warning);
  EXPECT_EQ(warning->device, rig.cameras[1].name);
  of_devices[0].median_px = 0.18;
  EXPECT_FALSE(device_warning(rig, of_devices)) << "two cameras miss: of neither alone";
  of_devices[0].median_px = 0.06;
  of_devices[1].crossings = 40;
  of_devices[cameras].median_px = 0.14;
  EXPECT_FALSE(device_warning(rig, of_devices)) << "chance";
}

/// Six cameras and six projectors, whose lines are counted.
class MissingLines : public testing::Test {
 protected:
  /// Most lines of each camera have names.
  std::vector<TellingPoints> usual_names() const {
    return std::vector<TellingPoints>(rig_.cameras.size(), {4000, 1000});
  }

  const Rig rig_ = make_ring(RingOptions{});
};

TEST_F(MissingLines, OfFewLinesThatAreExpectedNextToAllHaveToBeMissing) {
  const auto are_missing = [this](std::size_t points, std::size_t named) {
    const std::vector<std::vector<ExpectedLines>> expected{
        {{4000, 3200}, {points, named}, {3000, 2400}}};
    return !missing_lines_warnings(rig_, expected, usual_names()).empty();
  };
  EXPECT_TRUE(are_missing(4000, 200));
  EXPECT_TRUE(are_missing(1600, 0));
  EXPECT_TRUE(are_missing(300, 0));
  EXPECT_FALSE(are_missing(200, 0));
  EXPECT_FALSE(are_missing(300, 30));
  EXPECT_FALSE(are_missing(4000, 1100));  // as few as a right projector has
}

// A camera that is covered shows next to none.
TEST_F(MissingLines, ACameraWithoutTheLinesThatOthersMeasureIsNamed) {
  std::vector<std::vector<ExpectedLines>> expected(
      rig_.cameras.size(), std::vector<ExpectedLines>(rig_.projectors.size(), {1000, 800}));
  EXPECT_THAT(missing_lines_warnings(rig_, expected, usual_names()), IsEmpty());
  for (ExpectedLines& lines : expected[2]) lines.named = 20;
  const std::vector<Warning> found = missing_lines_warnings(rig_, expected, usual_names());
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].device, rig_.cameras[2].name);
  EXPECT_THAT(found[0].text,
              HasSubstr("2 % are in its picture (of the others' 80 %): it is covered"));
  expected[2].clear();  // its picture was left out
  EXPECT_THAT(missing_lines_warnings(rig_, expected, usual_names()), IsEmpty());
}

// A camera that stands elsewhere gets names of other lines, and has a third of those expected: as
// many as a right one that sees little. That few of all its lines had names tells them apart.
TEST_F(MissingLines, ACameraWithFewNamesAndFewOfTheExpectedLinesIsNamed) {
  std::vector<std::vector<ExpectedLines>> expected(
      rig_.cameras.size(), std::vector<ExpectedLines>(rig_.projectors.size(), {1000, 850}));
  for (ExpectedLines& lines : expected[4]) lines.named = 350;
  EXPECT_THAT(missing_lines_warnings(rig_, expected, usual_names()), IsEmpty());
  std::vector<TellingPoints> named = usual_names();
  named[4] = {1500, 3500};
  const std::vector<Warning> found = missing_lines_warnings(rig_, expected, named);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].device, rig_.cameras[4].name);
  for (ExpectedLines& lines : expected[4]) lines.named = 500;
  EXPECT_THAT(missing_lines_warnings(rig_, expected, named), IsEmpty());
  for (ExpectedLines& lines : expected[4]) lines = {60, 20};  // it hardly sees what was measured
  EXPECT_THAT(missing_lines_warnings(rig_, expected, named), IsEmpty());
}

TEST(Focus, ExplainsWhatElseIsSaidOfACamera) {
  std::vector<Warning> warnings{
      {WarningCode::kOutOfFocus, "", "a"},  {WarningCode::kDeviceIsOff, "", "a"},
      {WarningCode::kDeviceIsOff, "", "b"}, {WarningCode::kSaturated, "", "a"},
      {WarningCode::kOutOfFocus, "", "c"},  {WarningCode::kWrongPicture, "", "c"}};
  let_focus_explain(warnings);
  std::vector<std::string> left;
  for (const Warning& warning : warnings)
    left.push_back(warning.device + " " + to_string(warning.code));
  EXPECT_THAT(left, testing::ElementsAre("a out-of-focus", "b device-is-off", "a saturated",
                                         "c wrong-picture"));
}

TEST(DepthWarning, IsSaidWhereNothingElseExplainsIt) {
  const auto depth = [](double scale, std::optional<double> shared) {
    ConsistencyReport report;
    report.sigma_scale = scale;
    report.shared_scale = shared;
    return report;
  };
  EXPECT_FALSE(depth_warning(depth(2.4, 1.0), {}));
  const auto of_places = depth_warning(depth(4.3, 0.4), {});
  ASSERT_TRUE(of_places);
  EXPECT_EQ(of_places->code, WarningCode::kViewsDisagree);
  EXPECT_THAT(of_places->text, HasSubstr("lie apart by 4.3 times"));
  EXPECT_THAT(of_places->text, testing::Not(HasSubstr("the rig is a little off")));
  EXPECT_TRUE(depth_warning(depth(4.3, std::nullopt), {}));
  const auto of_patches = depth_warning(depth(2.4, 1.3), {});
  ASSERT_TRUE(of_patches);
  EXPECT_THAT(of_patches->text, HasSubstr("the rig is a little off"));
  std::vector<Warning> said(1);
  said[0].code = WarningCode::kSaturated;
  EXPECT_TRUE(depth_warning(depth(4.3, 1.3), said));
  // Noise of colours that are filled in repeats itself, and is no patch.
  said[0].code = WarningCode::kColorsFilledIn;
  EXPECT_FALSE(depth_warning(depth(3.1, 0.98), said));
  EXPECT_TRUE(depth_warning(depth(3.1, 1.3), said));
  for (const WarningCode code :
       {WarningCode::kRigIsOff, WarningCode::kViewsDisagree, WarningCode::kGamma}) {
    said[0].code = code;
    EXPECT_FALSE(depth_warning(depth(4.3, 1.3), said));
  }
}

TEST(GammaFinding, ComesFirstAndExplainsThatViewsDisagree) {
  const auto codes = [](std::vector<Warning> warnings) {
    let_gamma_explain(warnings);
    std::vector<WarningCode> result;
    for (const Warning& warning : warnings) result.push_back(warning.code);
    return result;
  };
  using Code = WarningCode;
  using testing::ElementsAre;
  EXPECT_THAT(
      codes({{Code::kSaturated}, {Code::kRigIsOff}, {Code::kGamma}, {Code::kViewsDisagree}}),
      ElementsAre(Code::kGamma, Code::kSaturated, Code::kRigIsOff));
  EXPECT_THAT(codes({{Code::kSaturated}, {Code::kRigIsOff}}),
              ElementsAre(Code::kSaturated, Code::kRigIsOff));
}

TEST(FewNames, IsSaidBelowATenthOfTheLines) {
  PointResult result;
  EXPECT_FALSE(few_names_warning(result));
  result.graphs.resize(2);
  result.graphs[1].curves.resize(1);
  result.graphs[1].curves[0].points.resize(1000);
  result.labeling.runs.resize(2);
  result.labeling.runs[1].push_back({0, 0, 99, {}});
  const auto warning = few_names_warning(result);
  ASSERT_TRUE(warning);
  EXPECT_THAT(warning->text, HasSubstr("only 9.9 % of the lines"));
  result.labeling.runs[1][0].end = 100;
  EXPECT_FALSE(few_names_warning(result));
}

TEST(FewNames, SayNothingOfTheRig) {
  CrossingDisagreement crossings;
  crossings.crossings = 40;
  crossings.median_px = 0.3;
  crossings.expected_px = 0.05;
  EXPECT_TRUE(deny_rig(crossings, 0.5));
  EXPECT_FALSE(deny_rig(crossings, 0.06));
  crossings.median_px = 0.06;
  EXPECT_FALSE(deny_rig(crossings, 0.5));
}

}  // namespace
}  // namespace pencilscan
