#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <fstream>
#include <new>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/io/curve_file.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/found_files.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/linear_light.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/io/mosaic.h"
#include "pencilscan/io/partial_folder.h"
#include "pencilscan/io/ply.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/io/zarr_array.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

/// A folder of its own per test, removed afterwards.
class Io : public ::testing::Test {
 protected:
  fs::path put(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }
  void truncate(const fs::path& path, double share) {
    fs::resize_file(path, static_cast<std::uintmax_t>(share * double(fs::file_size(path))));
  }
  std::size_t file_count() {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(folder_), fs::directory_iterator{}));
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  fs::path folder_ = temporary_.path();
};

/// The one-line error of reading; empty when nothing was thrown.
template <class Read>
std::string error_of(Read read) {
  try {
    (void)read();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    return error.what();
  }
  return "";
}

cv::Mat test_image() {
  cv::Mat image(30, 40, CV_32FC3);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      image.at<cv::Vec3f>(y, x) = {float(x) / 39, float(y) / 29, float((x * 7 + y * 3) % 11) / 10};
    }
  }
  return image;
}

double max_difference(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF); }

TEST_F(Io, AtomicWriteReplacesAndLeavesNoTemporary) {
  write_text(folder_ / "deep/er/a.txt", "one");
  write_text(folder_ / "deep/er/a.txt", "two");
  EXPECT_EQ(read_file(folder_ / "deep/er/a.txt"), "two");
  folder_ /= "deep/er";
  EXPECT_EQ(file_count(), 1U);
  folder_ = folder_.parent_path().parent_path();
}

TEST_F(Io, AtomicWriteKeepsTheOldFileWhenTheWriterThrows) {
  write_text(folder_ / "a.txt", "old");
  EXPECT_THROW(write_atomically(folder_ / "a.txt",
                                [](std::ostream& stream) {
                                  stream << std::string(1 << 20, 'x');
                                  throw StageError("no");
                                }),
               StageError);
  EXPECT_EQ(read_file(folder_ / "a.txt"), "old");
  EXPECT_EQ(file_count(), 1U);
}

TEST_F(Io, AFileInTheMakingHasNoNameThatAKilledProgramCouldLeave) {
  const int unnamed = ::open(folder_.c_str(), O_WRONLY | O_TMPFILE, 0600);
  if (unnamed < 0) GTEST_SKIP() << "this file system has no files without names";
  ::close(unnamed);
  write_atomically(folder_ / "a.txt", [&](std::ostream& stream) {
    stream << std::string(1 << 20, 'x');
    EXPECT_EQ(file_count(), 0U);
  });
  EXPECT_EQ(fs::file_size(folder_ / "a.txt"), std::uintmax_t{1} << 20);
}

TEST_F(Io, APartialFolderStartsEmptyAndLeavesNothing) {
  const fs::path path = folder_ / "film.partial";
  write_text(path / "old.txt", "of a killed program");
  {
    const PartialFolder making(path);
    EXPECT_FALSE(fs::exists(path));
    write_text(making.path() / "new.txt", "whole");
    fs::rename(making.path() / "new.txt", folder_ / "new.txt");
  }
  EXPECT_EQ(file_count(), 1U);
}

TEST_F(Io, PixelsThatAreNoNumbersAreRefused) {
  cv::Mat image(4, 6, CV_32FC1, cv::Scalar::all(0.5));  // of three channels OpenCV rounds
  write_image(folder_ / "a.tiff", image);
  EXPECT_EQ(error_of([&] { return read_image(folder_ / "a.tiff"); }), "");
  for (const float wrong : {std::nanf(""), INFINITY, -INFINITY}) {
    image.at<float>(2, 5) = wrong;
    write_image(folder_ / "a.tiff", image);
    EXPECT_THAT(error_of([&] { return read_image(folder_ / "a.tiff"); }),
                ::testing::HasSubstr("a.tiff: pixel = 5 2: must be a finite number"));
  }
}

TEST_F(Io, WhatCannotBeReplacedIsAStageErrorAndLeavesNoTemporary) {
  fs::create_directories(folder_ / "taken" / "x");
  EXPECT_THROW(write_text(folder_ / "taken", "text"), StageError);
  EXPECT_THROW(write_text("/proc/none/a.txt", "text"), StageError);
  EXPECT_EQ(file_count(), 1U);
}

