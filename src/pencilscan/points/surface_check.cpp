#include "pencilscan/points/surface_check.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "pencilscan/core/check.h"
#include "pencilscan/core/chunks.h"
#include "pencilscan/io/srgb.h"

namespace pencilscan {
namespace {

enum class RayVerdict : char { kKept, kUnseen, kContradicted };

class SurfaceCheck {
 public:
  SurfaceCheck(const Rig& rig, const RayScene& surface) : rig_(rig), surface_(surface) {}

  using Hit = std::optional<RayScene::Hit>;

  /// Where a ray meets the surface; nothing where that was not measured.
  [[nodiscard]] Hit look(const Ray& ray) const {
    Hit hit = surface_.first_hit(ray);
    if (hit && !is_measured(surface_.mesh(), hit->face)) hit.reset();
    return hit;
  }

  /// `hit`: where the ray through the pixel meets the surface. Where that was not measured, what
  /// lies a pixel beside it counts.
  [[nodiscard]] bool contradicts(const Camera& camera, const Vec2& pixel, PatternRef pattern,
                                 int line, const Hit& hit) const {
    const RayVerdict verdict = verdict_of(hit, pattern, line);
    if (verdict != RayVerdict::kUnseen) return verdict == RayVerdict::kContradicted;
    bool is_contradicted = false;
    for (const Vec2& beside : {Vec2(1, 0), Vec2(-1, 0), Vec2(0, 1), Vec2(0, -1)}) {
      switch (verdict_of(look(camera.ray(pixel + beside)), pattern, line)) {
        case RayVerdict::kKept:
          return false;
        case RayVerdict::kContradicted:
          is_contradicted = true;
          break;
        case RayVerdict::kUnseen:
          break;
      }
    }
    return is_contradicted;
  }

  /// Standard deviation of the surface where a ray meets it, along the ray.
  [[nodiscard]] double sigma_along(const Ray& ray, const RayScene::Hit& hit) const {
    constexpr double kLeastCosine = 0.2;  // 78 degrees: bounds sigma at grazing rays
    const TriangleMesh& mesh = surface_.mesh();
    double across = 0;
    for (std::size_t k = 0; k < 3; ++k)
      across += hit.barycentric[static_cast<Eigen::Index>(k)] *
                static_cast<double>(mesh.sigma[static_cast<std::size_t>(mesh.faces[hit.face][k])]);
    return across / std::max(-face_normal(mesh, hit.face).dot(ray.direction), kLeastCosine);
  }

  /// True where another camera sees measured surface within the point's deviation, and that surface
  /// is known so much better that the point would add less than a tenth to what is known of it.
  [[nodiscard]] bool is_better_known(const MeasuredPoint& point) const {
    constexpr double kWithin = 3;  // deviations
    constexpr double kBetter = 3;  // times in sigma: a ninth of the weight
    const auto sigma = static_cast<double>(point.sigma);
    for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
      const Camera& camera = rig_.cameras[c];
      const auto pixel = camera.project(position_of(point));
      if (c == static_cast<std::size_t>(point.camera) || !pixel || !camera.contains(*pixel))
        continue;
      const Vec3 center = camera.center();
      const Vec3 way = position_of(point) - center;
      const Ray ray{center, way.normalized()};
      const auto hit = look(ray);
      if (hit && std::abs(hit->distance - way.norm()) < kWithin * sigma &&
          kBetter * sigma_along(ray, *hit) < sigma)
        return true;
    }
    return false;
  }

 private:
  [[nodiscard]] RayVerdict verdict_of(const Hit& hit, PatternRef ref, int line) const {
    constexpr double kSameLine = 0.5;  // lines: the next one is no nearer
    if (!hit) return RayVerdict::kUnseen;
    const Projector& projector = rig_.projector(ref.projector);
    const LinePattern& pattern = rig_.pattern(ref);
    const auto place = projector.project(hit->point);
    if (!place) return RayVerdict::kContradicted;
    const double there = pattern.coordinate((*place)[static_cast<Eigen::Index>(pattern.axis)]);
    return std::abs(there - line) <= kSameLine && may_be_lit(*hit, projector)
               ? RayVerdict::kKept
               : RayVerdict::kContradicted;
  }

  /// False where the surface may turn away from the projector, or measured surface stands in its
  /// light.
  [[nodiscard]] bool may_be_lit(const RayScene::Hit& hit, const Projector& projector) const {
    // Cosine of the incidence; two deviations of the mesh's own slope, which near the edge of the
    // light errs by .03 to .07 (docs/solutions.md).
    constexpr double kSurelyFacing = 0.1;
    constexpr double kOff = 3;  // footprints that roughness and errors of the mesh take
    const Vec3 to_light = (projector.center() - hit.point).normalized();
    const Vec3 normal = face_normal(surface_.mesh(), hit.face);
    if (normal.dot(to_light) < kSurelyFacing) return false;
    return !look(Ray{hit.point + kOff * (normal + to_light), to_light});
  }

  const Rig& rig_;
  const RayScene& surface_;
};

/// Gives a point the normal of the surface where it lies, between those of the face's vertices, and
/// its colour.
void take_looks(const TriangleMesh& mesh, std::span<const Vec3> normals,
                std::span<const std::array<float, 3>> colors, const RayScene::Hit& hit,
                MeasuredPoint& point) {
  Vec3 normal = Vec3::Zero();
  Vec3 color = Vec3::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    const auto v = static_cast<std::size_t>(mesh.faces[hit.face][k]);
    const double weight = hit.barycentric[static_cast<Eigen::Index>(k)];
    normal += weight * normals[v];
    if (!colors.empty())
      for (std::size_t i = 0; i < 3; ++i)
        color[static_cast<Eigen::Index>(i)] += weight * static_cast<double>(colors[v][i]);
  }
  if (normal.isZero()) return;
  normal.normalize();
  point.nx = static_cast<float>(normal.x());
  point.ny = static_cast<float>(normal.y());
  point.nz = static_cast<float>(normal.z());
  point.red = to_srgb_byte(color.x());
  point.green = to_srgb_byte(color.y());
  point.blue = to_srgb_byte(color.z());
}

}  // namespace

