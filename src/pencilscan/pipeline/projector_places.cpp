#include "pencilscan/pipeline/projector_places.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/geometry/light_sheet.h"
#include "pencilscan/joint/joint.h"
#include "pencilscan/points/pixel_lattice.h"
#include "pencilscan/refinement/crossing_tracks.h"

namespace pencilscan {
namespace {

bool is_of(const PatternRef& ref, std::size_t p) {
  return static_cast<std::size_t>(ref.projector) == p;
}

/// The families without the patterns of a projector, whose curves get no other names for it.
std::vector<ColorFamily> families_without(std::vector<ColorFamily> families, std::size_t p) {
  for (ColorFamily& family : families)
    std::erase_if(family.patterns, [p](const PatternRef& ref) { return is_of(ref, p); });
  return families;
}

/// Labels without those of a projector.
Labeling labels_without_projector(Labeling labeling, std::size_t p) {
  for (std::vector<LabeledRun>& runs : labeling.runs)
    std::erase_if(runs, [p](const LabeledRun& run) { return is_of(run.label.pattern, p); });
  return labeling;
}

bool has_colors_of(const ColorFamily& family, std::size_t p) {
  return std::any_of(family.patterns.begin(), family.patterns.end(),
                     [p](const PatternRef& ref) { return is_of(ref, p); });
}

/// Family and colour of a line where a camera sees it.
PlaceOfLine place_of(const Vec3& position, const Curve& curve, int point, std::size_t colors) {
  const float* code = curve.code.data() + static_cast<std::size_t>(point) * colors;
  return {position, static_cast<std::size_t>(curve.family), 0,
          bit_of_color(std::max_element(code, code + colors) - code)};
}

bool is_in_volume(const Vec3& x, const Sphere& volume) {
  constexpr double kMargin = 1.1;  // as TriangulationOptions
  return (x - volume.center).norm() <= kMargin * volume.radius;
}

/// Where lines of others, by their names, cross curves without a name in the colours of `p`.
/// `labeling`: without names of `p`.
void add_crossings(const Rig& rig, const FrameCurves& frame, const Labeling& labeling,
                   std::size_t p, std::vector<MeasuredPlace>& places) {
  const TrackOptions options;
  const Sphere volume = working_volume(rig);
  for (const GridGraph& graph : frame.graphs) {
    const Camera& camera = rig.camera(graph.camera);
    const auto& runs = labeling.runs[static_cast<std::size_t>(graph.camera)];
    for (const Crossing& x : graph.crossings) {
      for (const bool is_a : {true, false}) {
        const int own = is_a ? x.curve_a : x.curve_b;
        const float at = is_a ? x.at_a : x.at_b;
        const Curve& curve = graph.curves[static_cast<std::size_t>(own)];
        const ColorFamily& family = frame.families[static_cast<std::size_t>(curve.family)];
        if (!has_colors_of(family, p) || label_at(runs, own, at) != nullptr) continue;
        const CurveLabel* named =
            label_at(runs, is_a ? x.curve_b : x.curve_a, is_a ? x.at_b : x.at_a);
        if (named == nullptr) continue;
        const LinePattern& lines = rig.pattern(named->pattern);
        const Projector& projector = rig.projector(named->pattern.projector);
        const auto place_at = [&](const Vec2& pixel) -> std::optional<Vec3> {
          const RayInProjector ray(camera, projector, pixel);
          const auto depth = ray.depth(lines.position_px(named->line), lines.axis);
          if (!depth || !(options.max_sigma_mm * std::abs(ray.slope(*depth, lines.axis)) > 1))
            return std::nullopt;
          return camera.point_at_depth(pixel, *depth);
        };
        const Vec2 pixel = x.position.cast<double>();
        const auto place = place_at(pixel);
        const auto right = place_at(pixel + Vec2(1, 0));
        const auto below = place_at(pixel + Vec2(0, 1));
        if (!place || !right || !below || !is_in_volume(*place, volume)) continue;
        Eigen::Matrix<double, 3, 2> slope;
        slope << *right - *place, *below - *place;
        places.push_back({place_of(*place, curve, static_cast<int>(at), family.colors.size()),
                          slope * crossing_whitening(graph, x, options).inverse()});
      }
    }
  }
}

double sigma_of(const CurvePoint& point, const TrackOptions& options) {
  return std::hypot(options.position_factor * static_cast<double>(point.sigma_px),
                    options.min_sigma_px);
}

/// A point of a curve that has a name.
struct NamedPoint {
  std::size_t camera = 0;
  const Curve* curve = nullptr;
  int point = 0;
  CurveLabel label;
};

/// The runs of a camera with names of one projector, and their points as rays.
class NamedRays {
 public:
  NamedRays(const Camera& camera, const GridGraph& graph, std::span<const LabeledRun> runs,
            std::size_t p)
      : camera_(&camera) {
    for (const LabeledRun& run : runs) {
      if (!is_of(run.label.pattern, p)) continue;
      Run own{run.label, &graph.curves[static_cast<std::size_t>(run.curve)], run.begin, {}};
      for (int i = run.begin; i < run.end; ++i) {
        const auto& point = own.curve->points[static_cast<std::size_t>(i)];
        own.rays.push_back(
            camera.normalized_from_pixel(point.position.cast<double>()).homogeneous());
      }
      runs_.push_back(std::move(own));
    }
  }

