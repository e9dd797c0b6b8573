// Open3D reads all of points.ply into tensors, and draws curves.ply as lines.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <open3d/geometry/LineSet.h>
#include <open3d/io/LineSetIO.h>
#include <open3d/t/geometry/PointCloud.h>
#include <open3d/t/io/PointCloudIO.h>

#include <filesystem>

#include "pencilscan/io/curve_file.h"
#include "pencilscan/labeling/point_file.h"

namespace pencilscan {
namespace {

std::string file(const char* name) {
  return (std::filesystem::path(::testing::TempDir()) / name).string();
}

TEST(Open3d, ReadsEveryPropertyOfPoints) {
  MeasuredPoint point{1, 2, 3, 40, 50, 5, 4, 1, 300, 0.25F, 0.5F, 300, 0, 0, 1, 10, 20, 255};
  const std::string path = file("open3d_points.ply");
  write_points(path, {point, point});
  open3d::t::geometry::PointCloud cloud;
  ASSERT_TRUE(open3d::t::io::ReadPointCloud(path, cloud));
  for (const char* name : {"u", "v", "camera", "projector", "pattern", "line", "sigma",
                           "confidence", "plane", "normals", "colors"})
    EXPECT_TRUE(cloud.HasPointAttr(name)) << name;
  EXPECT_EQ(cloud.GetPointAttr("line")[1][0].Item<int>(), 300);
  EXPECT_EQ(cloud.GetPointNormals()[1][2].Item<float>(), 1);
  EXPECT_EQ(cloud.GetPointColors()[1][2].Item<std::uint8_t>(), 255);
}

TEST(Open3d, ReadsCurvesAsLines) {
  CurveFile curves;
  curves.samples.resize(5);
  for (std::size_t i = 0; i < 5; ++i) {
    curves.samples[i].x = static_cast<float>(i);
    curves.samples[i].curve = i < 3 ? 0 : 1;
  }
  curves.crossings.resize(1);
  const std::string path = file("open3d_curves.ply");
  write_curves(path, curves);
  open3d::geometry::LineSet lines;
  ASSERT_TRUE(open3d::io::ReadLineSet(path, lines));
  EXPECT_EQ(lines.points_.size(), 5U);
  EXPECT_THAT(lines.lines_, ::testing::ElementsAre(Eigen::Vector2i(0, 1), Eigen::Vector2i(1, 2),
                                                   Eigen::Vector2i(3, 4)));
  EXPECT_EQ(lines.points_[3].x(), 3);
}

}  // namespace
}  // namespace pencilscan