std::size_t drop_contradicted(const Rig& rig, const RayScene& surface,
                              std::span<const GridGraph> graphs, Labeling& labeling) {
  constexpr int kStride = 3;    // points that are judged as one
  constexpr int kShortest = 4;  // points of a run that are worth keeping
  const SurfaceCheck check(rig, surface);
  std::size_t dropped = 0;
  for (const GridGraph& graph : graphs) {
    const auto c = static_cast<std::size_t>(graph.camera);
    const Camera& camera = rig.cameras[c];
    const std::vector<LabeledRun> runs = std::move(labeling.runs[c]);
    std::vector<std::vector<LabeledRun>> kept(runs.size());
    parallel_for(runs.size(), [&](std::size_t k) {
      const LabeledRun& run = runs[k];
      const auto& points = graph.curves[static_cast<std::size_t>(run.curve)].points;
      int begin = run.begin;
      const auto keep = [&](int end) {
        if (end - begin >= std::min(kShortest, run.end - run.begin))
          kept[k].push_back({run.curve, begin, end, run.label});
      };
      for (int i = run.begin; i < run.end; i += kStride) {
        const int end = std::min(i + kStride, run.end);
        const Vec2 pixel = points[static_cast<std::size_t>((i + end) / 2)].position.cast<double>();
        if (!check.contradicts(camera, pixel, run.label.pattern, run.label.line,
                               check.look(camera.ray(pixel))))
          continue;
        keep(i);
        begin = end;
      }
      keep(run.end);
    });
    labeling.runs[c].clear();
    for (std::size_t k = 0; k < runs.size(); ++k) {
      int at = runs[k].begin;
      const auto undecided_until = [&](int end) {
        if (end <= at) return;
        dropped += static_cast<std::size_t>(end - at);
        add_undecided({runs[k].curve, at, end, UndecidedReason::kContradicted},
                      labeling.undecided[c]);
      };
      for (const LabeledRun& run : kept[k]) {
        undecided_until(run.begin);
        at = run.end;
        labeling.runs[c].push_back(run);
      }
      undecided_until(runs[k].end);
    }
  }
  return dropped;
}

SettledPoints settle_on_surface(const Rig& rig, const RayScene& surface,
                                std::span<const MeasuredPoint> points, float min_alone_confidence,
                                std::span<const std::array<float, 3>> colors) {
  // Deviations of the difference within which point and surface may be one place.
  constexpr double kFarthest = 4;
  // Beyond, one of both is wrong, and the surface rests on the light of all pixels and cameras
  // around; as many as settle_points() allows (SettleOptions::max_deviations). Such points made the
  // form error of a ball (docs/experiments.md, "Acceptance").
  constexpr double kLeftOut = 6;
  const TriangleMesh& mesh = surface.mesh();
  PENCILSCAN_CHECK(mesh.sigma.size() == mesh.vertices.size() &&
                   mesh.confidence.size() == mesh.vertices.size() &&
                   (colors.empty() || colors.size() == mesh.vertices.size()));
  const std::vector<Vec3> normals = vertex_normals(mesh);
  const SurfaceCheck check(rig, surface);
  SettledPoints settled;
  settled.points.assign(points.begin(), points.end());
  settled.evidence.resize(points.size());
  std::vector<char> keep(points.size(), 1);
  parallel_chunks(points.size(), [&](std::size_t i) {
    MeasuredPoint& p = settled.points[i];
    const Camera& camera = rig.cameras[p.camera];
    const Vec2 pixel(static_cast<double>(p.u), static_cast<double>(p.v));
    const Ray ray = camera.ray(pixel);
    const auto hit = check.look(ray);
    if (check.contradicts(camera, pixel, {p.projector, p.pattern}, p.line, hit)) keep[i] = 0;
    PointEvidence& evidence = settled.evidence[i];
    evidence.own = points[i].sigma;
    evidence.confidence = points[i].confidence;
    p.sigma = static_cast<float>(point_sigma(evidence));
    const auto stay = [&] {
      if (p.confidence < min_alone_confidence || check.is_better_known(p)) keep[i] = 0;
    };
    if (!hit) return stay();
    const double of_surface = check.sigma_along(ray, *hit);
    const double of_point = static_cast<double>(points[i].sigma);
    const double difference = hit->distance - (position_of(p) - ray.origin).dot(ray.direction);
    const double deviations = std::abs(difference) / std::hypot(of_surface, of_point);
    if (deviations > kLeftOut) keep[i] = 0;
    evidence.surface = static_cast<float>(of_surface);
    evidence.difference = static_cast<float>(std::abs(difference));
    evidence.settled = deviations <= kFarthest;
    p.sigma = static_cast<float>(point_sigma(evidence));
    if (!evidence.settled) return stay();
    p.x = static_cast<float>(hit->point.x());
    p.y = static_cast<float>(hit->point.y());
    p.z = static_cast<float>(hit->point.z());
    take_looks(mesh, normals, colors, *hit, p);
  });
  std::size_t count = 0;
  for (std::size_t i = 0; i < keep.size(); ++i) {
    if (keep[i] == 0) continue;
    settled.points[count] = settled.points[i];
    settled.evidence[count++] = settled.evidence[i];
  }
  settled.contradicted = keep.size() - count;
  settled.points.resize(count);
  settled.evidence.resize(count);
  return settled;
}

}  // namespace pencilscan
