#include "pencilscan/surface/silhouette.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "pencilscan/core/chunks.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/surface/mesh_parts.h"
#include "pencilscan/surface/sight.h"

namespace pencilscan {
namespace {

constexpr int kSmoothings = 6;      // per round: fewer leave folds where the moved part ends
constexpr int kRoundsPerScene = 4;  // shadows of a few rounds ago are good enough

class Verdict {
 public:
  Verdict(const Rig& rig, std::span<const Silhouette> silhouettes, const TriangleMesh& mesh,
          double least_cosine)
      : rig_(rig), silhouettes_(silhouettes), scene_(mesh), least_cosine_(least_cosine) {}

  /// For a vertex that is now at `now` and was at x, with its normal, when the scene was made.
  [[nodiscard]] bool is_outside(const Vec3& now, const Vec3& x, const Vec3& normal) const {
    bool dark = false;
    for (const Silhouette& silhouette : silhouettes_) {
      const Camera& camera = rig_.cameras[static_cast<std::size_t>(silhouette.camera)];
      const auto pixel = camera.project(now);
      if (!pixel || !camera.contains(*pixel)) continue;
      const int u =
          std::clamp(static_cast<int>(std::lround((*pixel)[0])), 0, silhouette.light.cols - 1);
      const int v =
          std::clamp(static_cast<int>(std::lround((*pixel)[1])), 0, silhouette.light.rows - 1);
      if (silhouette.light.at<std::uint8_t>(v, u) != 0) continue;
      if (!sees(scene_, camera.center(), x, normal, kLeastSightCosine)) continue;
      if (nothing_measured_behind(camera.center(), x)) return true;
      dark = dark || (camera.center() - x).normalized().dot(normal) > least_cosine_;
    }
    if (!dark) return false;
    return std::any_of(rig_.projectors.begin(), rig_.projectors.end(),
                       [&](const Projector& projector) {
                         const auto pixel = projector.project(x);
                         return pixel && projector.contains(*pixel) &&
                                sees(scene_, projector.center(), x, normal, least_cosine_);
                       });
  }

  /// Distance to the opposite side of the mesh; nothing where there is none.
  [[nodiscard]] double thickness(const Vec3& x, const Vec3& normal) const {
    Ray ray;
    ray.origin = x - kOffSurface * normal;
    ray.direction = -normal;
    const auto hit = scene_.first_hit(ray);
    return hit ? hit->distance : 0;
  }

 private:
  /// True when the ray of sight meets invented faces only.
  [[nodiscard]] bool nothing_measured_behind(const Vec3& eye, const Vec3& x) const {
    constexpr int kMostHits = 12;
    Ray ray;
    ray.direction = (x - eye).normalized();
    ray.origin = x - 2 * kOffSurface * ray.direction;
    const TriangleMesh& mesh = scene_.mesh();
    for (int k = 0; k < kMostHits; ++k) {
      const auto hit = scene_.first_hit(ray);
      if (!hit) return true;
      bool invented = false;
      for (const int v : mesh.faces[hit->face])
        invented = invented || !(mesh.confidence[static_cast<std::size_t>(v)] > 0);
      if (!invented) return false;
      ray.origin = hit->point + 0.01 * ray.direction;
    }
    return false;
  }

  const Rig& rig_;
  std::span<const Silhouette> silhouettes_;
  RayScene scene_;
  double least_cosine_;
};

/// Half-way to the mean of the neighbours, for vertices where `which` is set.
void smooth(std::span<const char> which, TriangleMesh& mesh) {
  struct Sum {
    Vec3 of = Vec3::Zero();
    double count = 0;
  };
  std::vector<Sum> neighbors(mesh.vertices.size());
  for (const auto& face : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto a = static_cast<std::size_t>(face[k]);
      if (!which[a]) continue;
      neighbors[a].of += mesh.vertices[static_cast<std::size_t>(face[(k + 1) % 3])];
      ++neighbors[a].count;
    }
  }
  for (std::size_t v = 0; v < neighbors.size(); ++v) {
    const Sum& sum = neighbors[v];
    if (sum.count > 0) mesh.vertices[v] = 0.5 * (mesh.vertices[v] + sum.of / sum.count);
  }
}

}  // namespace

double line_reach_px(const Rig& rig, const Camera& camera) {
  const Sphere volume = working_volume(rig);
  const double camera_px_per_mm = camera.K(0, 0) / (camera.center() - volume.center).norm();
  double spacing_mm = 0;
  for (const Projector& projector : rig.projectors) {
    const double mm_per_px = (projector.center() - volume.center).norm() / projector.K(0, 0);
    for (const LinePattern& pattern : projector.patterns)
      spacing_mm = std::max(spacing_mm, pattern.pitch_px * mm_per_px);
  }
  return 0.5 * spacing_mm * camera_px_per_mm;
}