  /// Where the ray of another camera's pixel meets a run of the same name, of several the one
  /// nearest to `expected`, and how sure that is; nothing: nowhere, or at too flat an angle.
  [[nodiscard]] std::optional<MeasuredPlace> met(const Camera& other, const NamedPoint& seen,
                                                 double expected, std::size_t colors) const {
    const CurvePoint& from = seen.curve->points[static_cast<std::size_t>(seen.point)];
    const Vec2 pixel = from.position.cast<double>();
    const RigidTransform& pose = camera_->device_from_world;
    const Vec3 start = pose * other.center();
    const Vec3 along = pose * other.point_at_depth(pixel, 1) - start;
    const Vec3 across = start.cross(along);  // normal of the plane of the ray and this centre
    std::optional<double> depth;
    const CurvePoint* beside = nullptr;
    for (const Run& run : runs_) {
      if (!(run.label.pattern == seen.label.pattern) || run.label.line != seen.label.line) continue;
      for (std::size_t i = 0; i + 1 < run.rays.size(); ++i) {
        const double a = across.dot(run.rays[i]);
        const double b = across.dot(run.rays[i + 1]);
        if (a * b > 0 || a == b) continue;
        const Vec3 ray = run.rays[i] + a / (a - b) * (run.rays[i + 1] - run.rays[i]);
        // start + depth along is parallel to the ray.
        const Vec3 moment = along.cross(ray);
        const double here = -start.cross(ray).dot(moment) / moment.squaredNorm();
        if (depth && std::abs(here - expected) >= std::abs(*depth - expected)) continue;
        depth = here;
        beside = &run.curve->points[static_cast<std::size_t>(run.begin) + i];
      }
    }
    if (!depth || !(*depth > 0)) return std::nullopt;
    const Vec3 x = other.point_at_depth(pixel, *depth);
    const Vec3 x_in_camera = pose * x;
    if (!(x_in_camera.z() > 0)) return std::nullopt;
    // A shift of either curve along its normal moves the place along the ray.
    const TrackOptions options;
    const Vec3 farther = other.point_at_depth(pixel, *depth + 1) - x;
    const Vec3 beside_it = other.point_at_depth(pixel + from.normal.cast<double>(), *depth) - x;
    const Eigen::Matrix<double, 1, 3> slope = beside->normal.cast<double>().transpose() *
                                              projection_jacobian(*camera_, x_in_camera) *
                                              pose.rotation;
    const double per_depth = slope.dot(farther);
    if (!(options.max_sigma_mm * std::abs(per_depth) > farther.norm())) return std::nullopt;
    MeasuredPlace place{place_of(x, *seen.curve, seen.point, colors), {}};
    place.spread << sigma_of(from, options) *
                        (beside_it - slope.dot(beside_it) / per_depth * farther),
        sigma_of(*beside, options) / per_depth * farther;
    return place;
  }

