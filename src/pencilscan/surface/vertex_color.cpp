#include "pencilscan/surface/vertex_color.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>

#include "pencilscan/core/chunks.h"
#include "pencilscan/depth/pattern_view.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/surface/sight.h"
#include "pencilscan/view/sample_color.h"

namespace pencilscan {
namespace {

using Channels = Eigen::Array3f;

constexpr float kTolerance = 1e-4F;  // of a vertex's albedo: a fortieth of a step of 8 bits

/// What one camera says of one vertex that it sees: image = albedo * (light + ambient).
struct Sample {
  Channels light = Channels::Zero();
  Channels image = Channels::Zero();
  float weight = 0;  ///< > 0
  std::uint32_t vertex = 0;
  std::uint32_t view = 0;
};

/// Runs of vertices: the samples of each, in order of vertices and views.
using Samples = std::vector<std::vector<Sample>>;
constexpr std::size_t kVerticesPerRun = 1024;

/// Share of a pixel's light at line coordinate l under lines of half width h (lines), blurred by a
/// Gaussian of deviation s (lines).
double line_profile(double l, double h, double s) {
  const double a = std::abs(l - std::round(l));
  const double k = 1 / (std::numbers::sqrt2 * std::max(s, 1e-3));
  // Beyond 4, erf(x) is 1 but for 2e-8.
  const auto error = [](double x) { return x > 4 ? 1 : x < -4 ? -1 : std::erf(x); };
  const auto box = [&](double x) { return 0.5 * (error((h - x) * k) + error((h + x) * k)); };
  return box(a) + box(1 - a);
}

class Light {
 public:
  Light(const Rig& rig, const RayScene& surface, std::span<const ColorView> views,
        const ColorOptions& options)
      : rig_(rig), scene_(surface), options_(options), reference_mm_(rig.projectors.size()) {
    const Sphere volume = working_volume(rig);
    for (std::size_t p = 0; p < rig.projectors.size(); ++p)
      reference_mm_[p] = (rig.projectors[p].center() - volume.center).norm();
    for (const ColorView& view : views) {
      patterns_.emplace_back();
      const Camera& camera = rig.cameras[static_cast<std::size_t>(view.camera)];
      if (view.is_plain) continue;
      for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
        for (std::size_t k = 0; k < rig.projectors[p].patterns.size(); ++k)
          patterns_.back().emplace_back(rig, camera, static_cast<int>(p), static_cast<int>(k));
      }
    }
  }

  [[nodiscard]] bool sees(const Vec3& eye, const Vec3& x, const Vec3& normal) const {
    return pencilscan::sees(scene_, eye, x, normal, options_.least_cosine);
  }

  /// Of each projector at a place, relative to the centre of the volume at a right angle; 0 in
  /// shadow.
  void irradiance(const Vec3& x, const Vec3& normal, std::vector<double>& of_projector) const {
    of_projector.assign(rig_.projectors.size(), 0.0);
    for (std::size_t p = 0; p < rig_.projectors.size(); ++p) {
      const Projector& projector = rig_.projectors[p];
      const auto pixel = projector.project(x);
      if (!pixel || !projector.contains(*pixel) || !sees(projector.center(), x, normal)) continue;
      const Vec3 way = projector.center() - x;
      const double near = reference_mm_[p] / way.norm();
      of_projector[p] = near * near * way.normalized().dot(normal);
    }
  }

  /// Pattern light that a camera ought to see there.
  [[nodiscard]] Channels pattern_light(std::size_t view, const Camera& camera, double blur_px,
                                       const Vec3& x, const Vec3& normal,
                                       std::span<const double> irradiance) const {
    Channels light = Channels::Zero();
    const TangentView at(camera, x, normal);
    const auto w = static_cast<float>(at.w);
    for (const PatternView& pattern : patterns_[view]) {
      const double power = irradiance[static_cast<std::size_t>(pattern.projector())];
      if (!(power > 0)) continue;
      bool ok = false;
      const WindowLines lines = pattern.lines(at.normalized, at.jacobian, at.w, ok);
      if (!ok) continue;
      const double l = static_cast<double>(lines.line(0, 0, w));
      const double blur =
          blur_px * static_cast<double>(lines.gradient(w, at.slope[0], at.slope[1]).norm());
      const Rgb color = pattern.pattern().color(static_cast<int>(std::lround(std::max(l, 0.0))));
      const double value =
          power * line_profile(l, static_cast<double>(pattern.half_width()), std::min(blur, 0.5));
      light += (value * Eigen::Array3d(color[0], color[1], color[2])).cast<float>();
    }
    return light;
  }

