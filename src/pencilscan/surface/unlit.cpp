#include "pencilscan/surface/unlit.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "pencilscan/core/chunks.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/surface/sight.h"

namespace pencilscan {
namespace {

constexpr double kFacing = 0.5;          // cosine to the camera; flatter, the mesh is off in it
constexpr double kLeastLitCosine = 0.2;  // of the incidence to the projector, as for holes

cv::Mat square(int reach) {
  return cv::getStructuringElement(cv::MORPH_RECT, cv::Size(2 * reach + 1, 2 * reach + 1));
}

constexpr int kStep = 4;  // px: levels of light change slowly

/// 255 where lines of a part of one presence image (CV_32FC1) stand out of the dark around them;
/// the other pixels of the image, `dark_beside`, hold nothing.
cv::Mat lit_in(const cv::Mat& presence, double spacing_px, int dark_beside) {
  // Lenses and the object itself scatter a hundredth or two of the light into what is dark.
  constexpr float kScattered = 0.03F;
  constexpr float kDark = 0.06F;      // as in silhouette.cpp: more is light, whatever the noise
  constexpr double kAround = 3;       // line spacings: lines of the same light
  constexpr double kInNoise = 0.95;   // share of the dark below a level ...
  constexpr float kBeyondNoise = 3;   // ... so many times which a disc of pixels stays below
  constexpr float kOwnHeight = 0.5F;  // of the line: farther out it only is its blur
  const auto reach = [](double px) { return static_cast<int>(std::ceil(px)); };
  cv::Mat lines;
  cv::blur(presence, lines, cv::Size(3, 3));
  cv::morphologyEx(lines, lines, cv::MORPH_TOPHAT, square(reach(0.5 * spacing_px)));
  cv::Mat highest;
  cv::dilate(lines, highest, square(kStep / 2));
  const auto coarse = [&](const cv::Mat& fine) {
    cv::Mat picked;
    cv::resize(fine, picked,
               cv::Size((fine.cols + kStep - 1) / kStep, (fine.rows + kStep - 1) / kStep), 0, 0,
               cv::INTER_NEAREST);
    return picked;
  };
  const cv::Mat picked = coarse(lines);
  const cv::Mat peaks = coarse(highest);
  cv::Mat beside;
  cv::dilate(peaks, beside, square(reach(spacing_px / kStep)));
  const float bright =
      lower_quantile(std::vector<float>(picked.begin<float>(), picked.end<float>()), 0.99);
  std::vector<float> in_dark(static_cast<std::size_t>(dark_beside / (kStep * kStep)), 0.F);
  for (int v = 0; v < picked.rows; ++v) {
    for (int u = 0; u < picked.cols; ++u)
      if (beside.at<float>(v, u) <= kDark * bright) in_dark.push_back(picked.at<float>(v, u));
  }
  const float noise = kBeyondNoise * lower_quantile(std::move(in_dark), kInNoise);
  cv::Mat around;
  cv::dilate(peaks, around, square(reach(kAround * spacing_px / kStep)));
  const cv::Mat scattered = around * kScattered;
  const cv::Mat dim = around * kDark;
  cv::Mat least;
  cv::max(scattered, noise, least);
  cv::min(least, dim, least);
  cv::resize(least, least, lines.size(), 0, 0, cv::INTER_NEAREST);
  return (lines > least) & (lines > highest * kOwnHeight);
}

/// The same of a whole image. Detection leaves it black outside of what is lit.
cv::Mat lit_by(const cv::Mat& presence, double spacing_px) {
  cv::Mat lit(presence.size(), CV_8U, cv::Scalar(0));
  const cv::Rect bright = cv::boundingRect(presence != 0);
  if (bright.empty()) return lit;
  const cv::Point corner(bright.x / kStep * kStep, bright.y / kStep * kStep);
  const cv::Rect area(corner, bright.br());
  const int beside = static_cast<int>(presence.total()) - area.area();
  lit_in(presence(area), spacing_px, beside).copyTo(lit(area));
  return lit;
}

/// Pixels from each to the nearest that is lit (CV_8U, not 0), CV_32FC1.
cv::Mat way_to(const cv::Mat& lit) {
  cv::Mat way;
  cv::distanceTransform(lit == 0, way, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  return way;
}

/// The same for the light of each family.
std::vector<cv::Mat> ways_to_light(const CameraLight& light) {
  const cv::Mat overexposed = light.valid == 0;
  std::vector<cv::Mat> ways;
  for (const cv::Mat& presence : light.families)
    ways.push_back(way_to(lit_by(presence, static_cast<double>(light.spacing_px)) | overexposed));
  return ways;
}

/// To the light of any.
cv::Mat shortest(const std::vector<cv::Mat>& ways) {
  cv::Mat least = ways.front().clone();
  for (const cv::Mat& way : ways) cv::min(least, way, least);
  return least;
}

/// Where one camera shows no light although it would have to.
class DarkPlaces {
 public:
  DarkPlaces(const Rig& rig, const RayScene& scene, const CameraLight& light)
      : rig_(rig),
        scene_(scene),
        light_(light),
        eye_(light.camera->center()),
        ways_(ways_to_light(light)),
        way_(shortest(ways_)),
        dark_(way_.rows, way_.cols, CV_8U, cv::Scalar(0)) {}

  /// True where the nearest line of a pattern is missing at a place with this normal: where its own
  /// family's light is, or `any_light`.
  [[nodiscard]] bool lacks_line(const Vec3& x, const Vec3& normal, bool any_light) const {
    const auto at = pixel_facing(x, normal);
    if (!at) return false;
    const auto is_dark = [&](const cv::Mat& way) { return way.at<float>(*at) > kOff; };
    if (std::none_of(ways_.begin(), ways_.end(), is_dark) ||
        !sees(scene_, eye_, x, normal, kFacing))
      return false;
    const TangentView view(*light_.camera, x, normal);
    return std::any_of(
        light_.patterns.begin(), light_.patterns.end(), [&](const PatternView& pattern) {
          const cv::Mat& way = any_light ? way_ : ways_[static_cast<std::size_t>(pattern.family())];
          return is_missing(pattern, view, x, normal, static_cast<double>(way.at<float>(*at)));
        });
  }
  /// The disc without light around a place is dark.
  void darken_around(const Vec3& x) {
    constexpr int kRim = 2;  // px: of a line's blur and of rounding to pixels
    const auto at = pixel_of(x);
    if (!at) return;
    const int radius = static_cast<int>(way_.at<float>(*at)) - kRim;
    if (radius < 0) return;
    cv::circle(dark_, *at, radius, cv::Scalar(1), cv::FILLED);
    has_dark_ = true;
  }
  /// True where the camera sees a place in such a disc.
  [[nodiscard]] bool shows_dark(const Vec3& x, const Vec3& normal) const {
    if (!has_dark_) return false;
    const auto at = pixel_facing(x, normal);
    return at && dark_.at<std::uint8_t>(*at) != 0 && sees(scene_, eye_, x, normal, kFacing);
  }

 private:
  static constexpr double kOff = 1;  // px: of a predicted line, and of rounding to pixels

  [[nodiscard]] std::optional<cv::Point> pixel_of(const Vec3& x) const {
    const auto pixel = light_.camera->project(x);
    if (!pixel || !light_.camera->contains(*pixel)) return std::nullopt;
    return cv::Point(std::clamp(static_cast<int>(std::lround((*pixel)[0])), 0, way_.cols - 1),
                     std::clamp(static_cast<int>(std::lround((*pixel)[1])), 0, way_.rows - 1));
  }
  /// Where the camera shows a place that faces it, whether or not something is in the way.
  [[nodiscard]] std::optional<cv::Point> pixel_facing(const Vec3& x, const Vec3& normal) const {
    const Vec3 to_eye = eye_ - x;
    if (to_eye.dot(normal) < kFacing * to_eye.norm()) return std::nullopt;
    return pixel_of(x);
  }
  /// True where the pattern's line nearest to x lies within `way` px, and its projector lights it.
  [[nodiscard]] bool is_missing(const PatternView& pattern, const TangentView& view, const Vec3& x,
                                const Vec3& normal, double way) const {
    bool ok = false;
    const WindowLines lines = pattern.lines(view.normalized, view.jacobian, view.w, ok);
    if (!ok) return false;
    const auto w = static_cast<float>(view.w);
    const Vec2 slope = lines.gradient(w, view.slope[0], view.slope[1]).cast<double>();
    if ((way - kOff) * slope.norm() <= 0.5) return false;
    const auto here = static_cast<double>(lines.line(0, 0, w));
    const double line = std::round(here);
    const Projector& projector = rig_.projectors[static_cast<std::size_t>(pattern.projector())];
    if (line < 0 || line > projector.line_count(pattern.pattern()) - 1) return false;
    const Vec2 to_line = (line - here) / slope.squaredNorm() * slope;
    const Ray ray = light_.camera->ray(*light_.camera->project(x) + to_line);
    const double descent = -ray.direction.dot(normal);
    if (descent < kLeastLitCosine) return false;
    const Vec3 on_line = ray.origin + (ray.origin - x).dot(normal) / descent * ray.direction;
    return sees(scene_, projector.center(), on_line, normal, kLeastLitCosine);
  }

  const Rig& rig_;
  const RayScene& scene_;
  const CameraLight& light_;
  Vec3 eye_;
  std::vector<cv::Mat> ways_;  ///< to the light of each family
  cv::Mat way_;                ///< to the light of any
  cv::Mat dark_;               ///< CV_8U, 1: in the disc of a vertex that lacks a line
  bool has_dark_ = false;
};

}  // namespace

std::vector<char> unlit_vertices(const Rig& rig, const RayScene& scene,
                                 std::span<const CameraLight> lights, const TriangleMesh& mesh,
                                 std::span<const SurfaceEvidence> evidence) {
  constexpr float kSeveral = 1.5F;  // cameras; between vertices, their number is a mean

  const std::vector<Vec3> normals = vertex_normals(mesh);
  std::vector<std::vector<char>> unlit(lights.size());
  parallel_for(lights.size(), [&](std::size_t k) {
    DarkPlaces places(rig, scene, lights[k]);
    unlit[k].assign(mesh.vertices.size(), 0);
    parallel_chunks(mesh.vertices.size(), [&](std::size_t v) {
      const bool is_seen_twice = !evidence.empty() && evidence[v].cameras > kSeveral;
      unlit[k][v] = places.lacks_line(mesh.vertices[v], normals[v], is_seen_twice) ? 1 : 0;
    });
    // What was invented may lie anywhere: it says nothing of what is around.
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
      if (unlit[k][v] != 0 && mesh.confidence[v] > 0) places.darken_around(mesh.vertices[v]);
    parallel_chunks(mesh.vertices.size(), [&](std::size_t v) {
      if (unlit[k][v] == 0 && places.shows_dark(mesh.vertices[v], normals[v])) unlit[k][v] = 1;
    });
  });
  std::vector<char> by_any(mesh.vertices.size(), 0);
  for (const std::vector<char>& by_one : unlit)
    for (std::size_t v = 0; v < by_any.size(); ++v) by_any[v] |= by_one[v];
  return by_any;
}

}  // namespace pencilscan
