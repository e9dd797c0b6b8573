#include "pencilscan/surface/surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <numbers>

#include "pencilscan/core/error.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/random.h"
#include "pencilscan/surface/holes.h"
#include "pencilscan/surface/manifold.h"
#include "pencilscan/surface/mesh_parts.h"
#include "pencilscan/surface/node_surface.h"
#include "pencilscan/surface/point_grid.h"
#include "pencilscan/surface/untangle.h"
#include "pencilscan/surface/vertex_color.h"

namespace pencilscan {
namespace {

constexpr double kRadius = 45;     // mm
constexpr double kDistance = 900;  // mm, of the devices from the centre
constexpr double kNoise = 0.1;     // mm along the camera ray
constexpr float kSigma = 0.1F;

Device device_at(const Vec3& direction, const std::string& name) {
  Device device;
  device.name = name;
  device.width = 640;
  device.height = 640;
  device.K << 2400, 0, 319.5, 0, 2400, 319.5, 0, 0, 1;
  device.device_from_world = look_at(kDistance * direction.normalized(), Vec3::Zero());
  return device;
}

/// Five cameras and five projectors all around; projectors alternate between line directions.
Rig ball_rig() {
  Rig rig;
  const std::vector<Vec3> directions = {{1, 0, 0.1},  {0.1, 1, 0.2}, {-1, 0.1, 0},
                                        {0, -1, 0.2}, {0.2, 0.1, 1}, {0.1, 0.2, -1}};
  for (std::size_t i = 0; i < directions.size(); ++i) {
    Camera camera;
    static_cast<Device&>(camera) = device_at(directions[i], "cam" + std::to_string(i));
    rig.cameras.push_back(camera);
    Projector projector;
    const Mat3 turn = Eigen::AngleAxisd(0.5, Vec3(0.3, 0.2, 1).normalized()).toRotationMatrix();
    static_cast<Device&>(projector) = device_at(turn * directions[i], "proj" + std::to_string(i));
    LinePattern pattern;
    pattern.pitch_px = 10;
    pattern.axis = i % 2 == 0 ? Axis::kColumn : Axis::kRow;
    projector.patterns.push_back(pattern);
    rig.projectors.push_back(projector);
  }
  return rig;
}

std::optional<Vec3> hit_ball(const Ray& ray) {
  const double b = ray.origin.dot(ray.direction);
  const double d = b * b - ray.origin.squaredNorm() + kRadius * kRadius;
  if (d < 0) return std::nullopt;
  return ray.origin + (-b - std::sqrt(d)) * ray.direction;
}

/// What noisy cameras would measure of the ball: along each line of each projector, every point
/// that a camera sees at less than 72 degrees.
std::vector<MeasuredPoint> ball_points(const Rig& rig, std::uint64_t seed = 1) {
  std::vector<MeasuredPoint> points;
  Random random(seed);
  for (std::size_t k = 0; k < rig.projectors.size(); ++k) {
    const Projector& projector = rig.projectors[k];
    const LinePattern& pattern = projector.patterns[0];
    for (int line = 0; line < projector.line_count(pattern); ++line) {
      for (int along = 0; along < 640; along += 3) {
        const double c = pattern.position_px(line);
        const Vec2 pixel = pattern.axis == Axis::kColumn ? Vec2(c, along) : Vec2(along, c);
        const auto x = hit_ball(projector.ray(pixel));
        if (!x || x->normalized().dot((projector.center() - *x).normalized()) < 0.3) continue;
        for (std::size_t camera = 0; camera < rig.cameras.size(); ++camera) {
          const Vec3 to_camera = (rig.cameras[camera].center() - *x).normalized();
          if (x->normalized().dot(to_camera) < 0.3) continue;
          const Vec3 seen = *x + kNoise * random.normal() * to_camera;
          const auto uv = rig.cameras[camera].project(seen);
          MeasuredPoint p;
          p.x = static_cast<float>(seen.x());
          p.y = static_cast<float>(seen.y());
          p.z = static_cast<float>(seen.z());
          p.u = static_cast<float>((*uv)[0]);
          p.v = static_cast<float>((*uv)[1]);
          p.camera = static_cast<std::uint8_t>(camera);
          p.projector = static_cast<std::uint8_t>(k);
          p.line = static_cast<std::uint16_t>(line);
          p.plane = static_cast<float>(line);
          p.sigma = kSigma;
          p.confidence = 1;
          points.push_back(p);
        }
      }
    }
  }
  return points;
}

/// Moves pieces of curves (camera, projector, line) along their camera rays by 8 to 30 mm, as a
/// wrong line label does.
void mislabel(const Rig& rig, double share, std::vector<MeasuredPoint>& points) {
  for (MeasuredPoint& p : points) {
    const std::uint64_t piece = (((p.camera * 64ULL + p.projector) * 1024ULL) + p.line) * 64ULL +
                                static_cast<std::uint64_t>(p.v / 40);
    Random random(7, piece);
    if (random.uniform() >= share) continue;
    const double shift = random.uniform(8, 30) * (random.uniform() < 0.5 ? -1 : 1);
    const Vec3 x(p.x, p.y, p.z);
    const Vec3 moved = x + shift * (rig.cameras[p.camera].center() - x).normalized();
    p.x = static_cast<float>(moved.x());
    p.y = static_cast<float>(moved.y());
    p.z = static_cast<float>(moved.z());
  }
}

/// Coarser than the default: the ball needs no finer cells, and the tests run under sanitizers.
SurfaceOptions test_options() {
  SurfaceOptions options;
  options.cell_spacings = 0.5;
  return options;
}

double worst_deviation(const TriangleMesh& mesh) {
  double worst = 0;
  for (const Vec3& v : mesh.vertices) worst = std::max(worst, std::abs(v.norm() - kRadius));
  return worst;
}

double share_beyond(const TriangleMesh& mesh, double limit_mm) {
  std::size_t count = 0;
  for (const Vec3& v : mesh.vertices) count += std::abs(v.norm() - kRadius) > limit_mm;
  return static_cast<double>(count) / static_cast<double>(mesh.vertices.size());
}

bool equal_bytes(const TriangleMesh& a, const TriangleMesh& b) {
  const auto same = [](const auto& x, const auto& y) {
    return x.size() == y.size() &&
           (x.empty() || std::memcmp(x.data(), y.data(), x.size() * sizeof(x[0])) == 0);
  };
  return same(a.vertices, b.vertices) && same(a.faces, b.faces) && same(a.sigma, b.sigma) &&
         same(a.confidence, b.confidence);
}

void expect_watertight(const SurfaceResult& result) {
  EXPECT_EQ(result.report.status, SurfaceStatus::kDone);
  const EdgeCounts edges = count_edges(result.mesh);
  EXPECT_EQ(edges.boundary, 0u);
  EXPECT_EQ(edges.non_manifold, 0u);
  EXPECT_GT(signed_volume(result.mesh), 0);
}

TEST(Surface, BallIsClosedAndAccurate) {
  const Rig rig = ball_rig();
  const std::vector<MeasuredPoint> points = ball_points(rig);
  const SurfaceResult result = reconstruct_surface(rig, points, test_options());
  expect_watertight(result);
  // Three sigma of the noise, which the fit averages down except at the rims.
  EXPECT_LT(worst_deviation(result.mesh), 0.3);
  const double volume = 4.0 / 3 * std::numbers::pi * std::pow(kRadius, 3);
  EXPECT_NEAR(signed_volume(result.mesh) / volume, 1, 0.005);
  EXPECT_GT(result.report.measured_share, 0.98);
  EXPECT_GT(result.report.points_used, points.size() * 99 / 100);
}

TEST(Surface, SameBytesForAnyThreadCount) {
  const Rig rig = ball_rig();
  std::vector<MeasuredPoint> points = ball_points(rig);
  std::erase_if(points, [](const MeasuredPoint& p) { return p.projector > 2; });
  std::vector<SurfaceResult> results;
  for (const int threads : {1, 2, 4}) {
    const ThreadLimit limit(threads);
    results.push_back(reconstruct_surface(rig, points, test_options()));
  }
  ASSERT_FALSE(results[0].measured.faces.empty());
  for (std::size_t i = 1; i < results.size(); ++i) {
    EXPECT_TRUE(equal_bytes(results[0].mesh, results[i].mesh));
    EXPECT_TRUE(equal_bytes(results[0].measured, results[i].measured));
  }
}

TEST(Surface, WrongLabelsAreVotedOut) {
  const Rig rig = ball_rig();
  std::vector<MeasuredPoint> points = ball_points(rig);
  const std::vector<MeasuredPoint> truth = points;
  mislabel(rig, 0.15, points);
  const SurfaceResult result = reconstruct_surface(rig, points, test_options());
  expect_watertight(result);
  // The few wrong pieces that stay bend the surface here and there, by far less than they are off.
  EXPECT_LT(worst_deviation(result.mesh), 1.5);
  EXPECT_LT(share_beyond(result.mesh, 0.3), 0.02);
  std::size_t wrong = 0;
  std::size_t wrong_used = 0;
  std::size_t right_used = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool moved = points[i].x != truth[i].x;
    wrong += moved;
    wrong_used += moved && result.used[i];
    right_used += !moved && result.used[i];
  }
  EXPECT_LT(wrong_used, wrong / 30);
  EXPECT_GT(right_used, (points.size() - wrong) * 95 / 100);
}

TEST(Surface, HalfBallIsMeasuredHalfAndClosed) {
  const Rig rig = ball_rig();
  std::vector<MeasuredPoint> points = ball_points(rig);
  std::erase_if(points, [](const MeasuredPoint& p) { return p.x < 0; });
  const SurfaceResult result = reconstruct_surface(rig, points, test_options());
  expect_watertight(result);
  const double half = 2 * std::numbers::pi * kRadius * kRadius;
  // The rim lies within one line spacing (3.8 mm) of the last points: 8 % of the half's height.
  EXPECT_NEAR(surface_area(result.measured) / half, 1, 0.08);
  EXPECT_GT(count_edges(result.measured).boundary, 0u);
  for (const Vec3& v : result.measured.vertices) EXPECT_GT(v.x(), -6);
  double guessed = 0;
  for (std::size_t v = 0; v < result.mesh.vertices.size(); ++v) {
    if (result.mesh.vertices[v].x() < -10) {
      EXPECT_EQ(result.mesh.confidence[v], 0.0F);
      EXPECT_GT(result.mesh.sigma[v], 1.0F);
      ++guessed;
    }
  }
  EXPECT_GT(guessed, 100);
}

TEST(Surface, TwoCamerasAndOneProjectorGiveAClosedSurface) {
  Rig rig = ball_rig();
  std::vector<MeasuredPoint> points = ball_points(rig);
  std::erase_if(points, [](const MeasuredPoint& p) { return p.camera > 1 || p.projector != 0; });
  const SurfaceResult result = reconstruct_surface(rig, points, test_options());
  EXPECT_EQ(count_edges(result.mesh).boundary, 0u);
  EXPECT_LT(worst_deviation(result.measured), 1.0);
  EXPECT_GT(surface_area(result.measured), 0.15 * surface_area(result.mesh));
}

TEST(Surface, FarFloatersNeitherStayNorStretchTheCube) {
  const Rig rig = ball_rig();
  std::vector<MeasuredPoint> points = ball_points(rig);
  const std::size_t count = points.size();
  for (std::size_t i = 0; i < count; i += 400) {  // agreeing wrong patches, 2000 mm off
    MeasuredPoint p = points[i];
    p.x += 2000;
    points.push_back(p);
  }
  const SurfaceResult result = reconstruct_surface(rig, points, test_options());
  expect_watertight(result);
  EXPECT_LT(worst_deviation(result.mesh), 0.5);
  for (std::size_t i = count; i < points.size(); ++i) EXPECT_EQ(result.used[i], 0);
}

TEST(Surface, TooFewPointsIsAStatus) {
  const Rig rig = ball_rig();
  const std::vector<MeasuredPoint> points = ball_points(rig);
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{20}}) {
    const SurfaceResult result = reconstruct_surface(rig, std::span(points).first(count));
    EXPECT_EQ(result.report.status, SurfaceStatus::kTooFewPoints);
    EXPECT_TRUE(result.mesh.faces.empty());
    EXPECT_FALSE(result.report.warnings.empty());
  }
}