Silhouette silhouette(int camera, const cv::Mat& image, double reach_px) {
  constexpr float kLeastContrast = 0.02F;  // of full scale
  constexpr float kDark = 0.06F;           // of the light of lines
  cv::Mat brightest(image.rows, image.cols, CV_32F);
  std::vector<float> values;
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const auto& rgb = image.at<cv::Vec3f>(v, u);
      const float value = std::isfinite(rgb[0]) ? std::max({rgb[0], rgb[1], rgb[2]}) : 1.F;
      brightest.at<float>(v, u) = value;
      if (v % 4 == 0 && u % 4 == 0) values.push_back(value);
    }
  }
  Silhouette result;
  result.camera = camera;
  std::sort(values.begin(), values.end());
  const float low = values[values.size() / 5];
  const float high = values[values.size() * 98 / 100];
  if (high - low < kLeastContrast) {
    result.light = cv::Mat(image.rows, image.cols, CV_8U, cv::Scalar(1));
    return result;
  }
  cv::Mat smoothed;
  cv::blur(brightest, smoothed, cv::Size(3, 3));
  const cv::Mat light = smoothed > low + kDark * (high - low);
  const int reach = static_cast<int>(std::ceil(std::clamp(reach_px, 1.0, 40.0))) + 1;
  cv::dilate(light, result.light,
             cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(2 * reach + 1, 2 * reach + 1)));
  return result;
}

std::size_t carve(const Rig& rig, std::span<const Silhouette> silhouettes,
                  const CarvingOptions& options, TriangleMesh& mesh) {
  if (silhouettes.empty() || mesh.confidence.empty()) return 0;
  const auto is_invented = [](const TriangleMesh& of, std::size_t v) {
    return !(of.confidence[v] > 0);
  };
  std::vector<char> may_move(mesh.faces.size(), 0);
  std::vector<char> is_loose(mesh.vertices.size(), 0);
  for (std::size_t f = 0; f < may_move.size(); ++f) {
    for (const int v : mesh.faces[f])
      may_move[f] |= static_cast<char>(is_invented(mesh, static_cast<std::size_t>(v)));
    if (!may_move[f]) continue;
    for (const int v : mesh.faces[f]) is_loose[static_cast<std::size_t>(v)] = 1;
  }
  // What may move, by itself, and where its vertices are in the mesh.
  TriangleMesh loose = submesh(mesh, may_move);
  std::vector<std::size_t> place;
  for (std::size_t v = 0; v < is_loose.size(); ++v) {
    if (is_loose[v]) place.push_back(v);
  }
  const auto put_back = [&] {
    for (std::size_t v = 0; v < place.size(); ++v) mesh.vertices[place[v]] = loose.vertices[v];
  };
  std::vector<char> ever(place.size(), 0);
  std::optional<Verdict> verdict;
  std::vector<Vec3> then, then_normals;  // when the scene was made
  for (int round = 0; round < options.rounds; ++round) {
    const std::vector<Vec3> normals = vertex_normals(loose);
    if (round % kRoundsPerScene == 0) {
      put_back();
      verdict.emplace(rig, silhouettes, mesh, options.least_cosine);
      then = loose.vertices;
      then_normals = normals;
    }
    std::vector<char> moves(place.size(), 0);
    parallel_chunks(place.size(), [&](std::size_t v) {
      if (!is_invented(loose, v) || !(normals[v].squaredNorm() > 0.5)) return;
      if (!verdict->is_outside(loose.vertices[v], then[v], then_normals[v])) return;
      const double room = verdict->thickness(then[v], then_normals[v]);
      loose.vertices[v] -= std::min(options.step, 0.25 / kRoundsPerScene * room) * normals[v];
      moves[v] = 1;
    });
    if (std::find(moves.begin(), moves.end(), 1) == moves.end()) break;
    const std::vector<char> along =
        grown(loose, moves, 4, [&](std::size_t v) { return is_invented(loose, v); });
    for (int pass = 0; pass < kSmoothings; ++pass) smooth(along, loose);
    for (std::size_t v = 0; v < ever.size(); ++v) ever[v] = ever[v] || moves[v];
  }
  put_back();
  return static_cast<std::size_t>(std::count(ever.begin(), ever.end(), 1));
}

}  // namespace pencilscan
