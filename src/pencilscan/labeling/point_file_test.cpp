#include "pencilscan/labeling/point_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "pencilscan/core/error.h"
#include "pencilscan/io/curve_file.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/temporary_folder.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

class PointFile : public ::testing::Test {
 protected:
  fs::path put(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }
  /// The error of reading a file; empty when nothing was thrown.
  static std::string error_of(const fs::path& path) {
    try {
      (void)read_points(path);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  fs::path folder_ = temporary_.path();
};

TEST_F(PointFile, CurvesOfPicturesAreNoPoints) {
  write_curves(folder_ / "curves.ply", {{CurveSample{}, CurveSample{}}, {}});
  EXPECT_THAT(error_of(folder_ / "curves.ply"), ::testing::HasSubstr("these are curves in pict"));
}

TEST_F(PointFile, PointsRoundTrip) {
  std::vector<MeasuredPoint> points(1000);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto f = static_cast<float>(i);
    points[i] = {f,
                 -f,
                 0.5F * f,
                 2 * f,
                 3 * f,
                 static_cast<std::uint8_t>(i % 6),
                 static_cast<std::uint8_t>(i % 5),
                 static_cast<std::uint8_t>(i % 2),
                 static_cast<std::uint16_t>(i * 60),
                 0.1F,
                 0.25F,
                 f + 0.25F};
  }
  write_points(folder_ / "p.ply", points);
  const auto back = read_points(folder_ / "p.ply");
  ASSERT_EQ(back.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(back[i].y, points[i].y);
    EXPECT_EQ(back[i].camera, points[i].camera);
    EXPECT_EQ(back[i].pattern, points[i].pattern);
    EXPECT_EQ(back[i].line, points[i].line);
    EXPECT_EQ(back[i].plane, points[i].plane);
  }
}

TEST_F(PointFile, PointsSayTheirUnit) {
  write_points(folder_ / "mm.ply", std::vector<MeasuredPoint>(1));
  write_points(folder_ / "any.ply", std::vector<MeasuredPoint>(1), false);
  EXPECT_THAT(read_file(folder_ / "mm.ply"),
              ::testing::HasSubstr("1.0\ncomment unit mm, world frame of rig.json\nelement"));
  EXPECT_THAT(read_file(folder_ / "any.ply"),
              ::testing::HasSubstr("1.0\ncomment unit unknown, world frame of rig.json\nelement"));
}

TEST_F(PointFile, PointsOfOtherOrderAndMorePropertiesAreRead) {
  const auto path = put("p.ply",
                        "ply\nformat ascii 1.0\nelement vertex 1\nproperty ushort line\n"
                        "property uchar red\nproperty int projector\nproperty uchar camera\n"
                        "property double x\nproperty double y\nproperty double z\n"
                        "property float v\nproperty float u\nend_header\n"
                        "7 255 2 1 1.5 2.5 3.5 20 10\n");
  const auto points = read_points(path);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(points[0].line, 7);
  EXPECT_EQ(points[0].projector, 2);
  EXPECT_EQ(points[0].camera, 1);
  EXPECT_EQ(points[0].u, 10);
  EXPECT_EQ(points[0].z, 3.5F);
  EXPECT_EQ(points[0].confidence, 1);
  EXPECT_EQ(points[0].plane, 7);
}

TEST_F(PointFile, BrokenPointFilesAreRejected) {
  write_points(folder_ / "p.ply", std::vector<MeasuredPoint>(10));
  fs::resize_file(folder_ / "p.ply", fs::file_size(folder_ / "p.ply") * 95 / 100);
  EXPECT_THAT(error_of(folder_ / "p.ply"), ::testing::HasSubstr("truncated"));
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\n";
  EXPECT_THAT(error_of(put("q.ply", header + "end_header\n1\n")),
              ::testing::HasSubstr("truncated"));
  EXPECT_THAT(error_of(put("r.ply",
                           "ply\nformat ascii 1.0\nelement vertex 0\n"
                           "property float x\nend_header\n")),
              ::testing::HasSubstr("y: the vertices must have this property"));
}

TEST_F(PointFile, SigmaAndConfidenceAreNumbersOfTheirRange) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 1\n"
      "property float x\nproperty float y\nproperty float z\nproperty float u\n"
      "property float v\nproperty uchar camera\nproperty uchar projector\nproperty int line\n"
      "property float sigma\nproperty float confidence\nend_header\n1 2 3 4 5 0 0 7 ";
  EXPECT_EQ(error_of(put("right.ply", header + "0.01 1\n")), "");
  EXPECT_THAT(error_of(put("nan.ply", header + "nan 1\n")),
              ::testing::HasSubstr("vertex[0].sigma"));
  EXPECT_THAT(error_of(put("below.ply", header + "-0.01 1\n")),
              ::testing::HasSubstr("vertex[0].sigma"));
  EXPECT_THAT(error_of(put("above.ply", header + "0.01 1.5\n")),
              ::testing::HasSubstr("vertex[0].confidence"));
}

}  // namespace
}  // namespace pencilscan
