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

bool is_invented(const TriangleMesh& mesh, std::size_t v) { return !(mesh.confidence[v] > 0); }

/// What rays meet: faces that stay, and faces that may have moved since.
class Obstacles {
 public:
  explicit Obstacles(const TriangleMesh& fixed) : fixed_(fixed), loose_(TriangleMesh()) {}
  void put(const TriangleMesh& loose) { loose_ = RayScene(loose); }

  [[nodiscard]] bool sees(const Vec3& eye, const Vec3& x, const Vec3& normal,
                          double least_cosine) const {
    return pencilscan::sees(loose_, eye, x, normal, least_cosine) &&
           pencilscan::sees(fixed_, eye, x, normal, least_cosine);
  }

  struct Hit {
    double distance;
    Vec3 point;
    bool invented;  ///< a vertex of the face is
  };
  [[nodiscard]] std::optional<Hit> first_hit(const Ray& ray) const {
    const auto near = loose_.first_hit(ray);
    const auto measured = fixed_.first_hit(ray);
    if (measured && !(near && near->distance <= measured->distance))
      return Hit{measured->distance, measured->point, false};
    if (!near) return std::nullopt;
    return Hit{near->distance, near->point, true};
  }

 private:
  RayScene fixed_;
  RayScene loose_;
};

/// What the silhouettes say of vertices. What they were asked is remembered: most vertices rest.
class Verdict {
 public:
  Verdict(const Rig& rig, std::span<const Silhouette> silhouettes, const TriangleMesh& fixed,
          std::size_t vertices, double least_cosine)
      : rig_(rig),
        silhouettes_(silhouettes),
        obstacles_(fixed),
        least_cosine_(least_cosine),
        of_vertex_(vertices) {}

  /// What moved has moved.
  void start_scene(const TriangleMesh& loose, std::span<const Vec3> normals) {
    obstacles_.put(loose);
    then_ = loose.vertices;
    normals_.assign(normals.begin(), normals.end());
    for (Asked& asked : of_vertex_) asked.answer.reset();
  }

  /// How far inwards vertex v, which is now at x, may go at once; nothing where it is not outside.
  [[nodiscard]] std::optional<double> room(std::size_t v, const Vec3& x) {
    Asked& asked = of_vertex_[v];
    if (!asked.at || *asked.at != x) {
      asked.at = x;
      std::vector<std::uint8_t> dark = dark_at(x);
      if (dark != asked.dark) asked.answer.reset();
      asked.dark = std::move(dark);
    }
    if (asked.dark.empty()) return std::nullopt;
    if (!asked.answer) asked.answer = is_outside(v, asked.dark) ? thickness(v) : -1;
    if (*asked.answer < 0) return std::nullopt;
    return asked.answer;
  }

 private:
  struct Asked {
    std::optional<Vec3> at;
    std::vector<std::uint8_t> dark;  ///< silhouettes
    std::optional<double> answer;    ///< in this scene; < 0: it is not outside
  };

  /// The silhouettes that are dark where they show a place.
  [[nodiscard]] std::vector<std::uint8_t> dark_at(const Vec3& x) const {
    std::vector<std::uint8_t> dark;
    for (std::size_t k = 0; k < silhouettes_.size(); ++k) {
      const Camera& camera = camera_of(k);
      const cv::Mat& light = silhouettes_[k].light;
      const auto pixel = camera.project(x);
      if (!pixel || !camera.contains(*pixel)) continue;
      const int u = std::clamp(static_cast<int>(std::lround((*pixel)[0])), 0, light.cols - 1);
      const int v = std::clamp(static_cast<int>(std::lround((*pixel)[1])), 0, light.rows - 1);
      if (light.at<std::uint8_t>(v, u) == 0) dark.push_back(static_cast<std::uint8_t>(k));
    }
    return dark;
  }

  [[nodiscard]] bool is_outside(std::size_t vertex, std::span<const std::uint8_t> dark) const {
    const Vec3& x = then_[vertex];
    const Vec3& normal = normals_[vertex];
    bool may_be_lit = false;
    for (const std::uint8_t k : dark) {
      const Vec3 eye = camera_of(k).center();
      if (!obstacles_.sees(eye, x, normal, kLeastSightCosine)) continue;
      if (nothing_measured_behind(eye, x)) return true;
      may_be_lit = may_be_lit || (eye - x).normalized().dot(normal) > least_cosine_;
    }
    if (!may_be_lit) return false;
    return std::any_of(rig_.projectors.begin(), rig_.projectors.end(),
                       [&](const Projector& projector) {
                         const auto pixel = projector.project(x);
                         return pixel && projector.contains(*pixel) &&
                                obstacles_.sees(projector.center(), x, normal, least_cosine_);
                       });
  }

  /// Distance to the opposite side of the mesh; 0 where there is none.
  [[nodiscard]] double thickness(std::size_t vertex) const {
    Ray ray;
    ray.origin = then_[vertex] - kOffSurface * normals_[vertex];
    ray.direction = -normals_[vertex];
    const auto hit = obstacles_.first_hit(ray);
    return hit ? hit->distance : 0;
  }

