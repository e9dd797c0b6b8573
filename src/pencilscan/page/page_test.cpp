#include "pencilscan/page/page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>

#include <cstring>
#include <fstream>
#include <memory>
#include <numeric>
#include <random>

#include "pencilscan/core/error.h"
#include "pencilscan/core/error_of.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/labeling/point_file.h"
#include "pencilscan/page/advice.h"
#include "pencilscan/page/block.h"
#include "pencilscan/page/geometry_blocks.h"
#include "pencilscan/page/histogram.h"
#include "pencilscan/page/result_folder.h"
#include "pencilscan/page/sample_result.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

class Folder : public ::testing::Test {
 protected:
  std::string report(const PageOptions& options = {}) {
    last_ = write_report(root_, root_ / "report.html", options);
    return read_file(root_ / "report.html");
  }
  /// The index as the browser reads it.
  static nlohmann::json index_of(const std::string& page) {
    const std::string open = "id=\"index\">";
    const std::size_t begin = page.find(open) + open.size();
    return nlohmann::json::parse(page.substr(begin, page.find("</script>", begin) - begin));
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  fs::path root_ = temporary_.path();
  PageReport last_;
};

std::string inflated(const std::string& bytes) {
  std::string result(std::size_t{1} << 24, '\0');
  uLongf size = result.size();
  EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(result.data()), &size,
                       reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()),
            Z_OK);
  result.resize(size);
  return result;
}

/// A second, plain reader of the layout that block.h describes.
struct ReadBlock {
  explicit ReadBlock(const std::string& bytes) : data(inflated(bytes)) {
    std::uint32_t length = 0;
    std::memcpy(&length, data.data(), 4);
    header = nlohmann::json::parse(data.substr(4, length));
    data = data.substr(4 + length);
  }
  std::vector<std::uint32_t> integers(const std::string& name, int bytes) const {
    const auto& entry = header["arrays"][name];
    const std::size_t count = entry["count"];
    const std::size_t at = entry["at"];
    std::vector<std::uint32_t> values;
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < count; ++i) {
      std::uint32_t code = 0;
      for (int plane = bytes - 1; plane >= 0; --plane) {
        code = code << 8U |
               static_cast<unsigned char>(data[at + static_cast<std::size_t>(plane) * count + i]);
      }
      last += code % 2 == 0 ? code / 2 : ~(code / 2);
      if (bytes == 2) last &= 0xFFFFU;
      values.push_back(last);
    }
    return values;
  }
  nlohmann::json header;
  std::string data;
};

TEST(Base64, GivesTheExamplesOfRfc4648) {
  const std::vector<std::pair<std::string, std::string>> examples = {{"", ""},
                                                                     {"f", "Zg=="},
                                                                     {"fo", "Zm8="},
                                                                     {"foo", "Zm9v"},
                                                                     {"foob", "Zm9vYg=="},
                                                                     {"fooba", "Zm9vYmE="},
                                                                     {"foobar", "Zm9vYmFy"}};
  for (const auto& [bytes, text] : examples) EXPECT_EQ(base64(bytes), text);
}

TEST(Block, IntegersComeBackExactly) {
  std::mt19937 random(7);
  std::vector<std::uint16_t> small;
  std::vector<std::uint32_t> large;
  for (int i = 0; i < 1000; ++i) {
    small.push_back(static_cast<std::uint16_t>(random()));
    large.push_back(static_cast<std::uint32_t>(random()));
  }
  Block block;
  block.add_integers("small", small);
  block.add_integers("large", large);
  const ReadBlock read(block.bytes());
  EXPECT_EQ(read.integers("small", 2), std::vector<std::uint32_t>(small.begin(), small.end()));
  EXPECT_EQ(read.integers("large", 4), large);
}