TEST_F(Io, AFullDiskIsAStageErrorAndKeepsTheOldFile) {
  write_text(folder_ / "a.png", "old");
  // A file size limit stands in for the full disk: write() fails half-way in the same manner.
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{10000, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  std::string message;
  try {
    write_text(folder_ / "a.png", std::string(100000, 'x'));
  } catch (const StageError& error) {
    message = error.what();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, old_handler);
  EXPECT_THAT(message, ::testing::HasSubstr("a.png: cannot be written"));
  EXPECT_EQ(read_file(folder_ / "a.png"), "old");
  EXPECT_EQ(file_count(), 1U);
}

TEST_F(Io, LackOfMemoryIsNotTheEndOfAFile) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the sanitizer itself takes more memory than the limit of this test";
#endif
  const fs::path path = put("large.bin", "");
  fs::resize_file(path, std::uintmax_t{1} << 28);
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_AS, &before), 0);
  const rlimit little{pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)) + (100U << 20),
                      before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_AS, &little), 0);
  EXPECT_THROW((void)read_file(path), std::bad_alloc);
  setrlimit(RLIMIT_AS, &before);
  EXPECT_EQ(read_file(path).size(), std::size_t{1} << 28);
}

TEST_F(Io, JsonErrorsNameTheFileAndThePlace) {
  const auto path = put("a.json", "{\"a\": NaN}");
  const std::string message = error_of([&] { return read_json(path); });
  EXPECT_THAT(message, ::testing::HasSubstr("a.json"));
  EXPECT_THAT(message, ::testing::HasSubstr("line 1"));
  EXPECT_THAT(error_of([&] { return read_json(put("b.json", "{\"k\": 1, \"k\": 2}")); }),
              ::testing::HasSubstr("k: this key must not stand twice"));
  EXPECT_THAT(error_of([&] { return read_json(folder_ / "none.json"); }),
              ::testing::HasSubstr("does not exist"));
  EXPECT_THAT(error_of([&] { return read_json(put("c.json", "")); }),
              ::testing::HasSubstr("c.json"));
}

TEST_F(Io, PngRoundTripKeepsRgbOrderAndDepth) {
  const cv::Mat image = test_image();
  for (const auto& [bits, step] : {std::pair{8, 1.0 / 255}, std::pair{16, 1.0 / 65535}}) {
    write_image(folder_ / "a.png", image, bits);
    const cv::Mat back = read_image(folder_ / "a.png");
    ASSERT_EQ(back.type(), CV_32FC3);
    // Rounding to the nearest step; float32 adds a little.
    EXPECT_LE(max_difference(back, image), 0.5 * step + 1e-6);
  }
}

TEST_F(Io, FloatTiffRoundTripIsExactAndGreyIsReplicated) {
  cv::Mat grey(5, 7, CV_32FC1);
  for (int i = 0; i < 35; ++i) grey.at<float>(i / 7, i % 7) = 0.01F * float(i) + 1e-6F;
  write_image(folder_ / "d.tiff", grey);
  const cv::Mat back = read_image(folder_ / "d.tiff");
  ASSERT_EQ(back.channels(), 3);
  cv::Mat channel;
  cv::extractChannel(back, channel, 2);
  EXPECT_EQ(max_difference(channel, grey), 0);
}

TEST_F(Io, TruncatedImagesAreRejectedAtEveryLength) {
  for (const char* name : {"a.png", "a.jpg", "a.bmp", "a.tiff"}) {
    for (const double share : {0.0, 0.01, 0.2, 0.5, 0.9, 0.99}) {
      write_image(folder_ / name, test_image());
      truncate(folder_ / name, share);
      const std::string message = error_of([&] { return read_image(folder_ / name); });
      EXPECT_THAT(message, ::testing::HasSubstr(name)) << share;
    }
  }
}

TEST_F(Io, WhatIsNoImageIsRejected) {
  EXPECT_THAT(error_of([&] { return read_image(put("a.png", "hello")); }),
              ::testing::HasSubstr("must be a PNG, TIFF, JPEG or BMP image"));
  EXPECT_THAT(error_of([&] { return read_image(folder_); }), ::testing::HasSubstr("folder"));
}

