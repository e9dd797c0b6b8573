#include "pencilscan/evaluation/surface_figures.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pencilscan/core/chunks.h"
#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

double cos_deg(double degrees) { return std::cos(degrees * std::numbers::pi / 180); }

Coverage cover(const TruthScene& truth, const std::vector<PatternChannel>& channels,
               const DrawnPoint& sample, const CoverageOptions& options) {
  const Rig& rig = truth.rig();
  const double limit = cos_deg(options.max_incidence_deg);
  std::vector<std::optional<Lighting>> lights(rig.projectors.size());
  Coverage coverage;
  for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
    lights[p] = truth.lighting(static_cast<int>(p), sample.point, sample.normal);
    coverage.lit_by += lights[p] ? 1 : 0;
  }
  for (std::size_t c = 0; c < rig.cameras.size() && !coverage.measurable; ++c) {
    const Camera& camera = rig.cameras[c];
    if (camera.sees_texture_only) continue;
    const Vec3 way = sample.point - camera.center();
    const double cos_camera = -sample.normal.dot(way.normalized());
    const auto pixel = camera.project(sample.point);
    if (!(cos_camera > 0) || !pixel || !camera.contains(*pixel) ||
        !truth.scene().visible(camera.center(), sample.point, truth.margin_mm())) {
      continue;
    }
    coverage.seen = true;
    if (!(cos_camera > limit)) continue;
    const SurfaceHit hit{sample.point, sample.normal, way.norm(), cos_camera};
    for (const PatternChannel& channel : channels) {
      const auto& light = lights[static_cast<std::size_t>(channel.projector)];
      if (!light || !(light->cos_projector > limit)) continue;
      if (!truth.line_coordinate(channel, light->pixel)) continue;
      const Vec2 gradient = truth.line_gradient(static_cast<int>(c), channel, *pixel, hit);
      if (!(gradient.norm() * options.min_spacing_px <= 1)) continue;
      coverage.measurable = true;
      break;
    }
  }
  return coverage;
}

DrawnPoint turned_round(DrawnPoint sample) {
  sample.normal = -sample.normal;
  return sample;
}

/// Of both sides, where there are two.
Coverage cover_sides(const TruthScene& truth, const std::vector<PatternChannel>& channels,
                     const DrawnPoint& sample, const CoverageOptions& options) {
  const Coverage front = cover(truth, channels, sample, options);
  if (!truth.is_two_sided(sample.face)) return front;
  Coverage both = cover(truth, channels, turned_round(sample), options);
  if (!both.seen) return front;
  both.back = true;
  both.front = front.seen;
  if (front.seen) {
    both.measurable = both.measurable || front.measurable;
    both.lit_by = std::max(both.lit_by, front.lit_by);
  }
  return both;
}

/// Distance to the nearest facet within reach, else infinity, and the cosine between the normals.
struct Nearest {
  double distance = std::numeric_limits<double>::infinity();
  double cos_normals = 0;
};

std::vector<Nearest> nearest_facets(const RayScene& scene, const std::vector<DrawnPoint>& samples,
                                    double reach) {
  std::vector<Nearest> nearest(samples.size());
  parallel_chunks(samples.size(), [&](std::size_t i) {
    const auto closest = scene.closest_point(samples[i].point, reach);
    if (!closest) return;
    const Vec3 normal = face_normal(scene.mesh(), closest->face);
    nearest[i] = {closest->distance, normal.dot(samples[i].normal)};
  });
  return nearest;
}

/// Whether the nearest facet looks where a side of the sample looks that counts.
bool normal_agrees(const Nearest& nearest, const Coverage& coverage, double limit) {
  return (coverage.front && nearest.cos_normals >= limit) ||
         (coverage.back && -nearest.cos_normals >= limit);
}

SigmaFigures vertex_sigma_figures(const RayScene& truth, const TriangleMesh& mesh) {
  std::vector<Vec3> vertices;
  std::vector<double> sigmas;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (!(mesh.sigma[v] > 0) || (!mesh.confidence.empty() && !(mesh.confidence[v] > 0))) continue;
    vertices.push_back(mesh.vertices[v]);
    sigmas.push_back(static_cast<double>(mesh.sigma[v]));
  }
  return sigma_figures(sigmas, distances_to(truth, vertices));
}

}  // namespace