 private:
  const Rig& rig_;
  const RayScene& scene_;
  ColorOptions options_;
  std::vector<double> reference_mm_;
  std::vector<std::vector<PatternView>> patterns_;  ///< per view
};

Samples collect(const Rig& rig, const RayScene& surface, std::span<const ColorView> views,
                const ColorOptions& options, bool has_plain) {
  const TriangleMesh& mesh = surface.mesh();
  const Light light(rig, surface, views, options);
  const std::vector<Vec3> normals = vertex_normals(mesh);
  const auto look = [&](std::size_t v, std::vector<Sample>& samples) {
    if (!mesh.confidence.empty() && !(mesh.confidence[v] > 0)) return;  // it may be elsewhere
    const Vec3& x = mesh.vertices[v];
    thread_local std::vector<double> irradiance;
    irradiance.clear();
    for (std::size_t k = 0; k < views.size(); ++k) {
      const Camera& camera = rig.cameras[static_cast<std::size_t>(views[k].camera)];
      if (views[k].is_plain != has_plain) continue;
      const auto pixel = camera.project(x);
      if (!pixel || !camera.contains(*pixel) || !light.sees(camera.center(), x, normals[v]))
        continue;
      Sample sample;
      sample.image = views[k].light_from_image *
                     sample_color(views[k].image, pixel->x(), pixel->y(), views[k].full).matrix();
      if (!sample.image.isFinite().all()) continue;
      sample.weight = static_cast<float>((camera.center() - x).normalized().dot(normals[v]));
      sample.vertex = static_cast<std::uint32_t>(v);
      sample.view = static_cast<std::uint32_t>(k);
      if (has_plain) {
        sample.light = Channels::Ones();
      } else {
        if (irradiance.empty()) light.irradiance(x, normals[v], irradiance);
        sample.light = light.pattern_light(k, camera, views[k].blur_px, x, normals[v], irradiance);
      }
      samples.push_back(sample);
    }
  };
  const std::size_t count = mesh.vertices.size();
  Samples samples((count + kVerticesPerRun - 1) / kVerticesPerRun);
  parallel_for(samples.size(), [&](std::size_t r) {
    for (std::size_t v = r * kVerticesPerRun; v < std::min(count, (r + 1) * kVerticesPerRun); ++v)
      look(v, samples[r]);
  });
  return samples;
}

/// Sum of value(v) over all vertices, which value may change.
template <class Value>
Eigen::Array4d ordered_sum(std::size_t count, const Value& value) {
  constexpr std::size_t kRun = 4096;
  const Eigen::Array4d zero = Eigen::Array4d::Zero();
  return sum_of_runs(count, kRun, zero, [&](std::size_t from, std::size_t to) {
    Eigen::Array4d sum = zero;
    for (std::size_t v = from; v < to; ++v) sum += value(v);
    return sum;
  });
}

/// Sums of the normal equations of one vertex: albedo = right / weight.
struct Evidence {
  Channels weight = Channels::Zero();
  Channels right = Channels::Zero();
};

std::vector<Evidence> evidence(const Samples& samples, std::size_t vertices,
                               std::span<const Channels> ambient) {
  std::vector<Evidence> sums(vertices);
  parallel_for(samples.size(), [&](std::size_t r) {
    for (const Sample& s : samples[r]) {
      const Channels light = s.light + ambient[s.view];
      sums[s.vertex].weight += s.weight * light * light;
      sums[s.vertex].right += s.weight * light * s.image;
    }
  });
  return sums;
}

/// Ambient light of each view: least squares over vertices where no line falls.
std::vector<Channels> ambient_light(const Samples& samples, std::size_t views,
                                    std::span<const Channels> albedo) {
  constexpr float kDark = 0.02F;
  struct Sums {
    Eigen::Array3d right = Eigen::Array3d::Zero();
    Eigen::Array3d weight = Eigen::Array3d::Constant(1e-9);
  };
  std::vector<Sums> sums(views);
  for (const std::vector<Sample>& of_run : samples) {
    for (const Sample& s : of_run) {
      for (int c = 0; c < 3; ++c) {
        if (s.light[c] > kDark) continue;
        const auto rho = static_cast<double>(albedo[s.vertex][c]);
        sums[s.view].right[c] += rho * static_cast<double>(s.image[c]);
        sums[s.view].weight[c] += rho * rho;
      }
    }
  }
  std::vector<Channels> ambient;
  for (const Sums& of_view : sums)
    ambient.emplace_back((of_view.right / of_view.weight).max(0.0).cast<float>());
  return ambient;
}

/// Neighbours of each vertex, each edge once per direction and face.
class Neighbors {
 public:
  explicit Neighbors(const TriangleMesh& mesh) : begin_(mesh.vertices.size() + 1, 0) {
    for (const auto& face : mesh.faces) {
      for (const int v : face) ++begin_[static_cast<std::size_t>(v) + 1];
    }
    for (std::size_t v = 1; v < begin_.size(); ++v) begin_[v] += begin_[v - 1];
    neighbors_.resize(begin_.back());
    std::vector<std::size_t> at(begin_.begin(), begin_.end() - 1);
    for (const auto& face : mesh.faces) {
      for (std::size_t k = 0; k < 3; ++k)
        neighbors_[at[static_cast<std::size_t>(face[k])]++] = face[(k + 1) % 3];
    }
  }
  /// Of clusters of vertices, `count` of them: each edge between two of them stays one.
  Neighbors(const Neighbors& fine, std::span<const int> cluster_of, std::size_t count)
      : begin_(count + 1, 0) {
    const auto for_each_edge = [&](auto visit) {
      for (std::size_t v = 0; v < cluster_of.size(); ++v) {
        for (const int k : fine.of(v)) {
          const int other = cluster_of[static_cast<std::size_t>(k)];
          if (other != cluster_of[v]) visit(static_cast<std::size_t>(cluster_of[v]), other);
        }
      }
    };
    for_each_edge([&](std::size_t cluster, int) { ++begin_[cluster + 1]; });
    for (std::size_t c = 1; c < begin_.size(); ++c) begin_[c] += begin_[c - 1];
    neighbors_.resize(begin_.back());
    std::vector<std::size_t> at(begin_.begin(), begin_.end() - 1);
    for_each_edge([&](std::size_t cluster, int other) { neighbors_[at[cluster]++] = other; });
  }
  [[nodiscard]] std::span<const int> of(std::size_t v) const {
    return std::span(neighbors_).subspan(begin_[v], begin_[v + 1] - begin_[v]);
  }