TEST_F(Io, FindImageTriesAllEndings) {
  EXPECT_FALSE(find_image(folder_, "cam0").has_value());
  put("cam0.jpeg", "x");
  EXPECT_EQ(find_image(folder_, "cam0"), folder_ / "cam0.jpeg");
}

TEST_F(Io, ImagesAreFoundWithEndingsInCapitals) {
  put("cam0.PNG", "x");
  put("CAM1.Jpeg", "x");
  EXPECT_EQ(find_image(folder_, "cam0"), folder_ / "cam0.PNG");
  EXPECT_EQ(find_image(folder_, "cam1"), std::nullopt);  // names are names
  EXPECT_EQ(find_image(folder_ / "none", "cam0"), std::nullopt);
}

TEST_F(Io, TwoImagesOfOneNameAreRefusedByName) {
  put("cam0.png", "x");
  put("cam0.jpg", "x");
  try {
    static_cast<void>(find_image(folder_, "cam0"));
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(error.value, "cam0.jpg and cam0.png");
  }
}

TEST_F(Io, HoldingsNameFilesBeforeFolders) {
  EXPECT_EQ(holdings(folder_), "it is empty");
  std::filesystem::create_directories(folder_ / "b");
  EXPECT_EQ(holdings(folder_), "it holds only folders: b");
  for (int i = 0; i < 7; ++i) put("IMG_" + std::to_string(i), "x");
  put(".hidden", "x");
  EXPECT_EQ(holdings(folder_), "it holds IMG_0, IMG_1, IMG_2, IMG_3 and 3 more");
}

TEST_F(Io, PlyElementsWithoutPropertiesHaveNoItems) {
  const fs::path file = put("a.ply",
                            "ply\nformat binary_little_endian 1.0\n"
                            "element vertex 1844674407370955161\nend_header\n");
  EXPECT_THAT(error_of([&] { return read_mesh(file); }),
              ::testing::HasSubstr("must have properties"));
}

TEST_F(Io, JsonThatIsNestedTooDeepIsRefused) {
  const auto nested = [](int levels) {
    return std::string(static_cast<std::size_t>(levels), '[') +
           std::string(static_cast<std::size_t>(levels), ']');
  };
  EXPECT_EQ(error_of([&] { return read_json(put("a.json", nested(150))); }), "");
  for (const int levels : {300, 1'000'000})
    EXPECT_THAT(error_of([&] { return read_json(put("a.json", nested(levels))); }),
                ::testing::HasSubstr("must not be nested deeper than 200 levels"));
}

/// Metadata of a Zarr array that is good but for one value.
std::string zarr_metadata(const std::string& key, const std::string& value) {
  nlohmann::ordered_json object = {{"zarr_format", 2},      {"shape", {2, 3}}, {"chunks", {2, 3}},
                                   {"dtype", "|u1"},        {"order", "C"},    {"filters", nullptr},
                                   {"compressor", nullptr}, {"fill_value", 0}};
  object[key] = nlohmann::ordered_json::parse(value);
  return object.dump();
}

TEST_F(Io, ZarrTakesNoMemoryThatItsFilesDoNotJustify) {
  put(".zarray", zarr_metadata("shape", "[2, 3]"));
  put("0.0", "abcdef");
  EXPECT_EQ(read_zarr_bytes(folder_, read_zarr_array(folder_)).size(), 6U);
  // 16 GB by the metadata, 6 bytes in the file, raw or compressed.
  put(".zarray", zarr_metadata("chunks", "[46340, 46340]"));
  const std::int64_t first[] = {0, 0};
  for (const ZarrCompression compression : {ZarrCompression::kNone, ZarrCompression::kZstd}) {
    ZarrArray array = read_zarr_array(folder_);
    array.type = ZarrType::kInt64;
    array.compression = compression;
    EXPECT_THAT(error_of([&] { return read_zarr_chunk(folder_, array, first).has_value(); }),
                ::testing::HasSubstr("it is damaged or of another size"));
  }
  // A file for each element: looking for them would take minutes.
  put(".zarray", R"({"zarr_format": 2, "shape": [40000, 40000], "chunks": [1, 1], "dtype": "|u1",
                     "order": "C", "filters": null, "compressor": null, "fill_value": 0})");
  EXPECT_THAT(error_of([&] { return read_zarr_bytes(folder_, read_zarr_array(folder_)).size(); }),
              ::testing::HasSubstr("must be at most 1,000,000 in all"));
}