TEST(Surface, BadPointsAreLeftOutOrNamed) {
  const Rig rig = ball_rig();
  std::vector<MeasuredPoint> points = ball_points(rig);
  points.resize(10);
  points[3].x = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(reconstruct_surface(rig, points).report.points, 9u);
  points[4].camera = 77;
  EXPECT_THROW(static_cast<void>(reconstruct_surface(rig, points)), InputError);
}

/// What cameras would measure densely of the ball: quadrics with noise, nodes 4 px apart.
std::vector<DepthMap> ball_maps(const Rig& rig, double noise = kNoise) {
  std::vector<DepthMap> maps;
  Random random(3);
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const Camera& camera = rig.cameras[c];
    DepthMap map;
    map.camera = static_cast<int>(c);
    map.columns = map.rows = (camera.width - 1) / map.stride + 1;
    map.nodes.resize(static_cast<std::size_t>(map.columns * map.rows));
    for (std::size_t i = 0; i < map.nodes.size(); ++i) {
      const Vec2 pixel = map.pixel(i);
      const auto inverse_depth = [&](const Vec2& at) -> double {
        const auto x = hit_ball(camera.ray(at));
        return x ? 1 / (camera.device_from_world * *x).z() : 0;
      };
      const auto x = hit_ball(camera.ray(pixel));
      if (!x || x->normalized().dot((camera.center() - *x).normalized()) < 0.3) continue;
      const double z = 1 / inverse_depth(pixel) + noise * random.normal();
      map.nodes[i].w = static_cast<float>(1 / z);
      const double left = inverse_depth(pixel - Vec2(1, 0));
      const double right = inverse_depth(pixel + Vec2(1, 0));
      const double above = inverse_depth(pixel - Vec2(0, 1));
      const double below = inverse_depth(pixel + Vec2(0, 1));
      const double across = inverse_depth(pixel + Vec2(1, 1)) - inverse_depth(pixel + Vec2(1, -1)) -
                            inverse_depth(pixel + Vec2(-1, 1)) + inverse_depth(pixel - Vec2(1, 1));
      map.nodes[i].wx = static_cast<float>((right - left) / 2);
      map.nodes[i].wy = static_cast<float>((below - above) / 2);
      map.nodes[i].wxx = static_cast<float>(left + right - 2 * inverse_depth(pixel));
      map.nodes[i].wyy = static_cast<float>(above + below - 2 * inverse_depth(pixel));
      map.nodes[i].wxy = static_cast<float>(across / 4);
      map.nodes[i].sigma = kSigma;
      map.nodes[i].confidence = 1;
      map.nodes[i].reason = HoleReason::kMeasured;
    }
    maps.push_back(map);
  }
  return maps;
}

