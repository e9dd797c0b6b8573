#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pencilscan/pencilscan.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

/// Before a ball: the paper's Fig. 6 with small images.
const Rig& rig() {
  static const Rig value = sample::small_rig(480, 360, 110);
  return value;
}

const SimulatedFrame& frame() {
  static const SimulatedFrame value = [] {
    SimulationOptions options;
    options.noise = "low";
    return simulate(rig(), make_sphere(95, 48), options);
  }();
  return value;
}

Images views(const std::map<std::string, cv::Mat>& images) {
  Images result;
  for (const auto& [name, image] : images) result.emplace(name, image);
  return result;
}

std::string complaint(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Api, StagesAreToldInOrderAndChangeNothing) {
  ReconstructionOptions options;
  options.mesh = false;
  const Reconstruction quiet = reconstruct(rig(), views(frame().images), options);
  std::vector<std::string> stages;
  options.progress = [&](std::string_view stage, double done) {
    EXPECT_GE(done, 0);
    EXPECT_LT(done, 1);
    if (stages.empty() || stages.back() != stage) stages.emplace_back(stage);
    return true;
  };
  const Reconstruction told = reconstruct(rig(), views(frame().images), options);
  EXPECT_THAT(stages, ::testing::Contains("solution"));
  EXPECT_GT(told.points.size(), 1000U);
  EXPECT_EQ(told.points.size(), quiet.points.size());
  EXPECT_EQ(told.report, quiet.report);
  EXPECT_TRUE(told.mesh.vertices.empty());
}

TEST(Api, AListenerEndsTheCall) {
  ReconstructionOptions options;
  options.progress = [](std::string_view stage, double) { return stage != "grid"; };
  EXPECT_THROW(static_cast<void>(reconstruct(rig(), views(frame().images), options)), Cancelled);
  struct Refusal {};
  options.progress = [](std::string_view, double) -> bool { throw Refusal(); };
  EXPECT_THROW(static_cast<void>(reconstruct(rig(), views(frame().images), options)), Refusal);
}

TEST(Api, PicturesMayBeBytesOrNumbersAndStayAsTheyAre) {
  std::map<std::string, cv::Mat> numbers;
  for (const auto& [name, image] : frame().images)
    image.convertTo(numbers[name], CV_32F, 1 / 255.0);
  std::map<std::string, cv::Mat> copies;
  for (const auto& [name, image] : numbers) copies[name] = image.clone();
  ReconstructionOptions options;
  options.mesh = false;
  const Reconstruction of_bytes = reconstruct(rig(), views(frame().images), options);
  const Reconstruction of_numbers = reconstruct(rig(), views(numbers), options);
  EXPECT_EQ(of_bytes.report, of_numbers.report);
  for (const auto& [name, image] : numbers)
    EXPECT_EQ(cv::norm(image, copies[name], cv::NORM_INF), 0) << name;
}

TEST(Api, AFloatPictureIsNotCopied) {
  std::vector<float> pixels(std::size_t{4} * 3 * 3);
  const ImageView view(std::span<const float>(pixels), 4, 3);
  EXPECT_EQ(view.stored().ptr<float>(), pixels.data());
}

TEST(Api, ComplaintsNameWhatIsWrong) {
  EXPECT_THAT(complaint([] {
                auto images = views(frame().images);
                images.emplace("cam9", images.begin()->second);
                static_cast<void>(reconstruct(rig(), images));
              }),
              HasSubstr("cam9: must be one of the rig: cam0, cam1"));
  EXPECT_THAT(complaint([] {
                const cv::Mat small(10, 20, CV_8UC3, cv::Scalar::all(0));
                static_cast<void>(reconstruct(rig(), {{"cam0", small}}));
              }),
              HasSubstr("cam0 = 20x10: must be 480x360"));
  EXPECT_THAT(complaint([] {
                ReconstructionOptions options;
                options.method = "magic";
                static_cast<void>(reconstruct(rig(), views(frame().images), options));
              }),
              HasSubstr("method = magic: must be joint"));
  EXPECT_THAT(complaint([] {
                const std::vector<std::uint8_t> few(10);
                static_cast<void>(ImageView(std::span<const std::uint8_t>(few), 4, 3));
              }),
              HasSubstr("10: must be width x height x channels"));
  EXPECT_THROW(static_cast<void>(reconstruct(rig(), {})), InputError);
}

