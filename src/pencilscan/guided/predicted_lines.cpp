#include "pencilscan/guided/predicted_lines.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "pencilscan/core/check.h"
#include "pencilscan/core/lanes.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

/// Normalised coordinates around a pixel, to first order.
struct LocalRays {
  Vector2f pixel;
  Vector2f normalized;
  Eigen::Matrix2f slope;

  LocalRays(const Camera& camera, const Vector2f& at) : pixel(at) {
    const auto n = [&](float dx, float dy) -> Vector2f {
      return camera.normalized_from_pixel((at + Vector2f(dx, dy)).cast<double>()).cast<float>();
    };
    normalized = n(0, 0);
    slope.col(0) = (n(2, 0) - n(-2, 0)) / 4;
    slope.col(1) = (n(0, 2) - n(0, -2)) / 4;
  }
};

/// A plane q . X = 1 in the camera frame, that of a patch at its pixel.
struct TangentPlane {
  Vec3 point;
  Vec3 q;

  TangentPlane(const LocalRays& rays, const SurfacePatch& patch) {
    // w is linear in the normalised pixel, with gradient q_xy.
    const Vector2f g = rays.slope.transpose().inverse() * patch.gradient(patch.pixel);
    const float w = patch.inverse_depth(patch.pixel);
    q = Vec3(g.x(), g.y(), w - g.dot(rays.normalized));
    point = rays.normalized.homogeneous().cast<double>() / static_cast<double>(w);
  }
  /// Cosine of the incidence of light from a place; negative: the surface faces away.
  [[nodiscard]] double incidence(const Vec3& light) const {
    return (1 - q.dot(light)) / (q.norm() * (light - point).norm());
  }
};

/// Line coordinate of a pattern around a pixel: (line . h) / h_z with h = ray + w * translation,
/// the ray turned into the projector's frame. The same for the coordinate along the lines.
struct LocalCoordinate {
  Vector3f ray;    ///< through the pixel
  Vector3f ray_x;  ///< change of the ray per pixel
  Vector3f ray_y;
  Vector3f translation;
  Vector3f line;
  Vector3f along;

  [[nodiscard]] float at(float w) const {
    const Vector3f h = ray + w * translation;
    return line.dot(h) / h.z();
  }
};

/// A pattern, its projector seen from a camera.
class PatternOnSurface {
 public:
  PatternOnSurface(const Rig& rig, const Camera& camera, PatternRef ref)
      : ref_(ref),
        projector_(rig.projector(ref.projector)),
        pattern_(projector_.patterns[static_cast<std::size_t>(ref.pattern)]) {
    const RigidTransform transform =
        projector_.device_from_world * camera.device_from_world.inverse();
    rotation_ = transform.rotation.cast<float>();
    translation_ = transform.translation.cast<float>();
    center_ = transform.inverse().translation;
  }
  [[nodiscard]] PatternRef ref() const { return ref_; }
  [[nodiscard]] const Vec3& center() const { return center_; }
  [[nodiscard]] int line_count() const { return projector_.line_count(pattern_); }
  [[nodiscard]] float extent_along() const {
    return static_cast<float>(pattern_.axis == Axis::kColumn ? projector_.height
                                                             : projector_.width);
  }
  /// Around a pixel with inverse depth w. The projector's distortion to first order, which over a
  /// patch is exact to a thousandth of a pixel. Nothing behind the projector.
  [[nodiscard]] std::optional<LocalCoordinate> around(const LocalRays& rays, float w) const {
    LocalCoordinate local;
    local.ray = rotation_ * rays.normalized.homogeneous();
    local.ray_x = rotation_.leftCols<2>() * rays.slope.col(0);
    local.ray_y = rotation_.leftCols<2>() * rays.slope.col(1);
    local.translation = translation_;
    const Vector3f h = local.ray + w * translation_;
    if (!(h.z() > 0)) return std::nullopt;
    Eigen::Matrix<double, 2, 3> distorted = Eigen::Matrix<double, 2, 3>::Identity();
    if (projector_.has_distortion()) {
      const Vec2 n = (h.head<2>() / h.z()).cast<double>();
      distorted.leftCols<2>() = distortion_slope(projector_.distortion, n);
      distorted.col(2) = distort(projector_.distortion, n) - distorted.leftCols<2>() * n;
    }
    const auto axis = static_cast<Eigen::Index>(pattern_.axis);
    const auto panel = [&](Eigen::Index row) -> Vec3 {
      return (projector_.K.row(row).head<2>() * distorted).transpose() +
             projector_.K(row, 2) * Vec3::UnitZ();
    };
    local.line =
        ((panel(axis) - pattern_.offset_px * Vec3::UnitZ()) / pattern_.pitch_px).cast<float>();
    local.along = panel(1 - axis).cast<float>();
    return local;
  }