TEST(SelfIntersections, AreFound) {
  EXPECT_TRUE(self_intersections(make_sphere(20, 16)).empty());
  TriangleMesh two = make_sphere(20, 16);
  const TriangleMesh other = make_sphere(20, 16, Vec3(15, 1, 2));
  const int shift = static_cast<int>(two.vertices.size());
  two.vertices.insert(two.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const auto& face : other.faces)
    two.faces.push_back({face[0] + shift, face[1] + shift, face[2] + shift});
  EXPECT_GT(self_intersections(two).size(), 10U);
}

TEST(SelfIntersections, AreTakenBackAndNothingElse) {
  TriangleMesh mesh = make_sphere(20, 24);
  const std::vector<Vec3> before = mesh.vertices;
  // A dent that comes out on the other side, and a small bulge far from it.
  std::size_t bulge = 0;
  for (std::size_t v = 0; v < before.size(); ++v) {
    if (before[v].x() > 19) mesh.vertices[v].x() -= 45;
    if (before[v].z() > before[bulge].z()) bulge = v;
  }
  mesh.vertices[bulge].z() += 1;
  ASSERT_FALSE(self_intersections(mesh).empty());
  EXPECT_EQ(untangle(before, mesh), 0U);
  EXPECT_TRUE(self_intersections(mesh).empty());
  EXPECT_NEAR(mesh.vertices[bulge].z(), before[bulge].z() + 1, 1e-5);
}