TEST(Block, FloatsAreOffByHalfAStepAtMostAndKeepWhatIsNoNumber) {
  const std::vector<float> values = {-3.5F, 0.001F, 812.25F, NAN, 20};
  Block block;
  block.add_floats("f", values);
  const ReadBlock read(block.bytes());
  const double low = read.header["arrays"]["f"]["low"];
  const double step = read.header["arrays"]["f"]["step"];
  EXPECT_NEAR(step, (812.25 + 3.5) / 65534, 1e-9);
  const auto codes = read.integers("f", 2);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isnan(values[i])) {
      EXPECT_EQ(codes[i], 65535U);
    } else {
      EXPECT_NEAR(low + step * codes[i], values[i], 0.5 * step + 1e-6);
    }
  }
}

TEST(Block, LogarithmicFloatsHaveARelativeError) {
  const std::vector<float> values = {1e-3F, 0.04F, 7, 0, 100};
  Block block;
  block.add_floats("f", values, Steps::kLogarithmic);
  const ReadBlock read(block.bytes());
  const double low = read.header["arrays"]["f"]["low"];
  const double step = read.header["arrays"]["f"]["step"];
  const auto codes = read.integers("f", 2);
  for (const std::size_t i : {0U, 1U, 2U, 4U})
    EXPECT_NEAR(std::exp(low + step * codes[i]) / values[i], 1, 1e-4);
  EXPECT_EQ(codes[3], 65535U);  // no logarithm
}

TEST(Decimated, KeepsTheBallClosedAndItsSize) {
  const TriangleMesh mesh = sample::ball();
  constexpr std::size_t kFaces = 400;
  const TriangleMesh small = decimated(mesh, kFaces);
  EXPECT_LE(small.faces.size(), kFaces);
  EXPECT_GT(small.faces.size(), kFaces / 2);
  EXPECT_EQ(count_edges(small).boundary, 0U);
  constexpr double kInscribed = 0.05;  // vertices lie on the ball: a geodesic one loses 0.03
  EXPECT_NEAR(signed_volume(small) / signed_volume(mesh), 1, kInscribed);
  ASSERT_EQ(small.hole.size(), small.vertices.size());
  for (std::size_t i = 0; i < small.vertices.size(); ++i)
    EXPECT_EQ(small.hole[i], small.vertices[i].x() > 0 ? 1 : 8);
}

TEST(Decimated, KeepsTheShapeWithFarFewerFaces) {
  const TriangleMesh mesh = make_sphere(sample::kBallRadius, 120);
  constexpr std::size_t kFaces = 500;
  ASSERT_GT(mesh.faces.size(), 32 * kFaces);  // clustered first
  const TriangleMesh small = decimated(mesh, kFaces);
  EXPECT_LE(small.faces.size(), kFaces);
  EXPECT_GT(small.faces.size(), kFaces / 2);
  constexpr double kInscribed = 0.08;  // as above, with fewer faces and uneven ones
  EXPECT_NEAR(signed_volume(small) / signed_volume(mesh), 1, kInscribed);
}

TEST(MeshBlock, HasColorsWhereTheMeshHasThem) {
  TriangleMesh mesh = sample::ball();
  EXPECT_FALSE(ReadBlock(mesh_block(mesh, {}).bytes()).header["arrays"].contains("red"));
  mesh.color.assign(mesh.vertices.size(), {1, 0.2140F, 0});
  const ReadBlock read(mesh_block(mesh, {}).bytes());
  const auto byte = [&](const char* name) {
    return static_cast<unsigned char>(read.data[read.header["arrays"][name]["at"]]);
  };
  EXPECT_EQ(byte("red"), 255);
  EXPECT_EQ(byte("green"), 127);  // half on a screen is 0.214 of the light (IEC 61966-2-1)
  EXPECT_EQ(byte("blue"), 0);
}

TEST(MeshBlock, OfLowerPrecisionHasLargerStepsAndTakesLessRoom) {
  const TriangleMesh mesh = sample::ball();
  const ReadBlock fine(mesh_block(mesh, {}).bytes());
  const ReadBlock coarse(mesh_block(mesh, {}, MeshPrecision::kCoarse).bytes());
  const double ratio = coarse.header["arrays"]["x"]["step"].get<double>() /
                       fine.header["arrays"]["x"]["step"].get<double>();
  EXPECT_NEAR(ratio, 65534.0 / 4094, 1e-6);
  EXPECT_LT(mesh_block(mesh, {}, MeshPrecision::kCoarse).bytes().size(),
            mesh_block(mesh, {}).bytes().size());
}