std::vector<DrawnPoint> sample_surface(const TriangleMesh& mesh, std::size_t count,
                                       std::uint64_t seed) {
  std::vector<double> cumulative;
  cumulative.reserve(mesh.faces.size());
  double area = 0;
  const auto corner = [&](std::size_t f, std::size_t k) -> const Vec3& {
    return mesh.vertices[static_cast<std::size_t>(mesh.faces[f][k])];
  };
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    area += 0.5 * (corner(f, 1) - corner(f, 0)).cross(corner(f, 2) - corner(f, 0)).norm();
    cumulative.push_back(area);
  }
  if (!(area > 0)) return {};
  std::vector<DrawnPoint> samples;
  samples.reserve(count);
  Random random(seed);
  for (std::size_t i = 0; i < count; ++i) {
    const double at =
        area * (static_cast<double>(i) + random.uniform()) / static_cast<double>(count);
    const auto it = std::upper_bound(cumulative.begin(), cumulative.end(), at);
    const auto f =
        std::min(static_cast<std::size_t>(it - cumulative.begin()), mesh.faces.size() - 1);
    // Uniform in a triangle. Osada et al., "Shape distributions" (2002), equation (1).
    const double root = std::sqrt(random.uniform());
    const double r = random.uniform();
    samples.push_back(
        {(1 - root) * corner(f, 0) + root * (1 - r) * corner(f, 1) + root * r * corner(f, 2),
         face_normal(mesh, f), f});
  }
  return samples;
}

std::vector<Coverage> surface_coverage(const TruthScene& truth,
                                       const std::vector<DrawnPoint>& samples,
                                       const CoverageOptions& options) {
  const auto channels = pattern_channels(truth.rig());
  std::vector<Coverage> coverage(samples.size());
  parallel_chunks(samples.size(), [&](std::size_t i) {
    coverage[i] = cover_sides(truth, channels, samples[i], options);
  });
  return coverage;
}

std::vector<double> distances_to(const RayScene& scene, const std::vector<Vec3>& points) {
  std::vector<double> distances(points.size(), std::numeric_limits<double>::infinity());
  parallel_chunks(points.size(), [&](std::size_t i) {
    if (const auto closest = scene.closest_point(points[i])) distances[i] = closest->distance;
  });
  return distances;
}

SurfaceFigures surface_figures(const TruthScene& truth, const TriangleMesh& measured,
                               const CompletenessOptions& options, double mm_per_unit) {
  SurfaceFigures figures;
  // Precision and distance: from the measured surface to the truth.
  std::vector<Vec3> measured_points;
  for (const auto& s : sample_surface(measured, options.sample_count, options.seed)) {
    measured_points.push_back(s.point);
  }
  auto distances = distances_to(truth.scene(), measured_points);
  for (double& d : distances) d *= mm_per_unit;
  figures.distance = distance_figures(distances);
  if (!measured.sigma.empty()) figures.sigma = vertex_sigma_figures(truth.scene(), measured);

  // Completeness: from the truth to the measured surface.
  const auto samples = sample_surface(truth.scene().mesh(), options.sample_count, options.seed);
  const auto coverage = surface_coverage(truth, samples);
  const RayScene measured_scene(measured);
  double reach = 0;
  for (const double threshold : options.thresholds_mm)
    reach = std::max(reach, threshold / mm_per_unit);
  const auto nearest = nearest_facets(measured_scene, samples, reach);
  const double limit = cos_deg(options.max_normal_deg);

  Share measurable;
  Share one;
  Share two;
  for (const Coverage& c : coverage) {
    measurable.add(c.measurable);
    one.add(c.seen && c.lit_by >= 1);
    two.add(c.seen && c.lit_by >= 2);
  }
  figures.measurable_share = measurable.value();
  figures.lit_by_one_share = one.value();
  figures.lit_by_two_share = two.value();
  figures.measurable_mm2 =
      measurable.value() * surface_area(truth.scene().mesh()) * mm_per_unit * mm_per_unit;

  for (const double threshold : options.thresholds_mm) {
    Share found;
    Share found_one;
    Share found_two;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const bool near = nearest[i].distance * mm_per_unit < threshold &&
                        normal_agrees(nearest[i], coverage[i], limit);
      if (coverage[i].measurable) found.add(near);
      if (coverage[i].seen && coverage[i].lit_by >= 1) found_one.add(near);
      if (coverage[i].seen && coverage[i].lit_by >= 2) found_two.add(near);
    }
    Share precise;
    for (const double d : distances) precise.add(d < threshold);
    const double recall = found.value();
    const double precision = precise.count > 0 ? precise.value() : 0;
    const double sum = recall + precision;  // not a number where nothing is measurable
    figures.completeness.push_back({threshold, recall, found_one.value(), found_two.value(),
                                    precision, sum == 0 ? 0 : 2 * recall * precision / sum});
  }
  return figures;
}

}  // namespace pencilscan
