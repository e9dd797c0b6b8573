#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <vector>

#include "pencilscan/core/parallel.h"
#include "pencilscan/evaluation/label_error.h"

namespace pencilscan {
namespace {

/// The pixels of one camera around the vertices of one channel.
class PatchImage {
 public:
  PatchImage(const TruthScene& truth, int camera)
      : truth_(truth),
        camera_(camera),
        width_(truth.rig().cameras[static_cast<std::size_t>(camera)].width),
        height_(truth.rig().cameras[static_cast<std::size_t>(camera)].height),
        distance2_(static_cast<std::size_t>(width_ * height_), kFar),
        wrong_(static_cast<std::size_t>(width_ * height_), 0) {}

  /// Gives the pixels around a vertex to it where it is the nearest so far.
  void stamp(const Vec2& at, double radius_px, bool is_wrong) {
    const int x0 = std::max(0, static_cast<int>(std::ceil(at.x() - radius_px)));
    const int x1 = std::min(width_ - 1, static_cast<int>(std::floor(at.x() + radius_px)));
    const int y0 = std::max(0, static_cast<int>(std::ceil(at.y() - radius_px)));
    const int y1 = std::min(height_ - 1, static_cast<int>(std::floor(at.y() + radius_px)));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const auto d2 = static_cast<float>((Vec2(x, y) - at).squaredNorm());
        const auto i = static_cast<std::size_t>(y * width_ + x);
        if (static_cast<double>(d2) > radius_px * radius_px || d2 >= distance2_[i]) continue;
        distance2_[i] = d2;
        wrong_[i] = is_wrong ? 1 : 0;
      }
    }
  }

  /// Largest connected area of wrong pixels on the true surface, mm^2. Consumes the image.
  double largest_mm2() {
    double largest = 0;
    std::vector<std::pair<std::size_t, std::optional<SurfaceHit>>> stack;
    for (std::size_t start = 0; start < wrong_.size(); ++start) {
      if (wrong_[start] == 0) continue;
      double area = 0;
      wrong_[start] = 0;
      stack.emplace_back(start, hit(start));
      while (!stack.empty()) {
        const auto [i, from] = stack.back();
        stack.pop_back();
        if (!from) continue;
        area += footprint_mm2(i, *from);
        const int x = static_cast<int>(i) % width_;
        const int y = static_cast<int>(i) / width_;
        for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
          if (x + dx < 0 || x + dx >= width_ || y + dy < 0 || y + dy >= height_) continue;
          const auto j = static_cast<std::size_t>((y + dy) * width_ + x + dx);
          if (wrong_[j] == 0) continue;
          auto to = hit(j);
          if (to && depth_steps(*from, *to)) continue;
          wrong_[j] = 0;
          stack.emplace_back(j, std::move(to));
        }
      }
      largest = std::max(largest, area);
    }
    return largest;
  }

 private:
  static constexpr float kFar = 1e30F;

  [[nodiscard]] std::optional<SurfaceHit> hit(std::size_t i) const {
    return truth_.hit(camera_, {static_cast<double>(static_cast<int>(i) % width_),
                                static_cast<double>(static_cast<int>(i) / width_)});
  }
  /// Area of the surface that one pixel sees: distance^2 times its solid angle over the cosine.
  [[nodiscard]] double footprint_mm2(std::size_t i, const SurfaceHit& at) const {
    const Camera& cam = truth_.rig().cameras[static_cast<std::size_t>(camera_)];
    const Vec2 pixel(static_cast<int>(i) % width_, static_cast<int>(i) / width_);
    const Vec3 middle = cam.ray(pixel).direction;
    const Vec3 dx = cam.ray(pixel + Vec2::UnitX()).direction - middle;
    const Vec3 dy = cam.ray(pixel + Vec2::UnitY()).direction - middle;
    constexpr double kMinCosine = 0.1;  // a facet seen nearly edge-on ends within its pixel
    return at.distance * at.distance * dx.cross(dy).norm() / std::max(at.cos_camera, kMinCosine);
  }
  /// True when neither tangent plane leads from one point to near the other.
  [[nodiscard]] bool depth_steps(const SurfaceHit& a, const SurfaceHit& b) const {
    const Vec3 way = b.point - a.point;
    constexpr double kSlope = 0.7;  // sine of the angle out of both planes
    const double out = std::min(std::abs(way.dot(a.normal)), std::abs(way.dot(b.normal)));
    return out > kSlope * way.norm() + truth_.margin_mm();
  }

  const TruthScene& truth_;
  int camera_;
  int width_;
  int height_;
  std::vector<float> distance2_;  ///< px^2 to the nearest vertex
  std::vector<unsigned char> wrong_;
};

}  // namespace

double largest_wrong_patch_mm2(const TruthScene& truth, std::span<const MeasuredPoint> points,
                               std::span<const PointVerdict> verdicts) {
  std::map<std::tuple<int, int, int>, std::vector<std::size_t>> groups;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (verdicts[i].counted) {
      groups[{points[i].camera, points[i].projector, points[i].pattern}].push_back(i);
    }
  }
  std::vector<std::pair<int, std::vector<std::size_t>>> list;
  for (auto& [key, members] : groups) list.emplace_back(std::get<0>(key), std::move(members));

  std::vector<double> largest(list.size(), 0);
  parallel_for(list.size(), [&](std::size_t g) {
    constexpr double kUnlitRadiusPx = 3;
    constexpr double kMaxRadiusPx = 20;
    PatchImage image(truth, list[g].first);
    for (const std::size_t i : list[g].second) {
      const double spacing = verdicts[i].spacing_px.value_or(2 * kUnlitRadiusPx);
      image.stamp({static_cast<double>(points[i].u), static_cast<double>(points[i].v)},
                  std::min(spacing / 2 + 1, kMaxRadiusPx), !verdicts[i].right);
    }
    largest[g] = image.largest_mm2();
  });
  return largest.empty() ? 0 : *std::max_element(largest.begin(), largest.end());
}

}  // namespace pencilscan
