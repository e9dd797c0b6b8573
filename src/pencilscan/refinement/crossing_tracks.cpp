#include "pencilscan/refinement/crossing_tracks.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/refinement/like_lines.h"

namespace pencilscan {
namespace {

struct LineKey {
  PatternRef pattern;
  int line = 0;
  [[nodiscard]] auto order() const { return std::tie(pattern.projector, pattern.pattern, line); }
  friend bool operator<(const LineKey& a, const LineKey& b) { return a.order() < b.order(); }
};

struct Sighting {
  LineKey a;  ///< a < b
  LineKey b;
  CrossingSighting view;
  Vec3 point = Vec3::Zero();
};

LineOfProjector line_of(const Rig& rig, const LineKey& key) {
  const LinePattern& pattern = rig.projectors[static_cast<std::size_t>(key.pattern.projector)]
                                   .patterns[static_cast<std::size_t>(key.pattern.pattern)];
  return {key.pattern.projector, pattern.axis, pattern.position_px(key.line)};
}

/// Where the ray of a pixel meets the light sheet of a line: camera depth, mm, and its change for
/// one projector pixel.
struct SheetDepth {
  double depth = 0;
  double per_px = 0;
};

std::optional<SheetDepth> sheet_depth(const Rig& rig, int camera, const LineOfProjector& line,
                                      const Vec2& pixel) {
  const RayInProjector ray(rig.cameras[static_cast<std::size_t>(camera)],
                           rig.projectors[static_cast<std::size_t>(line.projector)], pixel);
  const auto depth = ray.depth(line.coordinate_px, line.axis);
  if (!depth) return std::nullopt;
  const double slope = std::abs(ray.slope(*depth, line.axis));
  if (!(slope > 0)) return std::nullopt;
  return SheetDepth{*depth, 1 / slope};
}

/// Labelled crossings of one camera with their points.
std::vector<Sighting> sightings_of(const Rig& rig, const LikeLines& like, const GridGraph& graph,
                                   std::span<const LabeledRun> runs, const Sphere& volume,
                                   const TrackOptions& options) {
  const Camera& camera = rig.cameras[static_cast<std::size_t>(graph.camera)];
  std::vector<Sighting> sightings;
  for (const Crossing& x : graph.crossings) {
    const CurveLabel* label_a = label_at(runs, x.curve_a, x.at_a);
    const CurveLabel* label_b = label_at(runs, x.curve_b, x.at_b);
    if (label_a == nullptr || label_b == nullptr || label_a->pattern == label_b->pattern) continue;
    Sighting sighting{{label_a->pattern, label_a->line}, {label_b->pattern, label_b->line}, {}, {}};
    if (sighting.b < sighting.a) std::swap(sighting.a, sighting.b);
    const Vec2 pixel = x.position.cast<double>();
    sighting.view = {graph.camera, pixel, crossing_whitening(graph, x, options)};
    const auto a = sheet_depth(rig, graph.camera, line_of(rig, sighting.a), pixel);
    const auto b = sheet_depth(rig, graph.camera, line_of(rig, sighting.b), pixel);
    if (!a || !b) continue;
    const double information = 1 / (a->per_px * a->per_px) + 1 / (b->per_px * b->per_px);
    if (1 / std::sqrt(information) > options.max_sigma_mm) continue;
    const double depth =
        (a->depth / (a->per_px * a->per_px) + b->depth / (b->per_px * b->per_px)) / information;
    sighting.point = camera.point_at_depth(pixel, depth);
    if ((sighting.point - volume.center).norm() > 1.1 * volume.radius) continue;
    const auto named = [&](const CurveLabel& label, int curve, float at) {
      const auto& points = graph.curves[static_cast<std::size_t>(curve)].points;
      return LikeLines::NamedCurve{label.pattern,
                                   rig.pattern(label.pattern).position_px(label.line),
                                   points[static_cast<std::size_t>(at)].normal.cast<double>()};
    };
    const auto of_a = named(*label_a, x.curve_a, x.at_a);
    const auto of_b = named(*label_b, x.curve_b, x.at_b);
    if (like.may_touch(camera, pixel, of_a, of_b) || like.may_touch(camera, pixel, of_b, of_a))
      continue;
    sightings.push_back(std::move(sighting));
  }
  return sightings;
}

/// Joins what belongs to one point among the sightings [first, last) of the same two lines.
void join(const Rig& rig, std::span<const Sighting> sightings, const TrackOptions& options,
          std::vector<CrossingTrack>& tracks) {
  const std::size_t first = tracks.size();
  for (const Sighting& s : sightings) {
    const Camera& camera = rig.cameras[static_cast<std::size_t>(s.view.camera)];
    CrossingTrack* nearest = nullptr;
    double best = options.merge_px;
    for (std::size_t t = first; t < tracks.size(); ++t) {
      if (tracks[t].sightings.back().camera == s.view.camera) continue;  // they come by camera
      const auto pixel = camera.project(tracks[t].point);
      const double distance = pixel ? (*pixel - s.view.pixel).norm() : best;
      if (distance >= best) continue;
      best = distance;
      nearest = &tracks[t];
    }
    if (nearest == nullptr) {
      tracks.push_back({{line_of(rig, s.a), line_of(rig, s.b)}, {s.view}, s.point});
      continue;
    }
    const auto n = static_cast<double>(nearest->sightings.size());
    nearest->point = (n * nearest->point + s.point) / (n + 1);
    nearest->sightings.push_back(s.view);
  }
}

/// How far the planes of one crossing miss each other in one camera.
struct Miss {
  double px = 0;              ///< signed
  Vec2 slope = Vec2::Zero();  ///< of px, for a shift of the crossing by one camera px
  double noise_px = 0;
  int camera = 0;
  std::array<int, 2> projectors{};
};

std::vector<Miss> misses_of(const Rig& rig, std::span<const CrossingTrack> tracks) {
  std::vector<std::vector<Miss>> per_track(tracks.size());
  parallel_for(tracks.size(), [&](std::size_t t) {
    const auto& lines = tracks[t].lines;
    for (const CrossingSighting& s : tracks[t].sightings) {
      const auto miss_at = [&](const Vec2& pixel) -> std::optional<double> {
        const auto a = sheet_depth(rig, s.camera, lines[0], pixel);
        const auto b = sheet_depth(rig, s.camera, lines[1], pixel);
        if (!a || !b) return std::nullopt;
        const auto scale = [](const SheetDepth& d) { return d.per_px / (d.depth * d.depth); };
        return (1 / a->depth - 1 / b->depth) / std::hypot(scale(*a), scale(*b));
      };
      const auto miss = miss_at(s.pixel);
      const auto right = miss_at(s.pixel + Vec2(1, 0));
      const auto below = miss_at(s.pixel + Vec2(0, 1));
      if (!miss || !right || !below) continue;
      const Eigen::RowVector2d slope(*right - *miss, *below - *miss);
      per_track[t].push_back({*miss,
                              slope.transpose(),
                              (slope * s.whitening.inverse()).norm(),
                              s.camera,
                              {lines[0].projector, lines[1].projector}});
    }
  });
  std::vector<Miss> misses;
  for (const auto& part : per_track) misses.insert(misses.end(), part.begin(), part.end());
  return misses;
}

template <class Choice>
CrossingDisagreement median_of(const std::vector<Miss>& misses, const Choice& counts) {
  std::vector<double> px;
  std::vector<double> noises;
  for (const Miss& m : misses) {
    if (!counts(m)) continue;
    px.push_back(std::abs(m.px));
    noises.push_back(m.noise_px);
  }
  const std::size_t crossings = px.size();
  return {crossings,
          upper_median(std::move(px)),
          upper_median(std::move(noises)) / kDeviationPerMedian,
          {}};
}

/// The shift of a camera's picture with which its crossings miss each other least. Cauchy's loss,
/// as in refine_rig.h: some names are wrong.
std::optional<Vec2> shift_of(const std::vector<Miss>& misses, int camera, double median_px) {
  constexpr int kRounds = 10;
  constexpr double kLeastDeterminant = 1e-3;  // of a system whose weights sum to one
  const double scale = 2 * median_px / kDeviationPerMedian;
  if (!(scale > 0)) return std::nullopt;
  Vec2 shift = Vec2::Zero();
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix2d matrix = Eigen::Matrix2d::Zero();
    Vec2 right = Vec2::Zero();
    double weights = 0;
    for (const Miss& m : misses) {
      if (m.camera != camera) continue;
      const double left = (m.px + m.slope.dot(shift)) / scale;
      const double weight = 1 / (1 + left * left);
      matrix += weight * m.slope * m.slope.transpose();
      right -= weight * m.px * m.slope;
      weights += weight;
    }
    if (!((matrix / weights).determinant() > kLeastDeterminant)) return std::nullopt;
    shift = matrix.ldlt().solve(right);
  }
  return shift;
}

}  // namespace