/// Closed and followed, without guided depth in between.
SurfaceResult surface_of(const Rig& rig, std::span<const MeasuredPoint> points,
                         std::span<const DepthMap> maps, const FusionOptions& options = {}) {
  SurfaceResult result = close_depth(rig, maps, options);
  follow_depth(rig, maps, options, result);
  finish_surface(rig, points, maps, options, result);
  return result;
}

TEST(FuseDepth, BallIsClosedAndAccurate) {
  const Rig rig = ball_rig();
  const std::vector<MeasuredPoint> points = ball_points(rig);
  FusionOptions options;
  options.cell_spacings = 2;  // the ball needs no finer cells
  const SurfaceResult result = surface_of(rig, points, ball_maps(rig), options);
  expect_watertight(result);
  EXPECT_LT(worst_deviation(result.mesh), 0.3);  // three sigma of the noise
  EXPECT_LT(share_beyond(result.mesh, 0.1), 0.1);
  EXPECT_GT(result.report.measured_share, 0.97);
  EXPECT_TRUE(self_intersections(result.mesh).empty());
  EXPECT_GT(result.report.points_used, points.size() * 9 / 10);
}

TEST(FollowNodes, VerticesReachACurvedSurface) {
  const Rig rig = ball_rig();
  TriangleMesh mesh = make_sphere(kRadius + 0.5, 24);
  follow_nodes(rig, ball_maps(rig, 0), {}, mesh);
  // What is left is the third order of a ball over two nodes; a mean of positions would leave 0.04.
  for (const Vec3& v : mesh.vertices) EXPECT_NEAR(v.norm(), kRadius, 0.02);
}

TEST(FollowNodes, SlippedNodesDoNotPull) {
  const Rig rig = ball_rig();
  std::vector<DepthMap> maps = ball_maps(rig, 0);
  Random random(7);
  for (DepthMap& map : maps) {
    for (DepthNode& node : map.nodes) {
      if (node.measured() && random.uniform() < 0.1) node.w = 1 / (1 / node.w - 0.9F);
    }
  }
  TriangleMesh mesh = make_sphere(kRadius + 0.2, 24);
  follow_nodes(rig, maps, {}, mesh);
  double sum = 0;
  for (const Vec3& v : mesh.vertices) sum += std::abs(v.norm() - kRadius);
  // A plain mean would be off by a tenth of the slip.
  EXPECT_LT(sum / static_cast<double>(mesh.vertices.size()), 0.03);
}