TEST_F(Io, ZarrFillsWithValuesOfItsTypeOnly) {
  for (const char* value : {"256", "-1", "1e300", "\"NaN\""}) {
    put(".zarray", zarr_metadata("fill_value", value));
    EXPECT_THAT(error_of([&] { return read_zarr_array(folder_).fill_value; }),
                ::testing::HasSubstr("must be a value of dtype"))
        << value;
  }
  put(".zarray", zarr_metadata("fill_value", "null"));
  EXPECT_EQ(read_zarr_array(folder_).fill_value, 0);
}

TEST_F(Io, MeshRoundTripKeepsVerticesAndSigma) {
  TriangleMesh box = make_box({10, 20, 30});
  box.sigma.assign(box.vertices.size(), 0.5F);
  write_mesh(folder_ / "m.ply", box);
  const TriangleMesh back = read_mesh(folder_ / "m.ply");
  EXPECT_EQ(back.faces, box.faces);
  EXPECT_EQ(back.sigma, box.sigma);
  EXPECT_TRUE(back.confidence.empty());
  EXPECT_DOUBLE_EQ(signed_volume(back), 6000);
}

TEST_F(Io, MeshRoundTripKeepsReasonsOfHolesAndColors) {
  TriangleMesh box = make_box({10, 20, 30});
  for (std::size_t i = 0; i < box.vertices.size(); ++i) {
    box.hole.push_back(static_cast<std::uint8_t>(i));
    box.color.push_back({0.02F * static_cast<float>(i), 0.5F, 1.0F});
  }
  write_mesh(folder_ / "m.ply", box);
  const TriangleMesh back = read_mesh(folder_ / "m.ply");
  EXPECT_EQ(back.hole, box.hole);
  ASSERT_EQ(back.color.size(), box.color.size());
  constexpr float kHalfAStep = 0.0045F;  // of 8 bits, where sRGB is steepest in linear light
  for (std::size_t i = 0; i < box.color.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(back.color[i][k], box.color[i][k], kHalfAStep);
  }
}

TEST_F(Io, ObjStlAndOffGiveOneClosedTetrahedron) {
  const auto obj = put("t.obj",
                       "v 0 0 0\nv 6 0 0\nv 0 6 0\nv 0 0 6\nvn 0 0 1\nf 1//1 3//1 2//1\n"
                       "f 1 2 4\nf 1 4 3\nf 2 3 4\n");
  const auto off = put("t.off",
                       "OFF\n4 4 0\n0 0 0\n6 0 0\n0 6 0\n0 0 6\n3 0 2 1\n3 0 1 3\n"
                       "3 0 3 2\n3 1 2 3\n");
  std::string stl = "solid t\n";
  const char* corners[] = {"0 0 0", "6 0 0", "0 6 0", "0 0 6"};
  for (const auto& face : {std::array{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}) {
    stl += "facet normal 0 0 0\nouter loop\n";
    for (const int corner : face) stl += std::string("vertex ") + corners[corner] + "\n";
    stl += "endloop\nendfacet\n";
  }
  for (const auto& path : {obj, off, put("t.stl", stl + "endsolid t\n")}) {
    const TriangleMesh mesh = read_mesh(path);
    EXPECT_EQ(mesh.vertices.size(), 4U) << path;
    EXPECT_EQ(count_edges(mesh).boundary, 0U) << path;
    EXPECT_NEAR(signed_volume(mesh), 36, 1e-9) << path;
  }
}

TEST_F(Io, ExportedMeshesAreReadBack) {
  const TriangleMesh ball = make_sphere(30, 8, Vec3(5, 6, 7));
  for (const char* name : {"ball.obj", "ball.stl"}) {
    export_mesh(folder_ / name, ball);
    const TriangleMesh read = read_mesh(folder_ / name);
    EXPECT_EQ(read.vertices.size(), ball.vertices.size()) << name;
    EXPECT_EQ(count_edges(read).boundary, 0U) << name;
    // Five decimals in the text, floats in the binary file.
    EXPECT_NEAR(signed_volume(read), signed_volume(ball), 1e-4 * signed_volume(ball)) << name;
  }
  EXPECT_THROW(export_mesh(folder_ / "ball.xyz", ball), InputError);
}

TEST_F(Io, GlbIsInMetresWithYUp) {
  const TriangleMesh box = make_box(Vec3(100, 200, 300), Vec3(0, 0, 150));
  export_mesh(folder_ / "box.glb", box);
  const std::string bytes = read_file(folder_ / "box.glb");
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t k = 4; k-- > 0;)
      value = value << 8U | static_cast<std::uint8_t>(bytes[at + k]);
    return value;
  };
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2U);
  EXPECT_EQ(word(8), bytes.size());
  const std::uint32_t text = word(12);
  EXPECT_EQ(text % 4, 0U);
  const auto root = nlohmann::json::parse(bytes.substr(20, text));
  EXPECT_EQ(word(20 + text) % 4, 0U);
  const auto& position = root["accessors"][0];
  EXPECT_NEAR(position["max"][1].get<double>(), 0.3, 1e-6);  // world z
  EXPECT_NEAR(position["min"][1].get<double>(), 0, 1e-6);
  EXPECT_NEAR(position["max"][2].get<double>(), 0.1, 1e-6);  // world -y
  EXPECT_EQ(root["accessors"][2]["count"], 3 * box.faces.size());
  EXPECT_GE(root["buffers"][0]["byteLength"], 24 * box.vertices.size() + 12 * box.faces.size());
}