TEST(PointErrors, AreHowFarThePointsLieBeforeTheTruth) {
  const Rig rig = sample::rig();
  constexpr double kOff = 2;
  const auto points = sample::points(rig, kOff);
  const PointErrors errors =
      point_errors(rig, points, RayScene(make_sphere(sample::kBallRadius, 200)));
  constexpr double kFacets = 0.02;  // the truth is a polyhedron
  std::size_t met = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_NEAR(errors.distance_mm[i], kOff, kFacets);
    if (std::isnan(errors.along_ray_mm[i])) continue;  // passes beside the smaller ball
    EXPECT_GT(errors.along_ray_mm[i], kOff - kFacets);
    ++met;
  }
  // Beside it pass rays of the outer ring, 1 - (90 / 92)^2 of the ball's disk.
  EXPECT_GT(met, points.size() * 9 / 10);
}

TEST(Histogram, CountsEveryValueOnce) {
  std::vector<float> values(1000);
  std::iota(values.begin(), values.end(), 0.0F);
  values.push_back(NAN);
  const auto h = histogram(values, 10);
  const auto counts = h["counts"].get<std::vector<std::size_t>>();
  EXPECT_EQ(std::accumulate(counts.begin(), counts.end(), h["above"].get<std::size_t>()), 1000U);
  EXPECT_NEAR(h["median"].get<double>(), 499.5, 1);
  EXPECT_TRUE(histogram(std::vector<float>{}).is_null());
  EXPECT_EQ(histogram(std::vector<float>(7, 1.0F), 10)["counts"].back(), 7U);  // the end counts
}

TEST(Advice, NamesWhatToDoAndToleratesAnything) {
  const char* saturated = "camera cam0: 3 % of its pixels are saturated";
  const auto advice = advise({{"warnings", {saturated}},
                              {"findings", {{{"code", "saturated"}, {"text", saturated}}}},
                              {"surface", {{"area_mm2", {{"measured", 80}, {"not seen", 20}}}}}});
  ASSERT_EQ(advice.size(), 2U);
  EXPECT_THAT(advice[0].action, HasSubstr("exposure"));
  EXPECT_THAT(advice[1].warning, HasSubstr("20 %"));
  for (const char* odd :
       {"null", "[]", "3", R"({"warnings": 3, "findings": 4, "cameras": [1], "surface": []})"})
    EXPECT_TRUE(advise(nlohmann::json::parse(odd)).empty()) << odd;
}

TEST_F(Folder, FindsFramesRunsAndFailedFrames) {
  sample::write_output(root_ / "joint", 2);
  sample::write_output(root_ / "linear", 1);
  fs::create_directories(root_ / "joint" / "000002" / "pictures");
  write_mesh(root_ / "scene" / "truth" / "mesh.ply", sample::ball());
  write_json(root_ / "joint.json", {{"label_error", 0.01}});
  const ResultFolder found = find_results(root_);
  ASSERT_EQ(found.results.size(), 3U);
  EXPECT_EQ(found.results[0].run, "joint");
  EXPECT_EQ(found.results[1].name, "000001");
  EXPECT_EQ(found.results[0].figures.filename(), "joint.json");
  EXPECT_EQ(found.results[2].rig, root_ / "linear" / "devices.json");
  EXPECT_EQ(found.results[0].truth, root_ / "scene" / "truth" / "mesh.ply");
  ASSERT_EQ(found.failed.size(), 1U);
  EXPECT_EQ(found.failed[0].filename(), "000002");
  // A frame's own folder is a result as well.
  EXPECT_EQ(find_results(root_ / "joint" / "000001").results.size(), 1U);
}