TEST(FollowNodes, NoStepWhereDepthEnds) {
  const Rig rig = ball_rig();
  std::vector<DepthMap> maps = ball_maps(rig, 0);
  for (DepthMap& map : maps) {
    const Camera& camera = rig.cameras[static_cast<std::size_t>(map.camera)];
    for (std::size_t i = 0; i < map.nodes.size(); ++i) {
      const auto x = hit_ball(camera.ray(map.pixel(i)));
      if (x && x->x() < 0) map.nodes[i] = DepthNode{};
    }
  }
  constexpr double kOff = 0.4;
  TriangleMesh mesh = make_sphere(kRadius + kOff, 48);
  follow_nodes(rig, maps, {}, mesh);
  for (const auto& face : mesh.faces) {
    const double a = mesh.vertices[static_cast<std::size_t>(face[0])].norm();
    const double b = mesh.vertices[static_cast<std::size_t>(face[1])].norm();
    EXPECT_LT(std::abs(a - b), 0.5 * kOff);
  }
  // It did follow where depth is, and stayed where none is near.
  const auto [nearest, farthest] =
      std::minmax_element(mesh.vertices.begin(), mesh.vertices.end(),
                          [](const Vec3& a, const Vec3& b) { return a.norm() < b.norm(); });
  EXPECT_NEAR(nearest->norm(), kRadius, 0.1 * kOff);
  EXPECT_GT(farthest->norm(), kRadius + 0.5 * kOff);
}

TEST(FuseDepth, TooFewDepthsIsAStatus) {
  const Rig rig = ball_rig();
  std::vector<DepthMap> maps = ball_maps(rig);
  for (DepthMap& map : maps) map.nodes.assign(map.nodes.size(), DepthNode{});
  const SurfaceResult result = surface_of(rig, ball_points(rig), maps);
  EXPECT_EQ(result.report.status, SurfaceStatus::kTooFewPoints);
}

TEST(Holes, ReasonsFollowFromWhoSeesAndWhoLights) {
  Rig rig = ball_rig();
  // One camera and one projector on the +x side, none that sees or lights -x.
  rig.cameras.resize(1);
  rig.projectors.resize(1);
  rig.projectors[0].device_from_world = look_at(kDistance * Vec3(0.7, 0.7, 0), Vec3::Zero());
  TriangleMesh ball = make_sphere(kRadius, 48);
  ball.confidence.assign(ball.vertices.size(), 0.F);
  DepthMap map;
  map.columns = map.rows = 160;
  map.nodes.resize(160 * 160);
  map.nodes[map.index(80, 80)].reason = HoleReason::kContradicted;
  std::vector<DepthMap> maps = {map};
  const HoleReport report = explain_holes(rig, RayScene(ball), maps);
  double total = 0;
  for (const double area : report.area_mm2) total += area;
  EXPECT_NEAR(total, surface_area(ball), 1e-6 * total);
  for (std::size_t v = 0; v < ball.vertices.size(); ++v) {
    const Vec3 n = ball.vertices[v].normalized();
    const double to_camera = n.dot((rig.cameras[0].center() - ball.vertices[v]).normalized());
    const double to_light = n.dot((rig.projectors[0].center() - ball.vertices[v]).normalized());
    if (to_camera < -0.05) {
      EXPECT_EQ(report.vertices[v], HoleReason::kNotSeen);
    } else if (to_camera > 0.3 && to_light < 0.1) {
      EXPECT_EQ(report.vertices[v], HoleReason::kNoProjector);
    } else if (to_camera > 0.5 && to_light > 0.5) {
      EXPECT_TRUE(report.vertices[v] == HoleReason::kOneProjector ||
                  report.vertices[v] == HoleReason::kContradicted);
    }
  }
  // What the depth stage found stays; rays past the ball are background.
  EXPECT_EQ(maps[0].nodes[map.index(80, 80)].reason, HoleReason::kContradicted);
  EXPECT_EQ(maps[0].nodes[0].reason, HoleReason::kBackground);
}