 private:
  PatternRef ref_;
  const Projector& projector_;
  const LinePattern& pattern_;
  Eigen::Matrix3f rotation_;
  Vector3f translation_;
  Vec3 center_;  ///< of the projector, in the camera frame
};

/// Line coordinates of a row of kLanes pixels from `dx`, `dy` off the middle of a patch; NaN beside
/// the panel. `w`: inverse depth of the pixels.
PENCILSCAN_CLONES void coordinates_of_row(const LocalCoordinate& local, float dx, float dy,
                                          const float* w, float extent, float* result) {
  const Lanes lane = {0, 1, 2, 3, 4, 5, 6, 7};
  const Lanes x = lane + dx;
  Lanes depth;
  load(w, depth);
  Lanes h[3];
  for (int k = 0; k < 3; ++k) {
    h[k] = (local.ray.data()[k] + dy * local.ray_y.data()[k]) + x * local.ray_x.data()[k] +
           depth * local.translation.data()[k];
  }
  const Lanes scale = 1 / h[2];
  const float* l = local.line.data();
  const float* a = local.along.data();
  const Lanes along = (a[0] * h[0] + a[1] * h[1]) * scale + a[2];
  const Lanes line = (l[0] * h[0] + l[1] * h[1]) * scale + l[2];
  const IntLanes on = (h[2] > 0) & (along > -0.5F) & (along < extent - 0.5F);
  store(on ? line : line - line + std::numeric_limits<float>::quiet_NaN(), result);
}

/// w = c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2 on `rows` rows of pixels, x and y from `first`
/// on.
PENCILSCAN_CLONES void inverse_depths(const std::array<float, 6>& c, float first, int rows,
                                      int stride, float* w) {
  const Lanes lane = {0, 1, 2, 3, 4, 5, 6, 7};
  for (int row = 0; row < rows; ++row) {
    const float y = first + static_cast<float>(row);
    const float constant = c[0] + y * (c[2] + c[5] * y);
    const float slope = c[1] + c[4] * y;
    for (int column = 0; column < stride; column += kLanes) {
      const Lanes x = lane + (first + static_cast<float>(column));
      store(constant + x * (slope + c[3] * x), w + row * stride + column);
    }
  }
}

/// Inverse depth of a patch at pixels around its middle.
struct PatchGrid {
  static constexpr int kMostRows = 17;
  float first = 0;  ///< x and y of the first pixel, off the patch's pixel
  std::array<float, static_cast<std::size_t>(kMostRows) * 2 * kLanes> w;

  PatchGrid(const SurfacePatch& patch, int side) : first(-0.5F * static_cast<float>(side - 2)) {
    const auto& c = patch.coefficients;
    const float linear = patch.reference / patch.scale_px;
    const float square = linear / patch.scale_px;
    inverse_depths({patch.reference * (1 + c[0]), linear * c[1], linear * c[2], square * c[3],
                    square * c[4], square * c[5]},
                   first, side, stride(side), w.data());
  }
  static int stride(int side) { return (side + kLanes - 1) / kLanes * kLanes; }
};

/// Where lines cross between eight pixels of a row and their neighbours to the right or below.
struct EightCrossings {
  std::array<int, kLanes> is_crossed;
  std::array<int, kLanes> line;
  std::array<float, kLanes> coordinate;
  std::array<float, kLanes> slope_x;  ///< of the coordinate, per pixel
  std::array<float, kLanes> slope_y;
};

/// `here`: coordinates of nine pixels, `below` of the eight under them. False if there are none.
PENCILSCAN_CLONES bool look_for_crossings(const float* here, const float* below, int pixels,
                                          int line_count, float min_spacing_px,
                                          EightCrossings& crossings) {
  const IntLanes lane = {0, 1, 2, 3, 4, 5, 6, 7};
  Lanes c;
  Lanes slope_x;
  Lanes slope_y;
  load(here, c);
  load(here + 1, slope_x);
  load(below, slope_y);
  slope_x -= c;
  slope_y -= c;
  const Lanes steep_x = slope_x < 0 ? -slope_x : slope_x;
  const Lanes steep_y = slope_y < 0 ? -slope_y : slope_y;
  const Lanes next = c + (steep_x >= steep_y ? slope_x : slope_y);
  const Lanes low = c < next ? c : next;
  const Lanes high = c < next ? next : c;
  // The least whole number that is not below.
  const IntLanes whole = __builtin_convertvector(low, IntLanes);
  const IntLanes line = whole - (__builtin_convertvector(whole, Lanes) < low);
  const Lanes norm2 = slope_x * slope_x + slope_y * slope_y;
  const IntLanes is_crossed = (high > 0) & (__builtin_convertvector(line, Lanes) < high) &
                              (line >= 0) & (line < line_count) &
                              (norm2 * (min_spacing_px * min_spacing_px) < 1) & (lane < pixels);
  if (!any(is_crossed)) return false;
  std::memcpy(crossings.is_crossed.data(), &is_crossed, sizeof(is_crossed));
  std::memcpy(crossings.line.data(), &line, sizeof(line));
  store(c, crossings.coordinate.data());
  store(slope_x, crossings.slope_x.data());
  store(slope_y, crossings.slope_y.data());
  return true;
}

