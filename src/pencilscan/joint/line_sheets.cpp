#include "pencilscan/joint/line_sheets.h"

#include <Eigen/Geometry>
#include <cmath>

#include "pencilscan/core/lanes.h"

namespace pencilscan {
namespace {

/// Plane through the projector centre and two of its pixels, in the projector frame.
Vec3 plane_normal(const Projector& projector, Axis axis, double across, double along_a,
                  double along_b) {
  const auto pixel = [&](double along) {
    return axis == Axis::kColumn ? Vec2(across, along) : Vec2(along, across);
  };
  const Vec3 a = projector.normalized_from_pixel(pixel(along_a)).homogeneous();
  const Vec3 b = projector.normalized_from_pixel(pixel(along_b)).homogeneous();
  return a.cross(b).normalized();
}

/// Writes the indices of the lines whose inverse depth lies in [low, high]; how many.
PENCILSCAN_CLONES
int lines_between(const std::array<std::array<float, kLanes>, 3>* q, std::size_t blocks, float x,
                  float y, float low, float high, int* lines) {
  int count = 0;
  for (std::size_t b = 0; b < blocks; ++b) {
    Lanes qx;
    Lanes qy;
    Lanes qz;
    load(q[b][0].data(), qx);
    load(q[b][1].data(), qy);
    load(q[b][2].data(), qz);
    const Lanes w = qx * x + (qy * y + qz);
    const IntLanes is_inside = (w >= low) & (w <= high);
    if (!any(is_inside)) continue;
    for (int k = 0; k < kLanes; ++k) {
      lines[count] = static_cast<int>(b) * kLanes + k;
      count -= is_inside[k];
    }
  }
  return count;
}

}  // namespace

LineSheets::LineSheets(const Rig& rig, const Camera& camera, PatternRef ref) {
  const Projector& projector = rig.projector(ref.projector);
  const LinePattern& pattern = rig.pattern(ref);
  line_count_ = projector.line_count(pattern);
  extent_px_ =
      static_cast<float>(pattern.axis == Axis::kColumn ? projector.height : projector.width);
  constexpr float kPartPx = 64;
  along_axis_ = pattern.axis == Axis::kColumn ? 1 : 0;
  if (projector.has_distortion()) {
    bent_ = projector;
    bent_->device_from_world = projector.device_from_world * camera.device_from_world.inverse();
    parts_ = std::max(1, static_cast<int>(std::lround(extent_px_ / kPartPx)));
  }
  part_size_px_ = extent_px_ / static_cast<float>(parts_);
  const RigidTransform projector_from_camera =
      projector.device_from_world * camera.device_from_world.inverse();
  const Vec3& t = projector_from_camera.translation;
  const auto inverse_depth = [&](const Vec3& normal) -> Eigen::Vector3f {
    // normal . (R X + t) = 0 with X = (x, y, 1) / w
    const double offset = normal.dot(t);
    const double bounded = std::abs(offset) > 1e-9 ? offset : 1e-9;
    return (-(projector_from_camera.rotation.transpose() * normal) / bounded).cast<float>();
  };
  for (int line = 0; line < line_count_; ++line) {
    const double across = pattern.position_px(line);
    for (int part = 0; part < parts_; ++part) {
      const double from = static_cast<double>(part) * part_size_px_;
      const double to = from + part_size_px_;
      const auto q_at = [&](double c) {
        return inverse_depth(plane_normal(projector, pattern.axis, c, from, to));
      };
      q_.push_back(q_at(across));
      q_slope_.push_back((q_at(across + 0.5) - q_at(across - 0.5)));
    }
  }
  middle_.resize(static_cast<std::size_t>((line_count_ + kLanes - 1) / kLanes));
  for (int line = 0; line < line_count_; ++line) {
    const auto block = static_cast<std::size_t>(line / kLanes);
    const auto lane = static_cast<std::size_t>(line % kLanes);
    for (std::size_t i = 0; i < 3; ++i)
      middle_[block][i][lane] = q_[index(line, parts_ / 2)][static_cast<Eigen::Index>(i)];
  }
  Eigen::Matrix<double, 3, 4> P;
  P.leftCols<3>() = projector.K * projector_from_camera.rotation;
  P.col(3) = projector.K * t;
  along_ = P.row(along_axis_).transpose().cast<float>();
  along_scale_ = P.row(2).transpose().cast<float>();
}

void LineSheets::candidates(const Eigen::Vector2f& normalized, float w_low, float w_high,
                            std::vector<int>& lines) const {
  // Other parts of a bent line lie a little off its middle.
  constexpr float kSlack = 0.15F;
  const float slack = parts_ > 1 ? kSlack * (w_high - w_low) : 0;
  lines.resize(middle_.size() * kLanes);
  const int count = lines_between(middle_.data(), middle_.size(), normalized.x(), normalized.y(),
                                  w_low - slack, w_high + slack, lines.data());
  lines.resize(static_cast<std::size_t>(count));
  while (!lines.empty() && lines.back() >= line_count_) lines.pop_back();
}

float LineSheets::along(const Eigen::Vector3f& ray, float w) const {
  if (!bent_) {
    const Eigen::Vector4f x(ray.x(), ray.y(), ray.z(), w);
    const float depth = along_scale_.dot(x);
    return depth > 0 ? along_.dot(x) / depth : -1.F;  // behind the projector there is no light
  }
  const auto pixel = bent_->project((ray / w).cast<double>());
  return pixel ? static_cast<float>((*pixel)[along_axis_]) : -1.F;
}

bool LineSheets::find(int line, const Eigen::Vector2f& normalized, float w_low, float w_high,
                      Sheet& sheet) const {
  const Eigen::Vector3f ray(normalized.x(), normalized.y(), 1);
  std::size_t at = index(line, parts_ / 2);
  float w = q_[at].dot(ray);
  if (parts_ > 1) {
    const auto part = static_cast<int>(
        std::clamp(along(ray, w) / part_size_px_, 0.F, static_cast<float>(parts_ - 1)));
    at = index(line, part);
    w = q_[at].dot(ray);
  }
  if (!(w >= w_low && w <= w_high)) return false;
  const float at_px = along(ray, w);
  if (!(at_px > -0.5F && at_px < extent_px_ - 0.5F)) return false;
  sheet.q = q_[at];
  sheet.inverse_depth_per_px = std::abs(q_slope_[at].dot(ray));
  return true;
}

}  // namespace pencilscan