TEST(Silhouettes, InventedBulgeIsDrawnIn) {
  Rig rig = ball_rig();
  rig.cameras.pop_back();  // nobody sees it from below
  std::vector<Silhouette> silhouettes;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    cv::Mat image(rig.cameras[c].height, rig.cameras[c].width, CV_32FC3, cv::Scalar::all(0.01));
    for (int v = 0; v < image.rows; ++v) {
      for (int u = 0; u < image.cols; ++u) {
        if (hit_ball(rig.cameras[c].ray(Vec2(u, v)))) image.at<cv::Vec3f>(v, u)[1] = 0.5F;
      }
    }
    silhouettes.push_back(silhouette(static_cast<int>(c), image, 4));
  }
  TriangleMesh mesh = make_sphere(kRadius, 48);
  const TriangleMesh ball = mesh;
  constexpr double kBulge = 20;
  for (Vec3& x : mesh.vertices) {
    const double down = std::max(0.0, -x.z() / kRadius - 0.5);
    x += kBulge * std::min(1.0, 4 * down) * x.normalized();
    mesh.confidence.push_back(down > 0 ? 0.F : 1.F);
  }
  mesh.sigma.assign(mesh.vertices.size(), 0.1F);
  const TriangleMesh bulged = mesh;
  ASSERT_TRUE(self_intersections(bulged).empty());
  // A millimetre a round: the devices of this test see 0.4 mm a pixel.
  EXPECT_GT(carve(rig, silhouettes, {.step = 1}, mesh), 100U);
  EXPECT_EQ(count_edges(mesh).boundary, 0U);
  const double excess = signed_volume(bulged) - signed_volume(ball);
  EXPECT_LT(signed_volume(mesh) - signed_volume(ball), 0.35 * excess);
  EXPECT_GT(signed_volume(mesh), 0.9 * signed_volume(ball));
  EXPECT_TRUE(self_intersections(mesh).empty());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (mesh.confidence[v] > 0) {
      EXPECT_EQ((mesh.vertices[v] - bulged.vertices[v]).norm(), 0);
    }
  }
  // What is within the silhouettes stays.
  TriangleMesh still = ball;
  still.confidence.assign(still.vertices.size(), 0.F);
  EXPECT_EQ(carve(rig, silhouettes, {}, still), 0U);
}

/// Images of the ball under all patterns: albedo times light, one sample per pixel.
std::vector<ColorView> ball_images(const Rig& rig, const std::function<Vec3(const Vec3&)>& albedo,
                                   const Vec3& ambient) {
  std::vector<ColorView> views;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const Camera& camera = rig.cameras[c];
    ColorView view;
    view.camera = static_cast<int>(c);
    view.image = cv::Mat(camera.height, camera.width, CV_32FC3, cv::Scalar::all(0));
    view.blur_px = 0.3;
    view.is_plain = camera.sees_texture_only;
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        const auto x = hit_ball(camera.ray(Vec2(u, v)));
        if (!x) continue;
        Vec3 light = ambient;
        for (const Projector& projector : rig.projectors) {
          const Vec3 way = projector.center() - *x;
          const double cosine = way.normalized().dot(x->normalized());
          const auto pixel = projector.project(*x);
          if (!(cosine > 0) || camera.sees_texture_only) continue;
          const LinePattern& pattern = projector.patterns[0];
          const double px = (*pixel)[pattern.axis == Axis::kColumn ? 0 : 1];
          const Rgb color = pattern.value(px, projector.size_across(pattern), 1.0);
          const double near = kDistance / way.norm();
          light += near * near * cosine * Vec3(color[0], color[1], color[2]);
        }
        const Vec3 seen = albedo(*x).cwiseProduct(light);
        view.image.at<cv::Vec3f>(v, u) = {static_cast<float>(seen[0]), static_cast<float>(seen[1]),
                                          static_cast<float>(seen[2])};
      }
    }
    views.push_back(std::move(view));
  }
  return views;
}

/// Blue/cyan and red/yellow lines in turn: together they show all channels.
Rig color_rig() {
  Rig rig = ball_rig();
  for (std::size_t p = 1; p < rig.projectors.size(); p += 2)
    rig.projectors[p].patterns[0].colors = {"red", "yellow"};
  rig.volume = Sphere{Vec3::Zero(), 60};
  return rig;
}

/// Red below, green above, a soft border between them.
Vec3 two_colors(const Vec3& x) {
  const double up = 1 / (1 + std::exp(-x.z() / 5));
  return (1 - up) * Vec3(0.8, 0.3, 0.2) + up * Vec3(0.2, 0.6, 0.4);
}

/// Median over vertices of the largest difference of a channel, after the common factor.
double color_error(const TriangleMesh& mesh, std::span<const std::array<float, 3>> colors) {
  double right = 0;
  double weight = 0;
  for (std::size_t v = 0; v < colors.size(); ++v) {
    for (int c = 0; c < 3; ++c) {
      const double truth = two_colors(mesh.vertices[v])[c];
      const auto found = static_cast<double>(colors[v][static_cast<std::size_t>(c)]);
      right += truth * found;
      weight += found * found;
    }
  }
  std::vector<double> errors;
  for (std::size_t v = 0; v < colors.size(); ++v) {
    double error = 0;
    for (int c = 0; c < 3; ++c) {
      const auto found = static_cast<double>(colors[v][static_cast<std::size_t>(c)]);
      error = std::max(error, std::abs(right / weight * found - two_colors(mesh.vertices[v])[c]));
    }
    errors.push_back(error);
  }
  return upper_median(std::move(errors));
}

