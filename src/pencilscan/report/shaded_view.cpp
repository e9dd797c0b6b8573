#include "pencilscan/report/shaded_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/check.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/report/device_drawing.h"

namespace pencilscan {
namespace {

using Color3 = Eigen::Vector3d;  // linear light

double linear(uchar value) {
  static const auto table = [] {
    std::array<double, 256> light{};
    for (std::size_t i = 0; i < light.size(); ++i)
      light[i] = std::pow(static_cast<double>(i) / 255.0, 2.2);
    return light;
  }();
  return table[value];
}
uchar encoded(double value) {
  return static_cast<uchar>(std::lround(255 * std::pow(std::clamp(value, 0.0, 1.0), 1 / 2.2)));
}
Color3 linear(const Color& c) { return {linear(c[0]), linear(c[1]), linear(c[2])}; }
Color encoded(const Color3& c) { return {encoded(c[0]), encoded(c[1]), encoded(c[2])}; }

const Color kClay{222, 213, 200};
const Color kInvented{140, 170, 205};

/// Evenly spread directions on the sphere (spherical Fibonacci points).
std::vector<Vec3> sphere_directions(int count) {
  std::vector<Vec3> directions;
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2 * i + 1.0) / count;
    const double r = std::sqrt(1 - z * z);
    directions.emplace_back(r * std::cos(golden * i), r * std::sin(golden * i), z);
  }
  return directions;
}

/// Shares of the hemispheres above vertices that nothing within a quarter of the mesh blocks, by
/// rays.
class Openness {
 public:
  Openness(const RayScene& scene, const std::vector<Vec3>& normals, int rays)
      : scene_(scene), normals_(normals), directions_(sphere_directions(2 * rays)) {
    const BoundingBox box = bounding_box(scene.mesh());
    reach_ = 0.25 * (box.high - box.low).norm();
  }

  [[nodiscard]] float operator()(std::size_t vertex) const {
    const Vec3& normal = normals_[vertex];
    const Vec3 from = scene_.mesh().vertices[vertex] + 1e-3 * reach_ * normal;
    double free = 0;
    double all = 0;
    for (const Vec3& d : directions_) {
      const double cosine = d.dot(normal);
      if (cosine <= 0.05) continue;
      all += cosine;
      if (scene_.visible(from, from + reach_ * d, 0)) free += cosine;
    }
    return all > 0 ? static_cast<float>(free / all) : 1.0F;
  }

 private:
  const RayScene& scene_;
  const std::vector<Vec3>& normals_;
  std::vector<Vec3> directions_;
  double reach_ = 0;
};

/// Gives each vertex the mean of its neighbours that have a value (>= 0); with `all`, of itself
/// too.
void spread(const TriangleMesh& mesh, bool all, std::vector<float>& values) {
  std::vector<float> sums(values.size(), 0.0F);
  std::vector<float> counts(values.size(), 0.0F);
  for (const auto& face : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto to = static_cast<std::size_t>(face[k]);
      if (!all && values[to] >= 0) continue;
      for (const int from : face) {
        const float value = values[static_cast<std::size_t>(from)];
        if (value < 0) continue;
        sums[to] += value;
        counts[to] += 1;
      }
    }
  }
  for (std::size_t v = 0; v < values.size(); ++v) {
    if (counts[v] > 0) values[v] = sums[v] / counts[v];
  }
}

/// Openness of every vertex. It varies slowly: rays start from every eighth vertex, and the others
/// take the means of their neighbours.
std::vector<float> ambient_openness(const RayScene& scene, const std::vector<Vec3>& normals,
                                    int rays) {
  constexpr std::size_t kStep = 8;
  constexpr int kRounds = 3;
  const TriangleMesh& mesh = scene.mesh();
  if (rays <= 0 || mesh.faces.empty()) return std::vector<float>(mesh.vertices.size(), 1.0F);
  std::vector<float> values(mesh.vertices.size(), -1.0F);
  const Openness openness(scene, normals, rays);
  parallel_for((values.size() + kStep - 1) / kStep,
               [&](std::size_t i) { values[kStep * i] = openness(kStep * i); });
  for (int round = 0; round < kRounds; ++round) spread(mesh, false, values);
  parallel_for(values.size(), [&](std::size_t v) {
    if (values[v] < 0) values[v] = openness(v);
  });
  spread(mesh, true, values);
  return values;
}