  /// True when the ray of sight meets invented faces only.
  [[nodiscard]] bool nothing_measured_behind(const Vec3& eye, const Vec3& x) const {
    constexpr int kMostHits = 12;
    Ray ray;
    ray.direction = (x - eye).normalized();
    ray.origin = x - 2 * kOffSurface * ray.direction;
    for (int k = 0; k < kMostHits; ++k) {
      const auto hit = obstacles_.first_hit(ray);
      if (!hit) return true;
      if (!hit->invented) return false;
      ray.origin = hit->point + 0.01 * ray.direction;
    }
    return false;
  }

  [[nodiscard]] const Camera& camera_of(std::size_t silhouette) const {
    return rig_.cameras[static_cast<std::size_t>(silhouettes_[silhouette].camera)];
  }

  const Rig& rig_;
  std::span<const Silhouette> silhouettes_;
  Obstacles obstacles_;
  double least_cosine_;
  std::vector<Asked> of_vertex_;
  std::vector<Vec3> then_, normals_;  ///< when the scene was made
};

/// Half-way to the mean of the neighbours.
void smooth(std::span<const std::size_t> which, const FacesOf& faces, TriangleMesh& mesh) {
  std::vector<Vec3> moved(which.size());
  parallel_chunks(which.size(), [&](std::size_t i) {
    const std::size_t v = which[i];
    Vec3 sum = Vec3::Zero();
    for (const std::uint32_t f : faces[v]) sum += mesh.vertices[next_around(mesh.faces[f], v)];
    moved[i] = 0.5 * (mesh.vertices[v] + sum / static_cast<double>(faces[v].size()));
  });
  for (std::size_t i = 0; i < which.size(); ++i) mesh.vertices[which[i]] = moved[i];
}

/// The normal that vertex_normals() gives.
Vec3 normal_of(const TriangleMesh& mesh, std::span<const std::uint32_t> faces) {
  Vec3 sum = Vec3::Zero();
  for (const std::uint32_t f : faces) {
    const auto corner = [&](std::size_t k) -> const Vec3& {
      return mesh.vertices[static_cast<std::size_t>(mesh.faces[f][k])];
    };
    sum += (corner(1) - corner(0)).cross(corner(2) - corner(0));
  }
  sum.stableNormalize();
  return sum;
}

}  // namespace

double line_reach_px(const Rig& rig, const Camera& camera) {
  const Sphere volume = working_volume(rig);
  const double camera_px_per_mm = camera.focal_px() / (camera.center() - volume.center).norm();
  double spacing_mm = 0;
  for (const Projector& projector : rig.projectors) {
    const double mm_per_px = (projector.center() - volume.center).norm() / projector.focal_px();
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
      // Of whatever channel is no number, the sum is none either.
      const bool is_light = std::isfinite(rgb[0] + rgb[1] + rgb[2]);
      const float value = is_light ? std::max({rgb[0], rgb[1], rgb[2]}) : 1.F;
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
  std::vector<char> may_move(mesh.faces.size(), 0);
  std::vector<char> may_not(mesh.faces.size(), 0);
  std::vector<char> is_loose(mesh.vertices.size(), 0);
  for (std::size_t f = 0; f < may_move.size(); ++f) {
    for (const int v : mesh.faces[f])
      may_move[f] |= static_cast<char>(is_invented(mesh, static_cast<std::size_t>(v)));
    may_not[f] = may_move[f] == 0 ? 1 : 0;
    if (!may_move[f]) continue;
    for (const int v : mesh.faces[f]) is_loose[static_cast<std::size_t>(v)] = 1;
  }
  // What may move, by itself, and where its vertices are in the mesh.
  TriangleMesh loose = submesh(mesh, may_move);
  const FacesOf faces(loose);
  std::vector<std::size_t> place;
  for (std::size_t v = 0; v < is_loose.size(); ++v) {
    if (is_loose[v]) place.push_back(v);
  }
  Verdict verdict(rig, silhouettes, submesh(mesh, may_not), place.size(), options.least_cosine);
  std::vector<char> ever(place.size(), 0);
  for (int round = 0; round < options.rounds; ++round) {
    if (round % kRoundsPerScene == 0) verdict.start_scene(loose, vertex_normals(loose));
    std::vector<double> rooms(place.size(), -1);
    std::vector<Vec3> inwards(place.size());
    parallel_chunks(place.size(), [&](std::size_t v) {
      if (!is_invented(loose, v)) return;
      const auto room = verdict.room(v, loose.vertices[v]);
      if (!room) return;
      inwards[v] = -normal_of(loose, faces[v]);
      if (inwards[v].squaredNorm() > 0.5) rooms[v] = *room;
    });
    std::vector<std::size_t> moves;
    for (std::size_t v = 0; v < rooms.size(); ++v) {
      if (rooms[v] < 0) continue;
      loose.vertices[v] += std::min(options.step, 0.25 / kRoundsPerScene * rooms[v]) * inwards[v];
      moves.push_back(v);
      ever[v] = 1;
    }
    if (moves.empty()) break;
    const std::vector<std::size_t> along = around(
        loose, faces, std::move(moves), 4, [&](std::size_t v) { return is_invented(loose, v); });
    for (int pass = 0; pass < kSmoothings; ++pass) smooth(along, faces, loose);
  }
  for (std::size_t v = 0; v < place.size(); ++v) mesh.vertices[place[v]] = loose.vertices[v];
  return static_cast<std::size_t>(std::count(ever.begin(), ever.end(), 1));
}

}  // namespace pencilscan
