#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/sample_frame.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {
namespace {

// A sheet with a round hole, through which nothing is seen, and a disc of dark paint.
constexpr double kHalfSheet = 80;  // mm, of its side

Rig rig_before_sheet() {
  RingOptions ring = sample::small_ring();
  ring.cameras = ring.projectors = 3;
  ring.arc_rad = 1.2;
  return make_ring(ring);
}

struct Sheet {
  Vec3 normal, x, y;
  double radius;  ///< of hole and disc
  Vec3 hole, disc;

  explicit Sheet(const Rig& rig) : normal(Vec3::Zero()) {
    for (const Camera& camera : rig.cameras) normal += camera.center().normalized();
    normal.normalize();
    x = normal.cross(Vec3::UnitZ()).normalized();
    y = normal.cross(x);
    radius = 1.5 * line_spacing(rig);
    hole = 35 * x;
    disc = -35 * x;
  }
  [[nodiscard]] TriangleMesh mesh() const {
    constexpr int kCells = 160;
    const double half = kHalfSheet / kCells;
    TriangleMesh all;
    for (int i = 0; i < kCells; ++i) {
      for (int k = 0; k < kCells; ++k) {
        const Vec3 at = (2 * i + 1 - kCells) * half * x + (2 * k + 1 - kCells) * half * y;
        if ((at - hole).norm() > radius) sample::add_square(at, half * x, half * y, all);
      }
    }
    return all;
  }
};

/// A twelfth of the light comes from the disc: paint that is as dark as a photographer's black.
Frame frame_of_sheet(const Rig& rig, const Sheet& sheet) {
  PhotographyOptions photo;
  photo.noise = "medium";
  Reflectance paint;
  Frame frame = sample::photographed_frame(rig, SimulatedObject(sheet.mesh(), paint), photo);
  paint.albedo /= 12;
  const Frame dark = sample::photographed_frame(rig, SimulatedObject(sheet.mesh(), paint), photo);
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    for (int v = 0; v < frame.images[c].rows; ++v) {
      for (int u = 0; u < frame.images[c].cols; ++u) {
        const Ray ray = rig.cameras[c].ray({u, v});
        const double way = -ray.origin.dot(sheet.normal) / ray.direction.dot(sheet.normal);
        if ((ray.origin + way * ray.direction - sheet.disc).norm() < sheet.radius)
          frame.images[c].at<cv::Vec3f>(v, u) = dark.images[c].at<cv::Vec3f>(v, u);
      }
    }
  }
  return frame;
}

std::size_t vertices_within(const TriangleMesh& mesh, const Vec3& center, double radius) {
  return static_cast<std::size_t>(
      std::count_if(mesh.vertices.begin(), mesh.vertices.end(),
                    [&](const Vec3& v) { return (v - center).norm() < radius; }));
}

TEST(SheetWithHole, IsMeasuredOnDarkPaintButNotInTheHole) {
  const Rig rig = rig_before_sheet();
  const Sheet sheet(rig);
  const FrameResult result = reconstruct_frame(rig, frame_of_sheet(rig, sheet));
  const TriangleMesh& measured = result.shape.surface.measured;
  const double inside = 0.75 * sheet.radius;
  EXPECT_EQ(vertices_within(measured, sheet.hole, inside), 0U);
  const std::size_t of_paint = vertices_within(measured, sheet.disc, inside);
  EXPECT_GT(of_paint, 10U);
  // Not at the cost of its rim.
  EXPECT_GT(vertices_within(measured, sheet.hole, sheet.radius + 8),
            vertices_within(measured, sheet.disc, sheet.radius + 8) / 3);
  const TriangleMesh& closed = result.shape.surface.mesh;
  std::size_t bridging = 0, with_depth = 0, unlit = 0;
  for (std::size_t v = 0; v < closed.vertices.size(); ++v) {
    const Vec3& x = closed.vertices[v];
    if (!((x - sheet.hole).norm() < inside) || std::abs(x.dot(sheet.normal)) > 2) continue;
    ++bridging;
    with_depth += closed.hole[v] == static_cast<std::uint8_t>(HoleReason::kMeasured) ? 1 : 0;
    unlit += closed.hole[v] == static_cast<std::uint8_t>(HoleReason::kNoProjector) ? 1 : 0;
  }
  EXPECT_LE(10 * with_depth, bridging);
  EXPECT_GE(2 * unlit, bridging);
}

}  // namespace
}  // namespace pencilscan