 private:
  struct Run {
    CurveLabel label;
    const Curve* curve = nullptr;
    int begin = 0;
    std::vector<Vec3> rays;  ///< (x, y, 1) in the camera's frame
  };
  const Camera* camera_;
  std::vector<Run> runs_;
};

/// Where two cameras see a line that has the same name of `p` in both.
void add_seen_twice(const Rig& rig, const FrameCurves& frame, const Labeling& labeling,
                    std::size_t p, std::vector<MeasuredPlace>& places) {
  std::vector<NamedRays> rays;
  std::vector<NamedPoint> points;
  for (const GridGraph& graph : frame.graphs) {
    const auto c = static_cast<std::size_t>(graph.camera);
    rays.emplace_back(rig.cameras[c], graph, labeling.runs[c], p);
    for (const LabeledRun& run : labeling.runs[c]) {
      if (!is_of(run.label.pattern, p)) continue;
      const Curve& curve = graph.curves[static_cast<std::size_t>(run.curve)];
      for (int i = run.begin; i < run.end; ++i) {
        const auto& at = curve.points[static_cast<std::size_t>(i)].position;
        // Neighbours on a curve err alike.
        if (is_on_lattice(at.x(), at.y(), 1)) points.push_back({c, &curve, i, run.label});
      }
    }
  }
  points = evenly_picked(points, kMostPlaces);
  const Sphere volume = working_volume(rig);
  std::vector<std::vector<MeasuredPlace>> of_point(points.size());
  parallel_for(points.size(), [&](std::size_t k) {
    const NamedPoint& seen = points[k];
    const Camera& camera = rig.cameras[seen.camera];
    const LinePattern& lines = rig.pattern(seen.label.pattern);
    const Vec2 pixel =
        seen.curve->points[static_cast<std::size_t>(seen.point)].position.cast<double>();
    const auto expected = RayInProjector(camera, rig.projectors[p], pixel)
                              .depth(lines.position_px(seen.label.line), lines.axis);
    if (!expected) return;
    const std::size_t colors =
        frame.families[static_cast<std::size_t>(seen.curve->family)].colors.size();
    for (std::size_t other = 0; other < rays.size(); ++other) {
      if (other == seen.camera) continue;
      const auto place = rays[other].met(camera, seen, *expected, colors);
      if (place && is_in_volume(place->place.position, volume)) of_point[k].push_back(*place);
    }
  });
  for (const auto& some : of_point) places.insert(places.end(), some.begin(), some.end());
}

}  // namespace

std::vector<MeasuredPlace> places_of_projector(const Rig& rig, std::span<const FrameCurves> frames,
                                               std::span<const Labeling> labelings, std::size_t p) {
  constexpr std::size_t kMostFrames = 4;  // one has enough places
  Rig others = rig;
  others.projectors[p].patterns.clear();
  std::vector<MeasuredPlace> places;
  const std::size_t count = std::min(kMostFrames, frames.size());
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t f = k * frames.size() / count;
    if (labelings.empty()) {
      const std::vector<ColorFamily> families = families_without(frames[f].families, p);
      add_crossings(rig, frames[f], solve_joint(others, families, frames[f].graphs, JointOptions{}),
                    p, places);
    } else {
      add_crossings(rig, frames[f], labels_without_projector(labelings[f], p), p, places);
      add_seen_twice(rig, frames[f], labelings[f], p, places);
    }
  }
  return places;
}

}  // namespace pencilscan