TEST_F(Folder, SaysWhyAFrameFailed) {
  sample::write_output(root_ / "joint", 1);
  write_json(root_ / "joint" / "inputs.json", {{"format", "any"}});
  write_json(root_ / "joint" / "000001" / "failure.json",
             {{"reason", "cam1: <black>"}, {"is_passing", false}});
  write_json(root_ / "joint" / "000002" / "failure.json",
             {{"reason", "the disk is full"}, {"is_passing", true}});
  write_text(root_ / "joint" / "000003" / "failure.json", "{");
  fs::create_directories(root_ / "joint" / "000004");
  const auto failed = index_of(report())["failed"];
  ASSERT_EQ(failed.size(), 4U);
  EXPECT_EQ(failed[0]["run"], "joint");
  EXPECT_EQ(failed[0]["frame"], "000001");
  EXPECT_EQ(failed[0]["why"], "cam1: <black>");
  EXPECT_EQ(failed[0]["action"], "");
  EXPECT_EQ(failed[1]["why"], "the disk is full");
  EXPECT_THAT(failed[1]["action"].get<std::string>(), HasSubstr("again"));
  EXPECT_THAT(failed[2]["why"].get<std::string>(), HasSubstr("does not say why"));
  EXPECT_THAT(failed[3]["why"].get<std::string>(), HasSubstr("neither a result nor"));
}

TEST(UnpackedMesh, LiesReadyForTheBrowser) {
  TriangleMesh mesh = sample::ball();
  mesh.sigma[3] = 0.25F;
  mesh.hole.resize(mesh.vertices.size() - 1);  // what follows is aligned, whatever came before
  const std::string bytes = unpacked_mesh(mesh);
  std::uint32_t length = 0;
  std::memcpy(&length, bytes.data(), 4);
  const auto arrays = nlohmann::json::parse(bytes.substr(4, length))["arrays"];
  const auto at = [&](const char* name) {
    return 4 + length + arrays[name]["at"].get<std::size_t>();
  };
  for (const char* name : {"position", "index", "sigma"}) EXPECT_EQ(at(name) % 4, 0U) << name;
  std::vector<float> position(arrays["position"]["count"].get<std::size_t>());
  ASSERT_EQ(position.size(), 3 * mesh.vertices.size());
  std::memcpy(position.data(), &bytes[at("position")], 4 * position.size());
  std::vector<std::uint32_t> index(arrays["index"]["count"].get<std::size_t>());
  ASSERT_EQ(index.size(), 3 * mesh.faces.size());
  std::memcpy(index.data(), &bytes[at("index")], 4 * index.size());
  for (std::size_t i = 0; i < position.size(); ++i)
    ASSERT_EQ(position[i],
              static_cast<float>(mesh.vertices[i / 3][static_cast<Eigen::Index>(i % 3)]));
  for (std::size_t i = 0; i < index.size(); ++i)
    ASSERT_EQ(index[i], static_cast<std::uint32_t>(mesh.faces[i / 3][i % 3]));
  float sigma = 0;
  std::memcpy(&sigma, &bytes[at("sigma") + 12], 4);
  EXPECT_EQ(sigma, 0.25F);
  EXPECT_EQ(arrays["confidence"]["count"], mesh.confidence.size());
  EXPECT_EQ(bytes.size(), at("hole") + mesh.hole.size());
}

TEST_F(Folder, AReportHoldsAllPartsAndNoAddressToLoadFrom) {
  sample::write_output(root_, 1);
  const std::string page = report();
  EXPECT_EQ(last_.results, 1U);
  EXPECT_THAT(last_.missing, ::testing::IsEmpty());
  for (const char* part : {"details", "mesh", "measured", "points", "curves", "image/1", "depth/0",
                           "holes/1", "thumb"}) {
    EXPECT_THAT(page, HasSubstr("id=\"part/0/" + std::string(part) + "\"")) << part;
  }
  EXPECT_THAT(page, Not(HasSubstr("src=\"http")));
  EXPECT_THAT(page, Not(HasSubstr("@import")));
  EXPECT_EQ(index_of(page)["results"][0]["summary"]["points"],
            sample::points(sample::rig()).size());
}

TEST_F(Folder, TheSameFolderGivesTheSameBytes) {
  sample::write_output(root_, 2);
  EXPECT_EQ(report(), report());
}