 private:
  std::vector<std::size_t> begin_;
  std::vector<int> neighbors_;
};

/// Three channels and a zero, so that processors take them at once.
using Lanes = Eigen::Array4f;

Lanes lanes(const Channels& c) { return {c[0], c[1], c[2], 0.F}; }

/// Minimises sum_v weight_v (rho_v - right_v / weight_v)^2 + smoothing sum_edges (rho_i - rho_j)^2
/// per channel by conjugate gradients with the diagonal as preconditioner, from `rho`. The mesh is
/// closed, so that each edge appears once in both directions and the matrix is symmetric.
void solve(const Neighbors& neighbors, std::span<const Evidence> sums, float smoothing, int rounds,
           std::vector<Channels>& rho) {
  const std::size_t n = sums.size();
  std::vector<Lanes> x(n), diagonal(n), residual(n), direction(n), product(n);
  parallel_chunks(n, [&](std::size_t v) {
    x[v] = lanes(rho[v]);
    diagonal[v] =
        lanes(sums[v].weight) + smoothing * static_cast<float>(neighbors.of(v).size()) + 1e-9F;
  });
  const auto times = [&](const std::vector<Lanes>& y, std::size_t v) {
    Lanes sum = diagonal[v] * y[v];
    for (const int k : neighbors.of(v)) sum -= smoothing * y[static_cast<std::size_t>(k)];
    return sum;
  };
  Eigen::Array4d energy = ordered_sum(n, [&](std::size_t v) -> Eigen::Array4d {
    residual[v] = lanes(sums[v].right) - times(x, v);
    direction[v] = residual[v] / diagonal[v];
    return (residual[v] * direction[v]).cast<double>();
  });
  // residual / diagonal is how far a vertex is off: the energy if all were off by the tolerance.
  const Eigen::Array4d enough = ordered_sum(n, [&](std::size_t v) -> Eigen::Array4d {
    const Lanes off = kTolerance * x[v];
    return (diagonal[v] * off * off).cast<double>();
  });
  for (int round = 0; round < rounds && (energy > enough).any(); ++round) {
    const Eigen::Array4d curvature = ordered_sum(n, [&](std::size_t v) -> Eigen::Array4d {
      product[v] = times(direction, v);
      return (direction[v] * product[v]).cast<double>();
    });
    const Lanes step = (energy / (curvature + 1e-30)).cast<float>();
    const Eigen::Array4d next = ordered_sum(n, [&](std::size_t v) -> Eigen::Array4d {
      x[v] += step * direction[v];
      residual[v] -= step * product[v];
      return (residual[v] * residual[v] / diagonal[v]).cast<double>();
    });
    const Lanes ratio = (next / (energy + 1e-30)).cast<float>();
    energy = next;
    parallel_chunks(
        n, [&](std::size_t v) { direction[v] = residual[v] / diagonal[v] + ratio * direction[v]; });
  }
  parallel_chunks(n, [&](std::size_t v) { rho[v] = x[v].head<3>(); });
}

/// The mean of all evidence at every vertex.
std::vector<Channels> even_albedo(std::span<const Evidence> sums) {
  Channels right = Channels::Zero();
  Channels weight = Channels::Constant(1e-9F);
  for (const Evidence& e : sums) {
    right += e.right;
    weight += e.weight;
  }
  return {sums.size(), right / weight};
}

/// Vertices within two edges of each other, every vertex in one cluster; how many clusters.
std::size_t find_clusters(const Neighbors& neighbors, std::vector<int>& cluster_of) {
  int count = 0;
  std::vector<std::size_t> near;
  for (std::size_t seed = 0; seed < cluster_of.size(); ++seed) {
    if (cluster_of[seed] >= 0) continue;
    near.assign(1, seed);
    cluster_of[seed] = count;
    std::size_t begin = 0;
    for (int edge = 0; edge < 2; ++edge) {
      for (const std::size_t end = near.size(); begin < end; ++begin) {
        for (const int k : neighbors.of(near[begin])) {
          const auto v = static_cast<std::size_t>(k);
          if (cluster_of[v] >= 0) continue;
          cluster_of[v] = count;
          near.push_back(v);
        }
      }
    }
    ++count;
  }
  return static_cast<std::size_t>(count);
}

/// What vertices and clusters of them lie beside each other.
struct Graph {
  Neighbors neighbors;
  std::vector<int> cluster_of;
  std::size_t clusters;
  Neighbors of_clusters;