TEST_F(Io, UnusableMeshesAreRejected) {
  const std::string vertices =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face ";
  const std::string list = "\nproperty list uchar int vertex_indices\nend_header\n";
  EXPECT_THAT(error_of([&] {
                return read_mesh(put("a.ply", vertices + "0" + list + "0 0 0\n1 0 0\n0 1 0\n"));
              }),
              ::testing::HasSubstr("must have faces"));
  EXPECT_THAT(
      error_of([&] {
        return read_mesh(put("b.ply", vertices + "1" + list + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"));
      }),
      ::testing::HasSubstr("face[0] = 3"));
  EXPECT_THAT(
      error_of([&] {
        return read_mesh(put("c.ply", vertices + "1" + list + "0 0 0\nnan 0 0\n0 1 0\n3 0 1 2\n"));
      }),
      ::testing::HasSubstr("vertex[1]: coordinates must be finite"));
  EXPECT_NE(error_of([&] { return read_mesh(put("d.obj", "nothing here")); }), "");
  EXPECT_NE(error_of([&] { return read_mesh(put("e.txt", "x")); }), "");
}

TEST_F(Io, CurvesComeBackAsWritten) {
  CurveFile curves;
  for (int i = 0; i < 3; ++i) {
    CurveSample sample;
    sample.u = 10.25F + static_cast<float>(i);
    sample.v = 7.5F;
    sample.sigma_px = 0.07F;
    sample.amplitude = 0.4F;
    sample.camera = 5;
    sample.curve = 70'000;
    sample.family = 1;
    sample.color = 1;
    sample.color_lead = 3.5F;
    sample.state = static_cast<CurveState>(i);
    sample.projector = 4;
    sample.pattern = 1;
    sample.line = 300;
    sample.confidence = 0.875F;
    curves.samples.push_back(sample);
  }
  curves.crossings.push_back({1.5F, 2.5F, 5, 3, 70'000});
  write_curves(folder_ / "curves.ply", curves);
  const CurveFile read = read_curves(folder_ / "curves.ply");
  ASSERT_EQ(read.samples.size(), 3U);
  const CurveSample& last = read.samples[2];
  EXPECT_EQ(last.u, 12.25F);
  EXPECT_EQ(last.sigma_px, 0.07F);
  EXPECT_EQ(last.amplitude, 0.4F);
  EXPECT_EQ(last.camera, 5);
  EXPECT_EQ(last.curve, 70'000U);
  EXPECT_EQ(last.family, 1);
  EXPECT_EQ(last.color_lead, 3.5F);
  EXPECT_EQ(last.state, CurveState::kAmbiguous);
  EXPECT_EQ(last.projector, 4);
  EXPECT_EQ(last.line, 300);
  EXPECT_EQ(last.confidence, 0.875F);
  ASSERT_EQ(read.crossings.size(), 1U);
  EXPECT_EQ(read.crossings[0].curve_b, 70'000U);
  const PlyFile file = read_ply(folder_ / "curves.ply");
  const PlyElement* edges = file.find("edge");
  ASSERT_NE(edges, nullptr);
  EXPECT_THAT(edges->find("vertex1")->values, ::testing::ElementsAre(0, 1));
  EXPECT_THAT(edges->find("vertex2")->values, ::testing::ElementsAre(1, 2));
}

TEST_F(Io, CurvesWithStatesThatDoNotExistAreRefused) {
  CurveFile curves;
  curves.samples.resize(1);
  curves.samples[0].state = static_cast<CurveState>(9);
  write_curves(folder_ / "curves.ply", curves);
  EXPECT_THAT(error_of([&] { return read_curves(folder_ / "curves.ply"); }),
              ::testing::HasSubstr("vertex[0].state"));
  write_mesh(folder_ / "box.ply", make_box({1, 1, 1}));
  EXPECT_THAT(error_of([&] { return read_curves(folder_ / "box.ply"); }),
              ::testing::HasSubstr("`crossing`"));
}

}  // namespace
TEST(LinearLight, BlackIsTakenOutBeforeGamma) {
  cv::Mat image(1, 4, CV_32FC1);
  const float values[] = {0.05F, 0.1F, 0.55F, 1};
  std::copy_n(values, 4, image.ptr<float>());
  const cv::Mat light = linearized(image, 2, 0.1);
  const float expected[] = {0, 0, 0.25F, 1};
  for (int x = 0; x < 4; ++x) EXPECT_NEAR(light.at<float>(x), expected[x], 1e-6F);
  EXPECT_EQ(linearized(image, 1).data, image.data);
}

TEST(LinearLight, LeavesTheImageAsItIs) {
  for (const double black : {0.0, 0.1}) {
    const cv::Mat image(2, 2, CV_32FC3, cv::Scalar::all(0.5));
    static_cast<void>(linearized(image, 2.2, black));
    EXPECT_EQ(cv::norm(image, cv::Mat(2, 2, CV_32FC3, cv::Scalar::all(0.5)), cv::NORM_INF), 0);
  }
}

TEST(Mosaic, NamesSayWhatThePixelsSee) {
  for (const std::string name : {"RGGB", "BGGR", "GRBG", "GBRG"}) {
    const auto mosaic = Mosaic::from_name(name);
    ASSERT_TRUE(mosaic);
    EXPECT_EQ(mosaic->name(), name);
    for (int i = 0; i < 4; ++i)
      EXPECT_EQ("RGB"[mosaic->color(2 + i % 2, 4 + i / 2)], name[static_cast<std::size_t>(i)]);
  }
  EXPECT_FALSE(Mosaic::from_name("RGBG"));
}

/// Linear interpolation is exact where each colour is a plane, up to the border, where it mirrors.
TEST(Mosaic, PlanesOfColourComeBack) {
  cv::Mat image(11, 14, CV_32FC3);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const auto u = static_cast<float>(x);
      const auto v = static_cast<float>(y);
      image.at<cv::Vec3f>(y, x) = {0.1F + 0.01F * u, 0.5F - 0.02F * v, 0.3F + 0.01F * (u - v)};
    }
  }
  for (const char* name : {"RGGB", "BGGR", "GRBG", "GBRG"}) {
    const Mosaic mosaic = *Mosaic::from_name(name);
    const cv::Mat raw = sampled(image, mosaic);
    const cv::Mat back = demosaiced(raw, mosaic);
    EXPECT_EQ(cv::norm(sampled(back, mosaic), raw, cv::NORM_INF), 0);
    const cv::Rect inner(1, 1, image.cols - 2, image.rows - 2);
    EXPECT_LT(cv::norm(back(inner), image(inner), cv::NORM_INF), 1e-6);
  }
}

}  // namespace pencilscan
