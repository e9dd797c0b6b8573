#pragma once

// A ball and what devices all around it measure, for tests. Lengths are footprints, as the stages
// of a frame have them.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/core/random.h"
#include "pencilscan/surface/mesh_parts.h"
#include "pencilscan/surface/surface.h"

namespace pencilscan::sample {

inline constexpr double kFocal = 2400;       // px
inline constexpr double kDistance = kFocal;  // of the devices from the centre: a pixel covers 1
inline constexpr double kMm = kDistance / 900;
inline constexpr double kRadius = 45 * kMm;
inline constexpr double kNoise = 0.1 * kMm;  // along the camera ray
inline constexpr auto kSigma = static_cast<float>(kNoise);

inline Device device_at(const Vec3& direction, const std::string& name) {
  Device device;
  device.name = name;
  device.width = 640;
  device.height = 640;
  device.K << kFocal, 0, 319.5, 0, kFocal, 319.5, 0, 0, 1;
  device.device_from_world = look_at(kDistance * direction.normalized(), Vec3::Zero());
  return device;
}

/// Five cameras and five projectors all around; projectors alternate between line directions.
inline Rig ball_rig() {
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

inline std::optional<Vec3> hit_ball(const Ray& ray) {
  const double b = ray.origin.dot(ray.direction);
  const double d = b * b - ray.origin.squaredNorm() + kRadius * kRadius;
  if (d < 0) return std::nullopt;
  return ray.origin + (-b - std::sqrt(d)) * ray.direction;
}

/// What noisy cameras would measure of the ball: along each line of each projector, every point
/// that a camera sees at less than 72 degrees.
inline std::vector<MeasuredPoint> ball_points(const Rig& rig, std::uint64_t seed = 1) {
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

inline double worst_deviation(const TriangleMesh& mesh) {
  double worst = 0;
  for (const Vec3& v : mesh.vertices) worst = std::max(worst, std::abs(v.norm() - kRadius));
  return worst;
}

inline double share_beyond(const TriangleMesh& mesh, double limit) {
  std::size_t count = 0;
  for (const Vec3& v : mesh.vertices) count += std::abs(v.norm() - kRadius) > limit;
  return static_cast<double>(count) / static_cast<double>(mesh.vertices.size());
}

inline void expect_watertight(const SurfaceResult& result) {
  EXPECT_EQ(result.report.status, SurfaceStatus::kDone);
  const EdgeCounts edges = count_edges(result.mesh);
  EXPECT_EQ(edges.boundary, 0u);
  EXPECT_EQ(edges.non_manifold, 0u);
  EXPECT_GT(signed_volume(result.mesh), 0);
}

/// Depth maps that noisy cameras would have of the ball.
inline std::vector<DepthMap> ball_maps(const Rig& rig, double noise = kNoise) {
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

}  // namespace pencilscan::sample