const CurveLabel* label_at(std::span<const LabeledRun> runs, int curve, float at) {
  const int index = static_cast<int>(at);
  const auto after = std::upper_bound(
      runs.begin(), runs.end(), std::pair(curve, index),
      [](const auto& key, const LabeledRun& r) { return key < std::pair(r.curve, r.begin); });
  if (after == runs.begin()) return nullptr;
  const LabeledRun& run = *(after - 1);
  if (run.curve != curve || index >= run.end) return nullptr;
  if (index + 1 < run.end) return &run.label;
  // On the border of two runs they have to agree.
  if (after == runs.end() || after->curve != curve || after->begin != run.end) return nullptr;
  const bool agree =
      after->label.pattern == run.label.pattern && after->label.line == run.label.line;
  return agree ? &run.label : nullptr;
}

Eigen::Matrix2d crossing_whitening(const GridGraph& graph, const Crossing& x,
                                   const TrackOptions& options) {
  const auto& curve_a = graph.curves[static_cast<std::size_t>(x.curve_a)];
  const auto& curve_b = graph.curves[static_cast<std::size_t>(x.curve_b)];
  const double same = curve_a.family == curve_b.family ? options.same_family_sigma_px : 0;
  Eigen::Matrix2d whitening;
  const auto row = [&](const Curve& curve, float at) -> Eigen::RowVector2d {
    const CurvePoint& p = curve.points[static_cast<std::size_t>(at)];
    const double sigma = std::hypot(options.position_factor * static_cast<double>(p.sigma_px),
                                    options.min_sigma_px, same);
    return p.normal.cast<double>().transpose() / sigma;
  };
  whitening.row(0) = row(curve_a, x.at_a);
  whitening.row(1) = row(curve_b, x.at_b);
  return whitening;
}