  explicit Graph(const TriangleMesh& mesh)
      : neighbors(mesh),
        cluster_of(mesh.vertices.size(), -1),
        clusters(find_clusters(neighbors, cluster_of)),
        of_clusters(neighbors, cluster_of, clusters) {}
};

/// The solution with one albedo per cluster: where little is seen, colours have far to come, which
/// takes as many rounds as there are vertices on the way.
std::vector<Channels> coarse_albedo(const Graph& graph, std::span<const Evidence> sums,
                                    float smoothing, int rounds) {
  const std::vector<int>& cluster_of = graph.cluster_of;
  std::vector<Evidence> of_cluster(graph.clusters);
  for (std::size_t v = 0; v < sums.size(); ++v) {
    Evidence& sum = of_cluster[static_cast<std::size_t>(cluster_of[v])];
    sum.weight += sums[v].weight;
    sum.right += sums[v].right;
  }
  std::vector<Channels> albedo = even_albedo(of_cluster);
  solve(graph.of_clusters, of_cluster, smoothing, rounds, albedo);
  std::vector<Channels> rho(sums.size());
  for (std::size_t v = 0; v < rho.size(); ++v)
    rho[v] = albedo[static_cast<std::size_t>(cluster_of[v])];
  return rho;
}

}  // namespace

std::vector<std::array<float, 3>> vertex_colors(const Rig& rig, const RayScene& surface,
                                                std::span<const ColorView> views,
                                                const ColorOptions& options) {
  const TriangleMesh& mesh = surface.mesh();
  if (mesh.faces.empty() || views.empty()) return {};
  const bool has_plain =
      std::any_of(views.begin(), views.end(), [](const ColorView& view) { return view.is_plain; });
  std::optional<Graph> graph;
  Samples samples;
  parallel_for(2, [&](std::size_t part) {
    if (part == 0)
      graph.emplace(mesh);
    else
      samples = collect(rig, surface, views, options, has_plain);
  });
  std::vector<Channels> ambient(views.size(), Channels::Zero());
  std::vector<Evidence> sums = evidence(samples, mesh.vertices.size(), ambient);
  const auto smoothing = static_cast<float>(options.smoothing);
  std::vector<Channels> rho = coarse_albedo(*graph, sums, smoothing, options.rounds);
  solve(graph->neighbors, sums, smoothing, options.rounds / 2, rho);
  if (!has_plain) {
    ambient = ambient_light(samples, views.size(), rho);
    sums = evidence(samples, mesh.vertices.size(), ambient);
    solve(graph->neighbors, sums, smoothing, options.rounds, rho);
  }
  std::vector<float> brightest;
  for (std::size_t v = 0; v < rho.size(); ++v) {
    if (sums[v].weight.maxCoeff() > 0.05F) brightest.push_back(rho[v].maxCoeff());
  }
  if (brightest.empty()) return {};
  const auto high =
      brightest.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(brightest.size()));
  std::nth_element(brightest.begin(), high, brightest.end());
  const float scale = static_cast<float>(options.bright) / std::max(*high, 1e-6F);
  std::vector<std::array<float, 3>> colors(rho.size());
  for (std::size_t v = 0; v < rho.size(); ++v) {
    const Channels c = (scale * rho[v]).max(0.F).min(1.F);
    colors[v] = {c[0], c[1], c[2]};
  }
  return colors;
}

}  // namespace pencilscan