TEST_F(Folder, WhatIsMissingOrBrokenIsSaidInThePage) {
  sample::write_output(root_, 1);
  fs::remove(root_ / "000000" / "mesh_measured.ply");
  write_text(root_ / "000000" / "points.ply", "ply\nnonsense");
  write_text(root_ / "000000" / "report.json", "{");
  fs::resize_file(root_ / "000000" / "curves.ply", 900);
  write_text(root_ / "devices.json", "{\"format\": 3}");
  const auto index = index_of(report());
  std::vector<std::string> what;
  for (const auto& missing : index["results"][0]["missing"]) {
    what.push_back(missing["what"]);
    const bool is_broken = what.back().ends_with(".ply") || what.back() == "report.json";
    if (what.back() == "mesh_measured.ply" || !is_broken) {
      EXPECT_EQ(missing["kind"], "missing") << what.back();
    } else {
      EXPECT_EQ(missing["kind"], "unreadable") << what.back();
    }
  }
  EXPECT_THAT(what, Contains("points.ply"));
  EXPECT_THAT(what, Contains("report.json"));
  EXPECT_THAT(what, Contains("mesh_measured.ply"));
  EXPECT_THAT(what, Contains("the devices"));
  EXPECT_THAT(index["results"][0]["parts"], Contains("mesh"));
}

TEST_F(Folder, OfAScanNothingIsMissingButTheDevices) {
  write_points(root_ / "points.ply", sample::points(sample::rig()));
  write_mesh(root_ / "mesh.ply", sample::ball());
  static_cast<void>(report());
  ASSERT_EQ(last_.missing.size(), 1U);
  EXPECT_THAT(last_.missing[0], HasSubstr("--rig"));
  write_rig(sample::rig(), root_ / "rig.json");
  static_cast<void>(report());
  EXPECT_THAT(last_.missing, ::testing::IsEmpty());
}

TEST_F(Folder, AnEmptyFolderHasNoReport) {
  std::filesystem::create_directories(root_ / "000000");
  EXPECT_THROW(static_cast<void>(report()), InputError);
  const PageData page(root_, {});
  EXPECT_TRUE(page.is_empty());
  EXPECT_THROW(page.require_content("view"), InputError);
  EXPECT_EQ(page.index("view", {})["title"], root_.filename().string());
  EXPECT_EQ(folder_name(root_ / ""), root_.filename().string());
  EXPECT_THROW(static_cast<void>(find_results(root_ / "none")), InputError);
}

TEST_F(Folder, ACalibrationsOwnPageHoldsWhatTheReportOfItsFolderDoes) {
  const nlohmann::ordered_json calibration = {{"verdict", "good"}, {"rms_px", 0.125}};
  write_json(root_ / "calibration.json", calibration);
  const auto of_folder = index_of(report());
  const auto alone = index_of(calibration_page(calibration, "Calibration", "pencilscan"));
  EXPECT_EQ(alone["calibrations"], of_folder["calibrations"]);
  for (const auto& [key, value] : of_folder.items()) EXPECT_TRUE(alone.contains(key)) << key;
  EXPECT_EQ(alone["mode"], "report");
  EXPECT_EQ(alone["title"], "Calibration");
}

TEST_F(Folder, NamesCannotLeaveTheirPlaceInThePage) {
  sample::write_output(root_, 1);
  PageOptions options;
  options.title = "</script><script>alert(1)</script>";
  const std::string page = report(options);
  EXPECT_THAT(page, Not(HasSubstr("<script>alert")));
  EXPECT_EQ(index_of(page)["title"], options.title);
}

TEST_F(Folder, OfManyFramesSomeAreWholeAndTheOthersHaveTheirShape) {
  sample::write_output(root_, 12);
  PageOptions options;
  options.max_bytes = 1'150'000;
  const auto index = index_of(report(options));
  EXPECT_LT(last_.full_results, last_.results);
  EXPECT_GE(last_.full_results, 1U);
  EXPECT_LE(last_.bytes, options.max_bytes);
  EXPECT_EQ(index["results"][0]["detail"], "full");
  for (const auto& result : index["results"]) EXPECT_THAT(result["parts"], Contains("mesh"));
}

