#include "pencilscan/scan/gray_scan.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "pencilscan/core/name_list.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/gray/local_map.h"
#include "pencilscan/surface/closing.h"

namespace pencilscan {
namespace {

constexpr std::size_t kLeastSamples = 50;

/// Windows smaller than for calibration: what is wanted is detail, not one coordinate.
constexpr LocalMapOptions kWindow{.radius_px = 3, .largest_radius_px = 5, .least_crossings = 10};

struct Meeting {
  Vec3 point;        ///< on the camera ray
  double miss_px;    ///< distance of the point's projection from the panel coordinate
  double mm_per_px;  ///< along the camera ray per panel pixel
  Vec2 along;        ///< unit: where on the panel the point moves with its depth
  double angle;      ///< between the rays
};

/// Of the depth: a step along a ray, to see how fast its picture moves. Far smaller than what bends
/// it, far larger than what rounding leaves of a difference.
constexpr double kStepShare = 1e-4;

std::optional<Meeting> meet(const Device& camera, const Device& projector, const Vec2& pixel,
                            const Vec2& panel) {
  const Ray a = camera.ray(pixel);
  const Ray b = projector.ray(panel);
  const Vec3 baseline = b.origin - a.origin;
  const double cosine = a.direction.dot(b.direction);
  const double sine2 = 1 - cosine * cosine;
  if (sine2 < 1e-8) return std::nullopt;
  const double depth = (baseline.dot(a.direction) - cosine * baseline.dot(b.direction)) / sine2;
  if (!(depth > 0)) return std::nullopt;
  Meeting result;
  result.point = a.origin + depth * a.direction;
  const auto projected = projector.project(result.point);
  const double step = kStepShare * depth;
  const auto farther = projector.project(result.point + step * a.direction);
  if (!projected || !farther) return std::nullopt;
  result.miss_px = (*projected - panel).norm();
  const Vec2 moved = *farther - *projected;
  result.mm_per_px = step / std::max(moved.norm(), 1e-9);
  result.along = moved.normalized();
  result.angle = std::asin(std::sqrt(std::min(sine2, 1.0)));
  return result;
}

struct Measured {
  MeasuredPoint point;
  SurfaceSample sample;
};

}  // namespace

GrayScan gray_scan(const Rig& rig, std::size_t camera, std::size_t projector,
                   const DecodedView& decoded, const GrayScanOptions& options) {
  const Camera& eye = rig.cameras[camera];
  const Projector& light = rig.projectors[projector];
  const auto across = static_cast<std::size_t>((decoded.state.cols - 1) / options.step_px + 1);
  const auto down = static_cast<std::size_t>((decoded.state.rows - 1) / options.step_px + 1);
  std::vector<std::optional<Measured>> found(across * down);
  std::vector<char> missed(found.size(), 0);
  std::vector<char> narrow(found.size(), 0);
  const Vec3 center = eye.center();
  parallel_for(down, [&](std::size_t row) {
    for (std::size_t column = 0; column < across; ++column) {
      const int u = static_cast<int>(column) * options.step_px;
      const int v = static_cast<int>(row) * options.step_px;
      const auto map = LocalMap::fit(decoded, u, v, kWindow);
      if (!map) continue;
      const Vec2 pixel(u, v);
      const Vec2 panel = map->panel_from_camera(pixel);
      const auto at = meet(eye, light, pixel, panel);
      const Vec2 right = pixel + Vec2(1, 0);
      const Vec2 below = pixel + Vec2(0, 1);
      const auto beside = meet(eye, light, right, map->panel_from_camera(right));
      const auto under = meet(eye, light, below, map->panel_from_camera(below));
      const std::size_t i = row * across + column;
      const bool is_narrow = at && at->angle < options.least_angle_rad;
      if (!at || !beside || !under || at->miss_px > options.worst_miss_px || is_narrow) {
        missed[i] = 1;
        narrow[i] = is_narrow ? 1 : 0;
        continue;
      }
      Measured m;
      m.sample.position = at->point;
      m.sample.to_camera = (center - at->point).normalized();
      m.sample.normal = (under->point - at->point).cross(beside->point - at->point).normalized();
      if (!m.sample.normal.allFinite()) continue;
      if (m.sample.normal.dot(m.sample.to_camera) < 0) m.sample.normal = -m.sample.normal;
      m.sample.sigma = at->mm_per_px * at->along.cwiseProduct(map->sigma_panel_px()).norm();
      m.sample.spacing = (beside->point - at->point).norm() * options.step_px;
      m.sample.confidence = 1;
      m.sample.camera = static_cast<std::uint8_t>(camera);
      m.sample.projector = static_cast<std::uint8_t>(projector);
      m.sample.count = 1;
      const Vec3& x = at->point;
      m.point = {static_cast<float>(x.x()),
                 static_cast<float>(x.y()),
                 static_cast<float>(x.z()),
                 static_cast<float>(u),
                 static_cast<float>(v),
                 m.sample.camera,
                 m.sample.projector,
                 0,
                 static_cast<std::uint16_t>(std::max(std::lround(panel.x()), 0L)),
                 static_cast<float>(m.sample.sigma),
                 1.F,
                 static_cast<float>(panel.x())};
      found[i] = m;
    }
  });
  GrayScan scan;
  for (std::size_t i = 0; i < found.size(); ++i) {
    scan.missed += missed[i] != 0 ? 1U : 0U;
    scan.narrow += narrow[i] != 0 ? 1U : 0U;
    if (!found[i]) continue;
    scan.points.push_back(found[i]->point);
    scan.samples.push_back(found[i]->sample);
  }
  return scan;
}

std::optional<std::string> misfit_warning(std::span<const PairYield> pairs) {
  // Of a right rig wrong codes alone fit no point, a few per cent at edges. Of a wrong one the rays
  // pass each other by more than they may, but along one line of the image. Both numbers are
  // chosen.
  constexpr double kMostMissed = 0.3;
  constexpr std::size_t kLeastCodes = 50;
  std::vector<std::string> names;
  std::size_t missed = 0;
  std::size_t codes = 0;
  for (const PairYield& pair : pairs) {
    const std::size_t all = pair.points + pair.missed;
    if (all < kLeastCodes ||
        static_cast<double>(pair.missed) < kMostMissed * static_cast<double>(all))
      continue;
    names.push_back(pair.name);
    missed += pair.missed;
    codes += all;
  }
  if (names.empty()) return std::nullopt;
  const auto percent = static_cast<int>(
      std::lround(100.0 * static_cast<double>(missed) / static_cast<double>(codes)));
  return std::to_string(percent) + " % of the codes of " + name_list(names, 6) +
         " fit no point of this rig, and what is left may be wrong: the rig is not that of these "
         "captures, a device has moved since, or folders are swapped. See pencilscan calibrate";
}

TriangleMesh scan_mesh(std::span<const SurfaceSample> samples, double cell_mm) {
  if (samples.size() < kLeastSamples) return {};
  constexpr int kMostDepth = 9;
  return surface_within_cube(samples, cell_mm, kMostDepth).mesh;
}

}  // namespace pencilscan