/// A key light from the upper left of the view, a weak fill from the right, a sky above.
double shade(const Vec3& normal, const Vec3& to_eye, const Device& view, double openness) {
  const Mat3& R = view.device_from_world.rotation;
  const Vec3 n_view = R * normal;
  static const Vec3 kKey = Vec3(-0.55, -0.75, -0.8).normalized();  // OpenCV axes: up is -y
  static const Vec3 kFill = Vec3(0.9, -0.1, -0.5).normalized();
  const double key = std::max(0.0, n_view.dot(kKey));
  const double fill = std::max(0.0, n_view.dot(kFill));
  const double sky = 0.5 + 0.5 * normal.z();
  const double rim = std::pow(1 - std::max(0.0, normal.dot(to_eye)), 3.0);
  const double ambient = openness * openness * (0.16 + 0.16 * sky);
  return ambient + (0.35 + 0.65 * openness) * (0.72 * key + 0.16 * fill) + 0.05 * rim;
}

cv::Mat studio_ground(int width, int height) {
  cv::Mat ground(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y) {
    const double t = height > 1 ? double(y) / (height - 1) : 0;
    const Color color(static_cast<uchar>(std::lround(250 - 24 * t)),
                      static_cast<uchar>(std::lround(251 - 22 * t)),
                      static_cast<uchar>(std::lround(253 - 20 * t)));
    ground.row(y).setTo(cv::Scalar(color[0], color[1], color[2]));
  }
  return ground;
}

}  // namespace

Device make_view(const Sphere& scene, const Vec3& direction, int width, int height) {
  PENCILSCAN_CHECK(scene.radius > 0 && width > 0 && height > 0);
  constexpr double kHalfAngle = 0.22;  // rad: a long lens, little perspective
  Device view;
  view.name = "view";
  view.width = width;
  view.height = height;
  const double focal = 0.5 * std::min(width, height) / std::tan(kHalfAngle);
  view.K << focal, 0, 0.5 * (width - 1), 0, focal, 0.5 * (height - 1), 0, 0, 1;
  const double distance = scene.radius / std::sin(kHalfAngle);
  Vec3 towards = direction.normalized();
  // Straight from above or below, "up" is undefined: lean a little.
  if (std::abs(towards.z()) > 0.9999) towards = (towards + Vec3(-1e-3, 0, 0)).normalized();
  view.device_from_world = look_at(scene.center + distance * towards, scene.center);
  return view;
}

MeshPainter::MeshPainter(const TriangleMesh& mesh, int occlusion_rays)
    : scene_(mesh),
      normals_(vertex_normals(mesh)),
      openness_(ambient_openness(scene_, normals_, occlusion_rays)) {}

cv::Mat MeshPainter::coverage(const Device& view, int supersampling) const {
  cv::Mat share(view.height, view.width, CV_32F);
  parallel_for(static_cast<std::size_t>(view.height), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < view.width; ++x) {
      int hits = 0;
      for (int s = 0; s < supersampling * supersampling; ++s) {
        const Vec2 pixel(x - 0.5 + (s % supersampling + 0.5) / supersampling,
                         y - 0.5 + (s / supersampling + 0.5) / supersampling);
        hits += scene_.first_hit(view.ray(pixel)).has_value();
      }
      share.at<float>(y, x) =
          static_cast<float>(hits) / static_cast<float>(supersampling * supersampling);
    }
  });
  return share;
}