TEST_F(Folder, ATruthOfAnotherSizeIsTold) {
  sample::write_output(root_, 1);
  write_mesh(root_ / "true.ply", make_sphere(sample::kBallRadius, 60));
  write_mesh(root_ / "small.ply", make_sphere(0.01 * sample::kBallRadius, 60));
  PageOptions options;
  options.sources.truth = root_ / "true.ply";
  static_cast<void>(report(options));
  EXPECT_THAT(last_.missing, Not(Contains(HasSubstr("true.ply"))));
  options.sources.truth = root_ / "small.ply";
  const std::string page = report(options);
  EXPECT_THAT(last_.missing, Contains(HasSubstr("small.ply: this is hardly the truth")));
  const auto missing = index_of(page)["results"][0]["missing"];
  ASSERT_EQ(missing.size(), 1U);
  EXPECT_EQ(missing[0]["kind"], "doubtful");
  // No figure is of it, and who asks for the details alone is told as well.
  const ResultEntry entry = find_results(root_, options.sources).results.at(0);
  ResultReader reader(entry, std::make_shared<const Rig>(sample::rig()), {});
  const auto details = nlohmann::json::parse(inflated(*reader.part("details")));
  EXPECT_FALSE(details.contains("figures"));
  EXPECT_FALSE(details["histograms"].contains("error_mm"));
  EXPECT_EQ(details["doubts"][0]["kind"], "doubtful");
}

TEST_F(Folder, ATruthAddsDistancesAndFigures) {
  sample::write_output(root_, 1);
  write_mesh(root_ / "true.ply", make_sphere(sample::kBallRadius, 60));
  PageOptions options;
  options.sources.truth = root_ / "true.ply";
  const PageData data(root_, options);
  const auto reader = data.open(0, {});
  const auto details = nlohmann::json::parse(inflated(*reader->part("details")));
  EXPECT_LT(details["figures"]["distance_median_mm"].get<double>(), 0.2);
  EXPECT_LT(details["histograms"]["error_mm"]["median"].get<double>(), 0.2);
  EXPECT_TRUE(ReadBlock(*reader->part("points")).header["arrays"].contains("distance"));
  options.sources.truth = "none.ply";
  EXPECT_THROW(PageData(root_, options), InputError);
}

TEST_F(Folder, ARigOfOtherPointsIsTold) {
  sample::write_output(root_, 1);
  static_cast<void>(report({}));
  EXPECT_THAT(last_.missing, Not(Contains(HasSubstr("json: "))));
  Rig other = sample::rig();
  for (Camera& camera : other.cameras) camera.K(0, 0) *= 1.2;
  write_rig(other, root_ / "other.json");
  PageOptions options;
  options.sources.rig = root_ / "other.json";
  static_cast<void>(report(options));
  EXPECT_THAT(last_.missing, Contains(HasSubstr("other.json: ")));
}

TEST_F(Folder, WhatBelongsToNoResultIsNoTruthAndNoCapture) {
  sample::write_output(root_ / "out", 2);
  fs::create_directories(root_ / "scene");
  PageOptions options;
  const auto data = [&] { return PageData(root_ / "out", options); };
  options.sources.truth = root_ / "scene";
  EXPECT_THAT(error_of(data), HasSubstr("scene: must be a mesh, or hold mesh.ply or <frame>/mesh"));
  options.sources.truth.clear();
  options.sources.frames = root_ / "scene";
  EXPECT_THAT(error_of(data), HasSubstr("scene: must hold <frame>/ with the pictures"));
  const std::string first = find_results(root_ / "out").results.at(0).name;
  fs::create_directories(root_ / "scene" / first);
  EXPECT_EQ(error_of(data), "");
  options.sources.truth = root_ / "scene";
  write_mesh(root_ / "scene" / first / "mesh.ply", sample::ball());
  const PageReport made = write_report(root_ / "out", root_ / "page.html", options, {});
  EXPECT_THAT(made.missing, Contains(HasSubstr("scene has no mesh of 1 (")));
  EXPECT_THAT(made.missing, Contains(HasSubstr("scene has no pictures of 1 (")));
}

}  // namespace
}  // namespace pencilscan