/// Adds the lines that cross a patch between neighbouring pixels.
void add_crossings(const std::vector<float>& coordinates, int step, const Vector2f& first,
                   int line_count, double min_spacing_px, const PredictedPoint& like,
                   float sigma_lines, std::vector<PredictedPoint>& result) {
  const int stride = PatchGrid::stride(step + 1);
  EightCrossings crossings;
  for (int y = 0; y < step; ++y) {
    for (int x = 0; x < step; x += kLanes) {
      const float* here = coordinates.data() + y * stride + x;
      if (!look_for_crossings(here, here + stride, step - x, line_count,
                              static_cast<float>(min_spacing_px), crossings))
        continue;
      for (int k = 0; k < kLanes; ++k) {
        const auto lane = static_cast<std::size_t>(k);
        if (crossings.is_crossed[lane] == 0) continue;
        const Vector2f slope(crossings.slope_x[lane], crossings.slope_y[lane]);
        const Eigen::Index along = std::abs(slope.x()) >= std::abs(slope.y()) ? 0 : 1;
        const float norm = slope.norm();
        PredictedPoint point = like;
        point.line = crossings.line[lane];
        point.normal = slope / norm;
        point.spacing_px = 1 / norm;
        point.sigma_px = sigma_lines / norm;
        point.position = first + Vector2f(static_cast<float>(x + k), static_cast<float>(y));
        point.position[along] +=
            (static_cast<float>(point.line) - crossings.coordinate[lane]) / slope[along];
        result.push_back(point);
      }
    }
  }
}

}  // namespace

std::vector<PredictedPoint> predict_lines(const Rig& rig, const Camera& camera,
                                          const LocalSurface& surface,
                                          std::span<const PatternRef> refs,
                                          const PredictionOptions& options) {
  std::vector<PatternOnSurface> patterns;
  for (const PatternRef& ref : refs) patterns.emplace_back(rig, camera, ref);
  const int step = surface.step_px();
  const int side = step + 1;
  const int stride = PatchGrid::stride(side);
  PENCILSCAN_CHECK(side <= PatchGrid::kMostRows && stride <= 2 * kLanes);
  std::vector<float> coordinates(static_cast<std::size_t>(stride * side + kLanes));
  std::vector<PredictedPoint> result;
  for (std::size_t p = 0; p < surface.patches().size(); ++p) {
    const SurfacePatch& patch = surface.patches()[p];
    if (surface.refitted()[p] == 0 || !patch.exists()) continue;
    const LocalRays rays(camera, patch.pixel);
    const TangentPlane plane(rays, patch);
    const PatchGrid grid(patch, side);
    const float w = patch.inverse_depth(patch.pixel);
    for (const PatternOnSurface& pattern : patterns) {
      if (plane.incidence(pattern.center()) < options.min_incidence_cos) continue;
      const auto local = pattern.around(rays, w);
      if (!local) continue;
      const float sigma_lines =
          std::abs(local->at(w * (1 + 1e-3F)) - local->at(w)) * 1e3F * patch.sigma;
      if (!(sigma_lines < static_cast<float>(options.max_sigma_lines))) continue;
      for (int y = 0; y < side; ++y) {
        for (int x = 0; x < stride; x += kLanes) {
          const auto i = static_cast<std::size_t>(y * stride + x);
          coordinates_of_row(*local, grid.first + static_cast<float>(x),
                             grid.first + static_cast<float>(y), &grid.w[i], pattern.extent_along(),
                             &coordinates[i]);
        }
      }
      PredictedPoint like;
      like.pattern = pattern.ref();
      like.patch = p;
      add_crossings(coordinates, step, patch.pixel + Vector2f::Constant(grid.first),
                    pattern.line_count(), options.min_spacing_px, like, sigma_lines, result);
    }
  }
  return result;
}

}  // namespace pencilscan