TEST(VertexColors, AlbedoFromPatternLight) {
  const Rig rig = color_rig();
  const TriangleMesh mesh = make_sphere(kRadius, 48);
  const auto colors =
      vertex_colors(rig, RayScene(mesh), ball_images(rig, two_colors, Vec3(0.01, 0.02, 0.03)));
  ASSERT_EQ(colors.size(), mesh.vertices.size());
  // Each channel falls on a third of the surface: the rest is filled in from neighbours.
  EXPECT_LT(color_error(mesh, colors), 0.06);
}

TEST(VertexColors, TextureCamerasCountAlone) {
  Rig rig = color_rig();
  for (Camera& camera : rig.cameras) camera.sees_texture_only = true;
  rig.cameras[0].sees_texture_only = false;
  const TriangleMesh mesh = make_sphere(kRadius, 48);
  std::vector<ColorView> views = ball_images(rig, two_colors, Vec3::Ones());
  views[0].image.setTo(0.5);  // would spoil it
  EXPECT_LT(color_error(mesh, vertex_colors(rig, RayScene(mesh), views)), 0.01);
}

TEST(VertexColors, NothingSeenGivesNone) {
  const Rig rig = color_rig();
  const TriangleMesh mesh = make_sphere(kRadius, 12);
  EXPECT_TRUE(vertex_colors(rig, RayScene(mesh), {}).empty());
  std::vector<ColorView> views = ball_images(rig, two_colors, Vec3::Zero());
  for (ColorView& view : views) view.image.setTo(std::nanf(""));
  EXPECT_TRUE(vertex_colors(rig, RayScene(mesh), views).empty());
}

TEST(MeshParts, CapsCloseEveryLoop) {
  TriangleMesh mesh = make_sphere(20, 16);
  const double volume = signed_volume(mesh);
  std::vector<char> keep;  // two loops: a zone of the ball
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    keep.push_back(std::abs(mesh.vertices[static_cast<std::size_t>(mesh.faces[f][0])].z()) < 15);
  mesh = submesh(mesh, keep);
  ASSERT_GT(count_edges(mesh).boundary, 20U);
  const TriangleMesh closed = with_caps(mesh);
  EXPECT_EQ(count_edges(closed).boundary, 0U);
  EXPECT_EQ(count_edges(closed).non_manifold, 0U);
  EXPECT_EQ(closed.vertices.size(), mesh.vertices.size() + 2);
  EXPECT_GT(signed_volume(closed), 0.7 * volume);  // outward like the rest
  EXPECT_EQ(with_caps(closed).faces, closed.faces);
}

/// Two unit cubes of 8 vertices each at these corners; vertices at one place are one.
TriangleMesh touching_boxes(const Vec3& second) {
  TriangleMesh mesh;
  for (const Vec3& center : {Vec3(0, 0, 0), second}) {
    const TriangleMesh box = make_box({1, 1, 1}, center);
    std::vector<int> index;
    for (const Vec3& x : box.vertices) {
      auto at = std::find(mesh.vertices.begin(), mesh.vertices.end(), x);
      if (at == mesh.vertices.end()) at = mesh.vertices.insert(at, x);
      index.push_back(static_cast<int>(at - mesh.vertices.begin()));
    }
    for (const auto& face : box.faces) {
      mesh.faces.push_back({index[static_cast<std::size_t>(face[0])],
                            index[static_cast<std::size_t>(face[1])],
                            index[static_cast<std::size_t>(face[2])]});
    }
  }
  return mesh;
}

TEST(Manifold, BoxesThatTouchInAnEdgeOrACornerAreCutApart) {
  for (const auto& [second, copies] :
       {std::pair(Vec3(1, 1, 0), 2U), std::pair(Vec3(1, 1, 1), 1U)}) {
    TriangleMesh mesh = touching_boxes(second);
    EXPECT_EQ(count_edges(mesh).non_manifold, copies == 2 ? 1U : 0U);
    EXPECT_EQ(make_manifold(mesh), copies);
    EXPECT_EQ(count_edges(mesh).non_manifold, 0U);
    EXPECT_EQ(count_edges(mesh).boundary, 0U);
    EXPECT_EQ(mesh.vertices.size(), 16U);
    EXPECT_NEAR(signed_volume(mesh), 2, 0.1);
    const std::vector<int> component = face_components(mesh);
    EXPECT_EQ(*std::max_element(component.begin(), component.end()), 1);
    EXPECT_EQ(separate_vertices(mesh), 0U);  // the copies lie apart
  }
}