cv::Mat MeshPainter::draw(const Device& view, const ShadeOptions& options) const {
  const TriangleMesh& mesh = scene_.mesh();
  PENCILSCAN_CHECK(options.supersampling >= 1 && options.supersampling <= 4);
  PENCILSCAN_CHECK(options.vertex_colors.empty() ||
                   options.vertex_colors.size() == mesh.vertices.size());
  const auto albedo = [&](std::size_t v) -> Color3 {
    if (!options.vertex_colors.empty()) return linear(options.vertex_colors[v]);
    return linear(!mesh.confidence.empty() && mesh.confidence[v] == 0 ? kInvented : kClay);
  };
  cv::Mat picture = studio_ground(view.width, view.height);
  const BoundingBox box = bounding_box(mesh);
  const Vec3 center = 0.5 * (box.low + box.high);
  const double depth = (view.device_from_world * center).z();
  const double frustum_mm = std::max(0.5 * (box.high - box.low).norm(), 1e-6);
  if (options.devices != nullptr) {
    draw_devices(*options.devices, view, frustum_mm, depth, false, picture);
  }
  const int n = options.supersampling;
  parallel_for(static_cast<std::size_t>(view.height), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < view.width; ++x) {
      Color3 sum = Color3::Zero();
      int hits = 0;
      for (int s = 0; s < n * n; ++s) {
        const Vec2 pixel(x - 0.5 + (s % n + 0.5) / n, y - 0.5 + (s / n + 0.5) / n);
        const Ray ray = view.ray(pixel);
        const auto hit = scene_.first_hit(ray);
        if (!hit) continue;
        ++hits;
        Vec3 normal = Vec3::Zero();
        Color3 color = Color3::Zero();
        double openness = 0;
        for (std::size_t k = 0; k < 3; ++k) {
          const auto v = static_cast<std::size_t>(mesh.faces[hit->face][k]);
          const double w = hit->barycentric[static_cast<Eigen::Index>(k)];
          normal += w * normals_[v];
          color += w * albedo(v);
          openness += w * static_cast<double>(openness_[v]);
        }
        const Vec3 to_eye = -ray.direction;
        normal.normalize();
        if (normal.dot(to_eye) < -0.2) normal = -normal;  // the back of an open mesh
        sum += shade(normal, to_eye, view, openness) * color;
      }
      if (hits == 0) continue;
      Color& out = picture.at<Color>(y, x);
      const double missed = n * n - hits;
      out = encoded(Color3((sum + missed * linear(out)) / (n * n)));
    }
  });
  if (options.devices != nullptr) {
    draw_devices(*options.devices, view, frustum_mm, depth, true, picture);
  }
  return picture;
}

std::vector<double> distances_to(const RayScene& truth, const TriangleMesh& mesh) {
  std::vector<double> distances(mesh.vertices.size());
  parallel_for(distances.size(), [&](std::size_t v) {
    const auto closest = truth.closest_point(mesh.vertices[v]);
    distances[v] = closest ? closest->distance : std::numeric_limits<double>::infinity();
  });
  return distances;
}

std::vector<Color> distance_colors(std::span<const double> distances, double high_mm) {
  std::vector<Color> colors;
  colors.reserve(distances.size());
  for (const double d : distances) colors.push_back(sequential_color(d / high_mm));
  return colors;
}

cv::Mat contact_sheet(std::span<const cv::Mat> pictures, std::span<const std::string> labels,
                      int columns) {
  PENCILSCAN_CHECK(columns >= 1 && labels.size() == pictures.size());
  if (pictures.empty()) return {};
  constexpr int kGap = 6;
  constexpr int kLabel = 26;
  const cv::Size size = pictures[0].size();
  const int count = static_cast<int>(pictures.size());
  const int rows = (count + columns - 1) / columns;
  const int across = std::min(columns, count);
  cv::Mat sheet(rows * (size.height + kLabel + kGap) + kGap, across * (size.width + kGap) + kGap,
                CV_8UC3, cv::Scalar(255, 255, 255));
  for (int i = 0; i < count; ++i) {
    const cv::Mat& picture = pictures[static_cast<std::size_t>(i)];
    PENCILSCAN_CHECK(picture.size() == size && picture.type() == CV_8UC3);
    const cv::Point at(kGap + i % columns * (size.width + kGap),
                       kGap + i / columns * (size.height + kLabel + kGap));
    picture.copyTo(sheet(cv::Rect(at, size)));
    draw_text(sheet, labels[static_cast<std::size_t>(i)], at + cv::Point(4, size.height + 17),
              {70, 74, 82}, 0.5);
  }
  return sheet;
}

}  // namespace pencilscan
