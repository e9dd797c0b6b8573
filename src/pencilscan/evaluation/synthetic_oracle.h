#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"

/// Scenes whose true lines are known in closed form. Tests only.
namespace pencilscan::oracle {

inline constexpr double kRadiusMm = 100;
inline constexpr double kDeviceDistanceMm = 1000;

inline Device device(const std::string& name, int width, int height, double focal_px,
                     const Vec3& eye) {
  Device d;
  d.name = name;
  d.width = width;
  d.height = height;
  d.K << focal_px, 0, (width - 1) / 2.0, 0, focal_px, (height - 1) / 2.0, 0, 0, 1;
  d.device_from_world = look_at(eye, Vec3::Zero());
  return d;
}

inline LinePattern pattern(Axis axis, double pitch_px) {
  LinePattern p;
  p.axis = axis;
  p.pitch_px = pitch_px;
  return p;
}

/// `count` cameras and projectors in turn on a circle around the origin, cameras at azimuth 0.
/// Every other projector shows horizontal lines. Lines are about 8 px apart in the middle of an
/// image.
inline Rig ring(int count, double pitch_px = 12) {
  Rig rig;
  for (int i = 0; i < count; ++i) {
    const double azimuth = 2 * std::numbers::pi * i / count;
    const double between = azimuth + std::numbers::pi / count / 2;
    const Vec3 eye(kDeviceDistanceMm * std::cos(azimuth), kDeviceDistanceMm * std::sin(azimuth), 0);
    const Vec3 lamp(kDeviceDistanceMm * std::cos(between), kDeviceDistanceMm * std::sin(between),
                    200);
    Camera camera;
    static_cast<Device&>(camera) = device("cam" + std::to_string(i), 240, 240, 1000, eye);
    rig.cameras.push_back(camera);
    Projector projector;
    static_cast<Device&>(projector) = device("proj" + std::to_string(i), 400, 400, 1500, lamp);
    projector.patterns = {pattern(i % 2 == 0 ? Axis::kColumn : Axis::kRow, pitch_px)};
    rig.projectors.push_back(projector);
  }
  return rig;
}

/// First intersection of a ray with the sphere of kRadiusMm around the origin.
inline std::optional<Vec3> on_sphere(const Ray& ray) {
  const double b = ray.origin.dot(ray.direction);
  const double c = ray.origin.squaredNorm() - kRadiusMm * kRadiusMm;
  if (b * b <= c) return std::nullopt;
  return Vec3(ray.origin + (-b - std::sqrt(b * b - c)) * ray.direction);
}

/// Line coordinate that projector `p` casts on the sphere at a camera pixel; NaN in the dark.
inline double sphere_coordinate(const Rig& rig, std::size_t c, std::size_t p, const Vec2& pixel) {
  const auto x = on_sphere(rig.cameras[c].ray(pixel));
  const Projector& projector = rig.projectors[p];
  if (!x || x->dot(projector.center() - *x) <= 0) return std::nan("");
  const Vec2 at = *projector.project(*x);
  const LinePattern& lines = projector.patterns[0];
  return projector.contains(at) ? lines.coordinate(at[static_cast<Eigen::Index>(lines.axis)])
                                : std::nan("");
}

/// What a perfect scanner measures of the sphere: the crossings of every line with every image row,
/// and with every column, by bisection of the closed form.
inline std::vector<MeasuredPoint> sphere_points(const Rig& rig) {
  std::vector<MeasuredPoint> points;
  const auto add = [&](std::size_t c, std::size_t p, Vec2 low, const Vec2& step) {
    Vec2 high = low + step;
    const double a = sphere_coordinate(rig, c, p, low);
    const double b = sphere_coordinate(rig, c, p, high);
    if (!(std::abs(b - a) < 0.5)) return;
    const double line = std::ceil(std::min(a, b));
    if (line > std::max(a, b)) return;
    for (int i = 0; i < 40; ++i) {
      const Vec2 middle = 0.5 * (low + high);
      const bool beyond = (sphere_coordinate(rig, c, p, middle) < line) != (a < line);
      (beyond ? high : low) = middle;
    }
    const Vec3 x = *on_sphere(rig.cameras[c].ray(low));
    MeasuredPoint point;
    point.x = static_cast<float>(x.x());
    point.y = static_cast<float>(x.y());
    point.z = static_cast<float>(x.z());
    point.u = static_cast<float>(low.x());
    point.v = static_cast<float>(low.y());
    point.camera = static_cast<std::uint8_t>(c);
    point.projector = static_cast<std::uint8_t>(p);
    point.line = static_cast<std::uint16_t>(line);
    point.plane = static_cast<float>(line);
    point.sigma = 0.1F;
    point.confidence = 1;
    points.push_back(point);
  };
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
      for (int y = 0; y < rig.cameras[c].height; ++y) {
        for (int x = 0; x < rig.cameras[c].width; ++x) {
          add(c, p, Vec2(x, y), Vec2::UnitX());
          add(c, p, Vec2(x, y), Vec2::UnitY());
        }
      }
    }
  }
  return points;
}

/// A camera and a projector side by side before the plane z = 0 (the upper face of a thin box).
/// Pixel (u, v) of the camera sees column u / spacing_scale + const: line i lies at a constant u.
struct PlaneScene {
  Rig rig;
  double spacing_px = 0;
  /// Camera column of line i.
  [[nodiscard]] double column(double line) const {
    const Projector& projector = rig.projectors[0];
    const double px = projector.patterns[0].position_px(line);
    const double x = (px - projector.K(0, 2)) / projector.K(0, 0) * kDeviceDistanceMm + 100;
    return x / kDeviceDistanceMm * rig.cameras[0].K(0, 0) + rig.cameras[0].K(0, 2);
  }
};
inline PlaneScene plane_scene(double pitch_px = 12) {
  PlaneScene scene;
  Camera camera;
  static_cast<Device&>(camera) = device("cam0", 160, 120, 1000, {0, 0, kDeviceDistanceMm});
  Projector projector;
  static_cast<Device&>(projector) = device("proj0", 1000, 800, 1500, {0, 0, kDeviceDistanceMm});
  // Both look down -z with x to the right; the projector stands 100 mm beside.
  const Mat3 down = Vec3(1, -1, -1).asDiagonal();
  camera.device_from_world = {down, -(down * Vec3(0, 0, kDeviceDistanceMm))};
  projector.device_from_world = {down, -(down * Vec3(100, 0, kDeviceDistanceMm))};
  projector.patterns = {pattern(Axis::kColumn, pitch_px)};
  scene.rig.cameras = {camera};
  scene.rig.projectors = {projector};
  scene.spacing_px = pitch_px / 1500 * 1000;
  return scene;
}

}  // namespace pencilscan::oracle