TEST(Manifold, AnEdgeThatOneFanPassesTwiceGetsAVertex) {
  // A pile of four boxes around a gap of none: the two on the diagonal of the lower layer touch in
  // an edge, and the upper ones make them one body.
  TriangleMesh mesh;
  const auto add = [&](const Vec3& center) {
    const TriangleMesh box = make_box({1, 1, 1}, center);
    for (auto face : box.faces) {
      for (int& v : face) {
        const Vec3 x = box.vertices[static_cast<std::size_t>(v)];
        auto at = std::find(mesh.vertices.begin(), mesh.vertices.end(), x);
        if (at == mesh.vertices.end()) at = mesh.vertices.insert(at, x);
        v = static_cast<int>(at - mesh.vertices.begin());
      }
      mesh.faces.push_back(face);
    }
  };
  for (const Vec3& center : {Vec3(0, 0, 0), Vec3(1, 1, 0)}) add(center);
  for (const double z : {-1.0, 1.0}) {
    for (const Vec3& center : {Vec3(0, 0, z), Vec3(1, 0, z), Vec3(0, 1, z), Vec3(1, 1, z)})
      add(center);
  }
  // Faces between two boxes are inside: both go.
  const auto quad_center = [&](std::size_t f) {  // of the box side that the triangle is half of
    const auto& face = mesh.faces[f];
    Vec3 low = mesh.vertices[static_cast<std::size_t>(face[0])], high = low;
    for (const int v : face) {
      low = low.cwiseMin(mesh.vertices[static_cast<std::size_t>(v)]);
      high = high.cwiseMax(mesh.vertices[static_cast<std::size_t>(v)]);
    }
    return Vec3(0.5 * (low + high));
  };
  std::vector<char> keep(mesh.faces.size(), 1);
  for (std::size_t f = 0; f < keep.size(); ++f) {
    for (std::size_t g = 0; g < keep.size(); ++g) {
      if (f / 12 != g / 12 && quad_center(f) == quad_center(g)) keep[f] = 0;
    }
  }
  mesh = submesh(mesh, keep);
  ASSERT_EQ(count_edges(mesh).boundary, 0U);
  ASSERT_EQ(count_edges(mesh).non_manifold, 1U);
  const double volume = signed_volume(mesh);
  EXPECT_EQ(make_manifold(mesh), 1U);
  EXPECT_EQ(count_edges(mesh).boundary, 0U);
  EXPECT_EQ(count_edges(mesh).non_manifold, 0U);
  EXPECT_NEAR(signed_volume(mesh), volume, 0.1);
}

TEST(Manifold, VerticesAtOnePlaceAreMovedApartByTheLeast) {
  TriangleMesh mesh = make_box({1, 1, 1}, {300, 0, 0});
  mesh.vertices[1] = mesh.vertices[0] + Vec3(1e-9, 0, 0);
  mesh.vertices[2] = mesh.vertices[0];
  EXPECT_GE(separate_vertices(mesh), 2U);
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = a + 1; b < 3; ++b) {
      EXPECT_NE(mesh.vertices[a], mesh.vertices[b]);
      EXPECT_LT((mesh.vertices[a] - mesh.vertices[b]).norm(), 1e-3);
    }
  }
}

TEST(MeshParts, SubdivisionKeepsTheShape) {
  const TriangleMesh ball = make_sphere(20, 12);
  const TriangleMesh fine = subdivided(ball);
  EXPECT_EQ(fine.faces.size(), 4 * ball.faces.size());
  EXPECT_EQ(count_edges(fine).boundary, 0u);
  EXPECT_NEAR(signed_volume(fine), signed_volume(ball), 1e-6 * signed_volume(ball));
}

TEST(MeshParts, ComponentsAndSubmeshOfTwoBoxes) {
  TriangleMesh mesh = make_box(Vec3::Ones());
  const TriangleMesh other = make_box(Vec3::Ones(), Vec3(5, 0, 0));
  const int shift = static_cast<int>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (auto face : other.faces)
    mesh.faces.push_back({face[0] + shift, face[1] + shift, face[2] + shift});
  const std::vector<int> component = face_components(mesh);
  std::vector<char> keep;
  for (const int c : component) keep.push_back(c == 1);
  const TriangleMesh part = submesh(mesh, keep);
  EXPECT_EQ(part.vertices.size(), other.vertices.size());
  EXPECT_EQ(part.faces, other.faces);
}

}  // namespace
}  // namespace pencilscan