std::vector<CrossingTrack> crossing_tracks(const Rig& rig, std::span<const GridGraph> graphs,
                                           const Labeling& labeling, const TrackOptions& options) {
  const Sphere volume = working_volume(rig);
  const LikeLines like(rig);
  std::vector<std::vector<Sighting>> per_camera(graphs.size());
  parallel_for(graphs.size(), [&](std::size_t g) {
    per_camera[g] =
        sightings_of(rig, like, graphs[g],
                     labeling.runs[static_cast<std::size_t>(graphs[g].camera)], volume, options);
  });
  std::vector<Sighting> all;
  for (const auto& part : per_camera) all.insert(all.end(), part.begin(), part.end());
  std::stable_sort(all.begin(), all.end(), [](const Sighting& x, const Sighting& y) {
    return std::tie(x.a, x.b, x.view.camera) < std::tie(y.a, y.b, y.view.camera);
  });
  std::vector<CrossingTrack> tracks;
  for (std::size_t i = 0; i < all.size();) {
    std::size_t end = i + 1;
    while (end < all.size() && !(all[i].a < all[end].a) && !(all[i].b < all[end].b)) ++end;
    join(rig, std::span(all).subspan(i, end - i), options, tracks);
    i = end;
  }
  return tracks;
}

CrossingDisagreement crossing_disagreement(const Rig& rig, std::span<const CrossingTrack> tracks) {
  return median_of(misses_of(rig, tracks), [](const Miss&) { return true; });
}

std::vector<CrossingDisagreement> device_disagreements(const Rig& rig,
                                                       std::span<const CrossingTrack> tracks) {
  const std::vector<Miss> misses = misses_of(rig, tracks);
  std::vector<CrossingDisagreement> result;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    result.push_back(
        median_of(misses, [&](const Miss& m) { return m.camera == static_cast<int>(c); }));
    if (are_enough(result.back()))
      result.back().shift_px = shift_of(misses, static_cast<int>(c), result.back().median_px);
  }
  for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
    const auto is_of = [p](int projector) { return projector == static_cast<int>(p); };
    result.push_back(median_of(
        misses, [&](const Miss& m) { return is_of(m.projectors[0]) || is_of(m.projectors[1]); }));
  }
  return result;
}

bool are_enough(const CrossingDisagreement& crossings) {
  constexpr std::size_t kEnough = 30;  // as RefineRigOptions::min_tracks
  return crossings.crossings >= kEnough;
}

bool disagrees(const CrossingDisagreement& crossings) {
  // Single devices of right rigs reach 1.8 times (device_warning() in
  // pipeline/disagreement_warnings.cpp).
  constexpr double kFactor = 2;
  return are_enough(crossings) &&
         crossings.median_px > kFactor * std::max(0.05, crossings.expected_px);
}

}  // namespace pencilscan
