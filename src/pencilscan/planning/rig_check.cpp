#include "pencilscan/planning/rig_check.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/pattern/color_likeness.h"

namespace pencilscan {
namespace {

/// Step of the finite differences along the surface, in radii of the volume.
constexpr double kSurfaceStep = 1e-4;

struct Sample {
  Vec3 point;
  Vec3 normal;
};

/// One line family as one camera sees it at one sample.
struct Observation {
  std::size_t family = 0;
  double sensitivity = 0;
  double px_per_mm = 0;
  double spacing_px = 0;
  double direction_rad = 0;  ///< of the lines in the image, modulo pi
  double lines_per_mm = 0;   ///< of camera depth
  double period_mm = 0;      ///< of camera depth, from a line to the next that looks alike
  bool separable = false;    ///< its neighbours lie far enough apart in the image
  bool sensitive = false;
  bool usable = false;
};

/// Everything that one sample contributes; reduced in order afterwards.
struct SampleView {
  std::vector<bool> in_camera, in_projector;  ///< inside the image, whatever the normal
  std::vector<bool> seen;                     ///< per camera
  bool lit = false;
  std::vector<std::vector<Observation>> observed;  ///< per camera
};

/// Points spread evenly over the spheres: Fibonacci lattice, points i at height 1 - (2 i + 1) / n
/// and turned by the golden angle.
std::vector<Sample> make_samples(const Sphere& volume, const RigCheckOptions& options) {
  const double golden_rad = std::numbers::pi * (3 - std::sqrt(5.0));
  std::vector<Sample> samples;
  for (const double share : options.spheres) {
    for (int i = 0; i < options.points_per_sphere; ++i) {
      const double z = 1 - (2.0 * i + 1) / options.points_per_sphere;
      const double r = std::sqrt(1 - z * z);
      const Vec3 normal(r * std::cos(golden_rad * i), r * std::sin(golden_rad * i), z);
      samples.push_back({volume.center + share * volume.radius * normal, normal});
    }
  }
  return samples;
}

double incidence_cosine(const Device& device, const Sample& sample) {
  return (device.center() - sample.point).normalized().dot(sample.normal);
}

bool inside(const Device& device, const Vec3& point) {
  const auto pixel = device.project(point);
  return pixel && device.contains(*pixel);
}

double across(const Vec2& pixel, Axis axis) {
  return axis == Axis::kColumn ? pixel.x() : pixel.y();
}

double focal(const Device& device, Axis axis) {
  return axis == Axis::kColumn ? device.K(0, 0) : device.K(1, 1);
}

/// True where the projector shows lines of the pattern at the sample.
bool is_lit(const Projector& projector, const LinePattern& pattern, const Sample& sample,
            const RigCheckOptions& options) {
  if (!inside(projector, sample.point)) return false;
  if (incidence_cosine(projector, sample) < options.min_projector_cosine) return false;
  const double line = pattern.coordinate(across(*projector.project(sample.point), pattern.axis));
  return line >= -0.5 && line <= projector.line_count(pattern) - 0.5;
}

/// Gradient of the line coordinate over the image, for a surface that is the sample's tangent
/// plane: with u(t), c(t) over tangent coordinates t, grad_u c = J_u^-T grad_t c.
std::optional<Vec2> line_gradient(const Camera& camera, const Projector& projector,
                                  const LinePattern& pattern, const Sample& sample,
                                  double step_mm) {
  const Vec3 first = sample.normal.unitOrthogonal();
  const Vec3 tangents[2] = {first, sample.normal.cross(first)};
  Eigen::Matrix2d pixel_by_tangent;
  Vec2 line_by_tangent;
  for (int k = 0; k < 2; ++k) {
    const Vec3 ahead = sample.point + step_mm * tangents[k];
    const Vec3 behind = sample.point - step_mm * tangents[k];
    const auto u1 = camera.project(ahead), u0 = camera.project(behind);
    const auto p1 = projector.project(ahead), p0 = projector.project(behind);
    if (!u1 || !u0 || !p1 || !p0) return std::nullopt;
    pixel_by_tangent.col(k) = (*u1 - *u0) / (2 * step_mm);
    line_by_tangent(k) =
        (across(*p1, pattern.axis) - across(*p0, pattern.axis)) / (2 * step_mm * pattern.pitch_px);
  }
  if (std::abs(pixel_by_tangent.determinant()) < 1e-12) return std::nullopt;
  return Vec2(pixel_by_tangent.transpose().inverse() * line_by_tangent);
}

std::optional<Observation> observe(const Camera& camera, const Projector& projector,
                                   const LinePattern& pattern, const Sample& sample, double step_mm,
                                   const RigCheckOptions& options) {
  const Vec2 pixel = *camera.project(sample.point);
  const double depth = (camera.device_from_world * sample.point).z();
  const auto gradient = line_gradient(camera, projector, pattern, sample, step_mm);
  if (!gradient || gradient->norm() <= 0) return std::nullopt;
  Observation observation;
  observation.px_per_mm =
      std::abs(RayInProjector(camera, projector, pixel).slope(depth, pattern.axis));
  const double thrown = (projector.device_from_world * sample.point).z();
  observation.sensitivity = observation.px_per_mm * thrown / focal(projector, pattern.axis);
  observation.spacing_px = 1 / gradient->norm();
  observation.direction_rad = std::atan2(gradient->x(), -gradient->y());
  observation.sensitive = observation.sensitivity > options.min_sensitivity;
  observation.lines_per_mm = observation.px_per_mm / pattern.pitch_px;
  observation.period_mm = pattern.period() / observation.lines_per_mm;
  observation.separable = observation.spacing_px >= options.min_spacing_px;
  observation.usable = observation.sensitive && observation.separable;
  return observation;
}

/// Angle between two undirected lines, 0..pi/2.
double angle_between(const Observation& a, const Observation& b) {
  const double angle =
      std::abs(std::remainder(a.direction_rad - b.direction_rad, std::numbers::pi));
  return angle;
}

/// Whether lines that cross say of each other which of those that look alike they are: from one to
/// the next, the other's place moves by half a line at least.
bool tell_apart(const Observation& a, const Observation& b) {
  constexpr double kNearerToAnother = 0.5;  // lines
  return a.separable && b.separable && a.period_mm * b.lines_per_mm >= kNearerToAnother &&
         b.period_mm * a.lines_per_mm >= kNearerToAnother;
}

SampleView view_sample(const Rig& rig, const std::vector<LineFamily>& families,
                       const Sample& sample, double step_mm, const RigCheckOptions& options) {
  SampleView view;
  std::vector<std::size_t> lit;
  for (std::size_t f = 0; f < families.size(); ++f) {
    const Projector& projector = rig.projectors[families[f].projector];
    if (is_lit(projector, projector.patterns[families[f].pattern], sample, options))
      lit.push_back(f);
  }
  view.lit = !lit.empty();
  for (const Projector& projector : rig.projectors) {
    view.in_projector.push_back(inside(projector, sample.point));
  }
  view.observed.resize(rig.cameras.size());
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const Camera& camera = rig.cameras[c];
    view.in_camera.push_back(inside(camera, sample.point));
    view.seen.push_back(view.in_camera.back() && !camera.sees_texture_only &&
                        incidence_cosine(camera, sample) >= options.min_camera_cosine);
    if (!view.seen.back()) continue;
    for (const std::size_t f : lit) {
      const Projector& projector = rig.projectors[families[f].projector];
      auto observation = observe(camera, projector, projector.patterns[families[f].pattern], sample,
                                 step_mm, options);
      if (!observation) continue;
      observation->family = f;
      view.observed[c].push_back(*observation);
    }
  }
  return view;
}

double share(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

PairCheck check_pair(const std::vector<SampleView>& views, std::size_t camera,
                     const LineFamily& family, std::size_t family_index) {
  std::vector<double> sensitivity, px_per_mm, spacing;
  std::size_t sensitive = 0, usable = 0;
  for (const SampleView& view : views) {
    for (const Observation& seen : view.observed[camera]) {
      if (seen.family != family_index) continue;
      sensitivity.push_back(seen.sensitivity);
      px_per_mm.push_back(seen.px_per_mm);
      spacing.push_back(seen.spacing_px);
      sensitive += seen.sensitive ? 1 : 0;
      usable += seen.usable ? 1 : 0;
    }
  }
  PairCheck pair;
  pair.camera = camera;
  pair.family = family;
  pair.shared = sensitivity.size();
  pair.sensitive_share = share(sensitive, pair.shared);
  pair.usable_share = share(usable, pair.shared);
  pair.sensitivity_median = upper_median(std::move(sensitivity));
  pair.px_per_mm_median = upper_median(std::move(px_per_mm));
  pair.spacing_median_px = upper_median(std::move(spacing));
  return pair;
}

/// Unit direction, in world, of the line in which the planes of all lines meet: the one through the
/// projector's centre with constant pixel column (row) everywhere, the null space of K's row and z.
Vec3 axis_direction(const Projector& projector, Axis axis) {
  const Vec3 row = projector.K.row(axis == Axis::kColumn ? 0 : 1).transpose();
  const Vec3 in_device = row.cross(Vec3::UnitZ()).normalized();
  return projector.device_from_world.rotation.transpose() * in_device;
}

bool share_a_color(const LinePattern& a, const LinePattern& b) {
  return std::any_of(a.colors.begin(), a.colors.end(), [&](const PatternColor& color) {
    return std::any_of(b.colors.begin(), b.colors.end(),
                       [&](const PatternColor& other) { return look_alike(color, other); });
  });
}

/// The geometry of two axes; the image figures come from the samples.
AxesCheck axes_geometry(const Rig& rig, const LineFamily& first, const LineFamily& second,
                        const Vec3& center) {
  const Projector& p = rig.projectors[first.projector];
  const Projector& q = rig.projectors[second.projector];
  const Vec3 d1 = axis_direction(p, p.patterns[first.pattern].axis);
  const Vec3 d2 = axis_direction(q, q.patterns[second.pattern].axis);
  const Vec3 baseline = q.center() - p.center();
  const Vec3 normal = d1.cross(d2);
  const double sine = normal.norm();
  AxesCheck axes;
  axes.first = first;
  axes.second = second;
  axes.angle_rad = std::atan2(sine, std::abs(d1.dot(d2)));
  // Distance of skew lines; of (nearly) parallel ones, measured across them.
  axes.distance_mm =
      sine > 1e-9 ? std::abs(baseline.dot(normal)) / sine : baseline.cross(d1).norm();
  const double distance = 0.5 * ((p.center() - center).norm() + (q.center() - center).norm());
  axes.skewness = distance > 0 ? std::abs(baseline.dot(normal)) / distance : 0;
  axes.same_color = share_a_color(p.patterns[first.pattern], q.patterns[second.pattern]);
  return axes;
}

void add_image_figures(const std::vector<SampleView>& views, std::size_t first, std::size_t second,
                       const RigCheckOptions& options, AxesCheck& axes) {
  std::size_t crossing = 0, parallel = 0;
  for (const SampleView& view : views) {
    for (const auto& observed : view.observed) {
      const auto find = [&](std::size_t family) {
        return std::find_if(observed.begin(), observed.end(),
                            [&](const Observation& o) { return o.family == family; });
      };
      const auto a = find(first), b = find(second);
      if (a == observed.end() || b == observed.end()) continue;
      ++axes.shared;
      const bool wide = angle_between(*a, *b) >= options.min_crossing_rad;
      parallel += wide ? 0 : 1;
      crossing += wide && tell_apart(*a, *b) ? 1 : 0;
    }
  }
  axes.crossing_share = share(crossing, axes.shared);
  axes.parallel_share = share(parallel, axes.shared);
}

/// Index of a family pair (a < b) in the list that loops over a, then b.
std::size_t pair_index(std::size_t a, std::size_t b, std::size_t count) {
  return a * count - a * (a + 1) / 2 + (b - a - 1);
}

struct ViewFlags {
  bool ambiguous = false, grid = false, skew_grid = false;
};

/// What the crossings of line families do at one sample in one camera.
ViewFlags cross_families(const std::vector<Observation>& observed,
                         const std::vector<AxesCheck>& axes, std::size_t family_count,
                         const RigCheckOptions& options) {
  ViewFlags flags;
  for (std::size_t i = 0; i < observed.size(); ++i) {
    for (std::size_t j = i + 1; j < observed.size(); ++j) {
      const AxesCheck& pair =
          axes[pair_index(observed[i].family, observed[j].family, family_count)];
      const bool wide = angle_between(observed[i], observed[j]) >= options.min_crossing_rad;
      if (!wide) {
        flags.ambiguous |= pair.same_color;
      } else if (pair.first.projector != pair.second.projector &&
                 tell_apart(observed[i], observed[j])) {
        flags.grid = true;
        flags.skew_grid |= pair.skewness >= options.min_skewness;
      }
    }
  }
  return flags;
}

/// Do two cameras see the lines of one family there, and can use them?
bool is_in_two_views(const SampleView& view, std::size_t family_count) {
  std::vector<int> cameras(family_count, 0);
  for (const auto& observed : view.observed)
    for (const Observation& o : observed) cameras[o.family] += o.usable ? 1 : 0;
  return std::any_of(cameras.begin(), cameras.end(), [](int count) { return count >= 2; });
}

CoverageCheck check_coverage(const std::vector<SampleView>& views,
                             const std::vector<AxesCheck>& axes, std::size_t family_count,
                             const RigCheckOptions& options) {
  std::size_t seen = 0, lit = 0, both = 0, usable = 0, grid = 0, skew_grid = 0;
  std::size_t two_views = 0, lit_views = 0, ambiguous_views = 0;
  for (const SampleView& view : views) {
    bool any_both = false, any_usable = false, any_grid = false, any_skew = false;
    for (const auto& observed : view.observed) {
      if (observed.empty()) continue;
      any_both = true;
      any_usable |= std::any_of(observed.begin(), observed.end(),
                                [](const Observation& o) { return o.usable; });
      const ViewFlags flags = cross_families(observed, axes, family_count, options);
      any_grid |= flags.grid;
      any_skew |= flags.skew_grid;
      ++lit_views;
      ambiguous_views += flags.ambiguous ? 1 : 0;
    }
    seen += std::find(view.seen.begin(), view.seen.end(), true) != view.seen.end() ? 1 : 0;
    lit += view.lit ? 1 : 0;
    both += any_both ? 1 : 0;
    usable += any_usable ? 1 : 0;
    grid += any_grid ? 1 : 0;
    skew_grid += any_skew ? 1 : 0;
    two_views += is_in_two_views(view, family_count) ? 1 : 0;
  }
  const std::size_t n = views.size();
  return {
      share(seen, n), share(lit, n),       share(both, n),      share(usable, n),
      share(grid, n), share(skew_grid, n), share(two_views, n), share(ambiguous_views, lit_views)};
}

std::vector<double> view_shares(const std::vector<SampleView>& views,
                                std::vector<bool> SampleView::*inside_flags, std::size_t devices) {
  std::vector<double> shares;
  for (std::size_t d = 0; d < devices; ++d) {
    const auto count = std::count_if(views.begin(), views.end(), [&](const SampleView& view) {
      return (view.*inside_flags)[d];
    });
    shares.push_back(share(static_cast<std::size_t>(count), views.size()));
  }
  return shares;
}

}  // namespace

RigCheck check_rig(const Rig& rig, const RigCheckOptions& options) {
  RigCheck check;
  check.volume = working_volume(rig);
  std::vector<LineFamily> families;
  for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
    for (std::size_t k = 0; k < rig.projectors[p].patterns.size(); ++k) families.push_back({p, k});
  }
  const std::vector<Sample> samples = make_samples(check.volume, options);
  const double step_mm = kSurfaceStep * check.volume.radius;
  std::vector<SampleView> views(samples.size());
  parallel_for(samples.size(), [&](std::size_t i) {
    views[i] = view_sample(rig, families, samples[i], step_mm, options);
  });
  check.samples = samples.size();
  check.camera_view_share = view_shares(views, &SampleView::in_camera, rig.cameras.size());
  check.projector_view_share = view_shares(views, &SampleView::in_projector, rig.projectors.size());
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    if (rig.cameras[c].sees_texture_only) continue;
    for (std::size_t f = 0; f < families.size(); ++f) {
      check.pairs.push_back(check_pair(views, c, families[f], f));
    }
  }
  for (std::size_t a = 0; a < families.size(); ++a) {
    for (std::size_t b = a + 1; b < families.size(); ++b) {
      AxesCheck axes = axes_geometry(rig, families[a], families[b], check.volume.center);
      add_image_figures(views, a, b, options, axes);
      check.axes.push_back(axes);
    }
  }
  check.coverage = check_coverage(views, check.axes, families.size(), options);
  check.warnings = rig_warnings(rig, check, options);
  return check;
}

}  // namespace pencilscan