TEST(Api, AConfidenceThatIsNoNumberIsRefused) {
  const DetectedFrame detected = detect(rig(), views(frame().images));
  std::vector<PointLabel> labels = label(detected);
  for (PointLabel& label : labels) label.confidence = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(complaint([&] { static_cast<void>(reconstruct(detected, labels)); }),
              HasSubstr("must be in [0, 1]"));
}

// Pictures of 16 bits that hold 12 of a sensor: lines are as high as in the pictures that were
// given, whoever tells of them.
TEST(Api, DetectedCurvesAreAsHighAsThoseOfTheResult) {
  std::map<std::string, cv::Mat> images = frame().images;
  for (auto& [name, image] : images) image.convertTo(image, CV_16U, 4095.0 / 255);
  ReconstructionOptions options;
  options.mesh = false;
  const auto heights = [](const CurveFile& curves) {
    double sum = 0;
    for (const CurveSample& sample : curves.samples) sum += static_cast<double>(sample.amplitude);
    return sum / static_cast<double>(curves.samples.size());
  };
  const DetectedFrame detected = detect(rig(), views(images), options);
  const double expected = heights(reconstruct(rig(), views(images), options).curves);
  EXPECT_NEAR(heights(detected.curves()), expected, 0.05 * expected);
  EXPECT_NEAR(heights(reconstruct(detected, label(detected), options).curves), expected,
              0.05 * expected);
}

TEST(Api, ANegativeNumberOfThreadsIsRefused) {
  ReconstructionOptions options;
  options.threads = -1;
  EXPECT_THAT(
      complaint([&] { static_cast<void>(reconstruct(rig(), views(frame().images), options)); }),
      HasSubstr("threads = -1: must be >= 0"));
}

TEST(Api, AResultWithoutAMeshLeavesNoneOfAnEarlierOne) {
  const std::filesystem::path folder = ::testing::TempDir() + "api_earlier_mesh";
  std::filesystem::remove_all(folder);
  Reconstruction result;
  result.report = "{}";
  result.mesh = result.measured = make_sphere(10, 8);
  write_reconstruction(folder, result);
  EXPECT_TRUE(std::filesystem::exists(folder / "mesh.ply"));
  result.mesh = result.measured = {};
  write_reconstruction(folder, result);
  EXPECT_FALSE(std::filesystem::exists(folder / "mesh.ply"));
  EXPECT_FALSE(std::filesystem::exists(folder / "mesh_measured.ply"));
  EXPECT_TRUE(std::filesystem::exists(folder / "points.ply"));
}

TEST(Api, JudgementHasTheKeysOfThePartsThatAreThere) {
  ReconstructionOptions options;
  options.mesh = false;
  const Reconstruction result = reconstruct(rig(), views(frame().images), options);
  const auto figures = nlohmann::json::parse(judge(frame().truth, rig(), result));
  EXPECT_LT(figures.at("label_error").get<double>(), 0.01);
  EXPECT_FALSE(figures.contains("completeness_1mm") && !figures["completeness_1mm"].is_null());
}

TEST(Api, ARigIsItsText) {
  const std::string text = rig_text(rig());
  EXPECT_EQ(rig_text(rig_from_text(text)), text);
  EXPECT_THAT(complaint([] { static_cast<void>(rig_from_text("{\"format\": 1}", "mine")); }),
              ::testing::StartsWith("mine: "));
}

TEST(Api, TheVersionHasThreeNumbers) {
  EXPECT_THAT(version(), ::testing::MatchesRegex("[0-9]+\\.[0-9]+\\.[0-9]+"));
}

}  // namespace
}  // namespace pencilscan
