#include "pencilscan/artefact/artefact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "pencilscan/artefact/find_shapes.h"
#include "pencilscan/artefact/known_ball.h"
#include "pencilscan/artefact/plate_face.h"
#include "pencilscan/artefact/sphere_fit.h"
#include "pencilscan/artefact/trimmed.h"
#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/length_units.h"

namespace pencilscan {
namespace {

constexpr std::size_t kWorstShown = 10;

struct Box {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 high = -low;
};

Box box_of(std::span<const Vec3> points) {
  Box box;
  for (const Vec3& x : points) {
    box.low = box.low.cwiseMin(x);
    box.high = box.high.cwiseMax(x);
  }
  return box;
}

[[noreturn]] void no_fit(const ArtefactPoints& points, const std::string& shape,
                         const std::string& why = {}) {
  const Box box = box_of(points.points);
  throw StageError(
      points.source + ": no " + shape + " fits " + std::to_string(points.points.size()) +
      " points, which reach over " + formatted((box.high - box.low).maxCoeff(), "%.3g") +
      (points.unit_known ? " mm (lengths are taken as millimetres)"
                         : " of the rig's units (which unit, it does not say)") +
      why +
      (points.outside_region > 0 ? "; --region left out " + std::to_string(points.outside_region)
                                 : std::string()));
}

/// InputError where `option` has left none of the points.
void require_some(const ArtefactPoints& points, const char* option, const std::string& value,
                  const std::string& what) {
  if (points.points.empty())
    throw InputError(points.source, option, value, "must leave some of the " + what);
}

std::string mm_text(const Vec3& v) {
  std::string text;
  for (const double value : {v.x(), v.y(), v.z()})
    text += (text.empty() ? "" : " ") + formatted(value, "%.6g");
  return text;
}

std::string mm_text(double a, double b) {
  return formatted(a, "%.6g") + " x " + formatted(b, "%.6g");
}

std::size_t removed_of(std::size_t count) {
  return static_cast<std::size_t>(std::floor(kTrimmedShare * static_cast<double>(count)));
}

/// max - min of the signed distances of the points (all, or those of the indices).
template <typename Distance>
double range(std::span<const Vec3> points, const Distance& distance,
             const std::vector<std::size_t>* indices = nullptr) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  const std::size_t count = indices != nullptr ? indices->size() : points.size();
  for (std::size_t k = 0; k < count; ++k) {
    const double d = distance(points[indices != nullptr ? (*indices)[k] : k]);
    low = std::min(low, d);
    high = std::max(high, d);
  }
  return high - low;
}

/// The farthest points, and among them the greatest and the least signed distance, which make the
/// figure: where the farthest all lie on one side, the last place is the other side's.
template <typename Distance>
std::vector<WorstPoint> worst_points(std::span<const Vec3> points, const Distance& distance) {
  std::vector<WorstPoint> worst(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) worst[i] = {i, distance(points[i])};
  if (worst.empty()) return worst;
  const auto [least, greatest] = std::minmax_element(
      worst.begin(), worst.end(),
      [](const WorstPoint& a, const WorstPoint& b) { return a.distance < b.distance; });
  const WorstPoint ends[] = {*least, *greatest};
  const std::size_t shown = std::min(kWorstShown, worst.size());
  std::partial_sort(worst.begin(), worst.begin() + static_cast<std::ptrdiff_t>(shown), worst.end(),
                    [](const WorstPoint& a, const WorstPoint& b) {
                      const double x = std::abs(a.distance), y = std::abs(b.distance);
                      return x != y ? x > y : a.index < b.index;
                    });
  worst.resize(shown);
  for (const WorstPoint& end : ends) {
    const bool is_there = std::any_of(worst.begin(), worst.end(), [&](const WorstPoint& point) {
      return point.distance == end.distance;
    });
    if (!is_there) worst.back() = end;
  }
  return worst;
}

/// Least squares with nothing removed and with 3 per mille removed; the radius free or held.
struct SphereFits {
  Sphere all;
  TrimmedFit<Sphere> trimmed;
};
std::optional<SphereFits> fit_both(std::span<const Vec3> points, const Sphere& start,
                                   std::optional<double> radius = {}) {
  const auto all = fit_sphere(points, start, radius);
  if (!all) return std::nullopt;
  auto trimmed = fit_trimmed(
      points, removed_of(points.size()), std::vector<Sphere>{*all, start},
      [&](std::span<const Vec3> rest, const Sphere& from) {
        return fit_sphere(rest, from, radius);
      },
      [](const Sphere& sphere, const Vec3& point) { return signed_distance(sphere, point); });
  if (!trimmed) return std::nullopt;
  return SphereFits{*all, std::move(*trimmed)};
}

/// The points that are the artefact, with what the rig says of their unit.
ArtefactPoints of_region(ArtefactPoints points, const Rig* rig, const ArtefactOptions& options) {
  points.unit_known = rig == nullptr || rig->unit_known;
  if (!options.region || points.points.empty()) return points;
  ArtefactPoints part = within(points, *options.region);
  const Box box = box_of(points.points);
  require_some(part, "--region",
               mm_text(options.region->center) + " " + formatted(options.region->radius, "%.6g"),
               std::to_string(points.points.size()) + " points, which lie from " +
                   mm_text(box.low) + " to " + mm_text(box.high));
  return part;
}

/// Without the points in a cone seen from the ball's centre.
ArtefactPoints without_cone(const ArtefactPoints& points, const Vec3& center,
                            const LeftOutCone& cone) {
  const double least = std::cos(cone.half_angle_rad);
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    const Vec3 offset = points.points[i] - center;
    if (offset.dot(cone.direction) < least * offset.norm()) kept.push_back(i);
  }
  return points.subset(kept);
}

/// The figures of one ball whose rough place is known.
BallFigures measure_ball(ArtefactPoints points, const Sphere& start, const Rig* rig,
                         const ArtefactOptions& options, const std::string& name = "sphere",
                         const std::string& why_not = {}) {
  BallFigures ball;
  ball.points = std::move(points);
  const std::span<const Vec3> all(ball.points.points);
  const auto fits = fit_both(all, start);
  if (!fits) no_fit(ball.points, name, why_not);
  ball.sphere = fits->all;
  ball.trimmed = fits->trimmed.model;
  ball.removed = all.size() - fits->trimmed.kept.size();
  const auto from = [](const Sphere& sphere) {
    return [sphere](const Vec3& point) { return signed_distance(sphere, point); };
  };
  ball.form_mm = {range(all, from(ball.sphere)),
                  range(all, from(ball.trimmed), &fits->trimmed.kept)};
  if (options.diameter_mm) {
    ball.size_mm = {2 * ball.sphere.radius - *options.diameter_mm,
                    2 * ball.trimmed.radius - *options.diameter_mm};
  }
  ball.worst = worst_points(all, from(ball.sphere));
  ball.coverage = sphere_coverage(all, ball.trimmed);
  ball.z = z_scores(ball.points, rig, [&](const Vec3& point, const std::optional<Vec3>& center) {
    return center ? error_along_ray(ball.trimmed, point, *center)
                  : std::optional(signed_distance(ball.trimmed, point));
  });
  return ball;
}

/// Why no ball of the stated size was found, where it is a matter of units.
std::string advice_on_unit(const ArtefactPoints& points, const ArtefactOptions& options) {
  if (!options.diameter_mm || !points.unit_known) return {};
  return unit_advice(points.points, *options.diameter_mm, options.seed);
}

std::optional<double> radius_of(const ArtefactOptions& options) {
  if (!options.diameter_mm) return std::nullopt;
  return *options.diameter_mm / 2;
}

/// Points that lie between the balls around the line that joins their centres.
std::size_t count_between(std::span<const Vec3> points, const Vec3& a, const Vec3& b,
                          double radius) {
  const double length = (b - a).norm();
  const Vec3 along = (b - a) / length;
  const auto lies_between = [&](const Vec3& point) {
    const double t = along.dot(point - a);
    const double off = (point - a - t * along).norm();
    return t > 1.1 * radius && t < length - 1.1 * radius && off < radius;
  };
  return static_cast<std::size_t>(std::count_if(points.begin(), points.end(), lies_between));
}

/// What to do where the points of one of the balls are not those of a ball.
std::string ball_advice(const ArtefactOptions& options, std::size_t between) {
  if (between == 0) return "; --region leaves out what is not the balls";
  return "; " + std::to_string(between) + " of them lie between the balls; " +
         (options.bar_diameter_mm > 0 ? "the bar is probably thicker than --bar-diameter = " +
                                            formatted(options.bar_diameter_mm, "%.6g") + " mm"
                                      : "--bar-diameter leaves a bar out") +
         ", --region leaves out what is farther off";
}

/// Of all points of a ball, which are to be its own. StageError.
void require_size(const BallFigures& ball, const std::string& name, const ArtefactOptions& options,
                  const std::string& advice) {
  if (has_size(ball.sphere, *options.diameter_mm / 2)) return;
  throw StageError(ball.points.source + ": " + name + " is " +
                   formatted(2 * ball.sphere.radius, "%.4g") + " mm across by its " +
                   std::to_string(ball.points.points.size()) + " points, and --diameter says " +
                   formatted(*options.diameter_mm, "%.6g") + advice);
}

constexpr double kUnitTolerance = 0.15;  // of the surface's sides: its rim may be missing

/// Points of which both sides are a unit smaller than the stated ones are in that unit: of a plate
/// a tenth of which was measured along both sides, nothing could be said anyway.
void require_points_in_mm(const PlateFigures& plate, double length, double width,
                          const std::string& of_surface) {
  const PlaneSurface& surface = plate.surface;
  if (!plate.points.unit_known || !(surface.width_mm > 0)) return;
  const UnitFactor* along =
      unit_behind_factor(std::max(length, width) / surface.length_mm, kUnitTolerance);
  const UnitFactor* across =
      unit_behind_factor(std::min(length, width) / surface.width_mm, kUnitTolerance);
  if (along == nullptr || along != across || along->factor < 1) return;
  throw InputError(plate.points.source, "--length x --width", mm_text(length, width),
                   "must be the sides of the plate in mm, whose surface is " + of_surface +
                       " mm large: the points are probably in " + along->words +
                       ", to be multiplied by " + formatted(along->factor, "%.6g"));
}

/// A plate's surface that covers as much beyond the stated sides as on them is that of another
/// plate, of sides in another unit (which makes one side 2.5 times as long at least), or of a
/// table.
void require_stated_sides(const PlateFigures& plate, const ArtefactOptions& options) {
  constexpr double kFarBeyond = 2;  // of the stated area
  if (!options.plate_length_mm || !options.plate_width_mm) return;
  const double length = *options.plate_length_mm, width = *options.plate_width_mm;
  const PlaneSurface& surface = plate.surface;
  const std::string of_surface =
      formatted(surface.length_mm, "%.4g") + " x " + formatted(surface.width_mm, "%.4g");
  require_points_in_mm(plate, length, width, of_surface);
  if (surface.area_mm2 <= kFarBeyond * length * width) return;
  const UnitFactor* unit = unit_behind_factor(
      std::sqrt(surface.length_mm * surface.width_mm / (length * width)), kUnitTolerance);
  const std::string why =
      !plate.points.unit_known ? " of the rig's units (which unit, it does not say)"
      : unit != nullptr        ? " mm: they are probably in " + std::string(unit->words)
                               : " mm; --region leaves out what is not the plate";
  throw InputError(
      plate.points.source, "--length x --width", mm_text(length, width),
      "must be the sides of the plate in mm, whose surface goes on over " + of_surface + why);
}

}  // namespace

BallFigures measure_sphere(const ArtefactPoints& given, const Rig* rig,
                           const ArtefactOptions& options) {
  ArtefactPoints points = of_region(given, rig, options);
  const auto start = find_sphere(points.points, {radius_of(options), {}, options.seed});
  if (!start) no_fit(points, "sphere", advice_on_unit(points, options));
  std::size_t left_out = 0;
  if (options.stem) {
    ArtefactPoints kept =
        without_cone(points, refined(points.points, *start).center, *options.stem);
    require_some(kept, "--stem",
                 mm_text(options.stem->direction) + " " +
                     formatted(options.stem->half_angle_rad * 180 / std::numbers::pi, "%.4g"),
                 std::to_string(points.points.size()) + " points");
    left_out = points.points.size() - kept.points.size();
    points = std::move(kept);
  }
  BallFigures ball = measure_ball(std::move(points), *start, rig, options);
  if (options.diameter_mm && !has_size(ball.sphere, *options.diameter_mm / 2)) {
    const std::string advice = advice_on_unit(ball.points, options);
    no_fit(ball.points, "sphere",
           !advice.empty()
               ? advice
               : ": the one nearest to all of them is " +
                     formatted(2 * ball.sphere.radius, "%.4g") +
                     " mm across, and --diameter says " + formatted(*options.diameter_mm, "%.6g") +
                     "; --region and --stem leave out what is not the ball");
  }
  ball.left_out = left_out;
  return ball;
}

BallBarFigures measure_ball_bar(const ArtefactPoints& given, const Rig* rig,
                                const ArtefactOptions& options) {
  PENCILSCAN_CHECK(options.diameter_mm.has_value());
  const double radius = *options.diameter_mm / 2;
  const ArtefactPoints points = of_region(given, rig, options);
  SphereSearch search{radius, {}, options.seed};
  auto first = find_sphere(points.points, search);
  if (!first) no_fit(points, "ball of this diameter", advice_on_unit(points, options));
  first = refined(points.points, *first);
  search.not_here = Sphere{first->center, *options.diameter_mm};
  // What lies on the first ball has no vote about the second.
  std::vector<Vec3> others;
  for (const Vec3& point : points.points) {
    if (std::abs((point - first->center).norm() - radius) > 0.1 * radius) others.push_back(point);
  }
  auto second = find_sphere(others, search);
  if (!second) no_fit(points, "second ball of this diameter", advice_on_unit(points, options));
  second = refined(others, *second);

  BallBarFigures bar;
  std::vector<std::size_t> of_ball[2];
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    const double to_first = (points.points[i] - first->center).squaredNorm();
    const double to_second = (points.points[i] - second->center).squaredNorm();
    of_ball[to_first <= to_second ? 0 : 1].push_back(i);
  }
  Vec3 center[2], trimmed_center[2];
  for (int b = 0; b < 2; ++b) {
    const Sphere& own = b == 0 ? *first : *second;
    const Sphere& other = b == 0 ? *second : *first;
    ArtefactPoints part = points.subset(of_ball[b]);
    const std::size_t whole = part.points.size();
    if (options.bar_diameter_mm > 0) {
      // The bar's shadow on the ball, and half as much again for the fillet or the thread.
      const double sine = std::min(1.0, 1.5 * options.bar_diameter_mm / *options.diameter_mm);
      part = without_cone(part, own.center,
                          {(other.center - own.center).normalized(), std::asin(sine)});
    }
    const auto held = fit_both(part.points, own, radius);
    const std::size_t between = count_between(part.points, first->center, second->center, radius);
    const std::string advice = ball_advice(options, between);
    const std::string name = "ball " + std::to_string(b + 1);
    if (!held || !is_ball(part.points, own, radius))
      no_fit(part, name + " of this diameter", advice);
    center[b] = held->all.center;
    trimmed_center[b] = held->trimmed.model.center;
    bar.balls.push_back(measure_ball(std::move(part), own, rig, options, name, advice));
    require_size(bar.balls.back(), name, options, advice);
    bar.balls.back().left_out = whole - bar.balls.back().points.points.size();
    bar.between += between;
  }
  bar.distance_mm = {(center[1] - center[0]).norm(),
                     (trimmed_center[1] - trimmed_center[0]).norm()};
  if (options.length_mm) {
    bar.spacing_mm = {bar.distance_mm.all - *options.length_mm,
                      bar.distance_mm.trimmed - *options.length_mm};
  }
  return bar;
}

PlateFigures measure_plate(const ArtefactPoints& given, const Rig* rig,
                           const ArtefactOptions& options) {
  PlateFigures plate;
  plate.points = of_region(given, rig, options);
  if (options.plate_thickness_mm) {
    const std::size_t whole = plate.points.points.size();
    FacePoints face = points_of_face(
        plate.points, {*options.plate_thickness_mm, options.border_mm, options.plate_length_mm,
                       options.plate_width_mm, options.seed});
    plate.points = std::move(face.points);
    plate.surface = face.surface;
    require_stated_sides(plate, options);
    require_some(plate.points, "--border", formatted(options.border_mm, "%.6g"),
                 "plate's face of " + mm_text(face.rim.length, face.rim.width) + " mm");
    plate.left_out = whole - plate.points.points.size();
  }
  const std::span<const Vec3> all(plate.points.points);
  const auto plane = fit_plane(all);
  if (!plane) no_fit(plate.points, "plane");
  std::vector<Plane> starts{*plane};
  if (const auto found = find_plane(all, options.seed)) starts.push_back(*found);
  const auto trimmed = fit_trimmed(
      all, removed_of(all.size()), starts,
      [](std::span<const Vec3> rest, const Plane&) { return fit_plane(rest); },
      [](const Plane& p, const Vec3& point) { return p.signed_distance(point); });
  if (!trimmed) no_fit(plate.points, "plane");
  plate.plane = *plane;
  plate.trimmed = trimmed->model;
  plate.removed = all.size() - trimmed->kept.size();
  const auto from = [](const Plane& p) {
    return [p](const Vec3& point) { return p.signed_distance(point); };
  };
  plate.flatness_mm = {range(all, from(plate.plane)),
                       range(all, from(plate.trimmed), &trimmed->kept)};
  plate.worst = worst_points(all, from(plate.plane));
  std::vector<Vec3> kept;
  for (const std::size_t i : trimmed->kept) kept.push_back(all[i]);
  plate.rectangle = smallest_rectangle(kept, plate.trimmed);
  if (options.plate_length_mm && options.plate_width_mm) {
    plate.rectangle.length = std::max(*options.plate_length_mm, *options.plate_width_mm);
    plate.rectangle.width = std::min(*options.plate_length_mm, *options.plate_width_mm);
  }
  if (!options.plate_thickness_mm) {
    plate.surface = connected_surface(kept, smallest_rectangle(kept, plate.trimmed));
    require_stated_sides(plate, options);
  }
  plate.coverage = plate_coverage(all, plate.rectangle);
  plate.z = z_scores(plate.points, rig, [&](const Vec3& point, const std::optional<Vec3>& center) {
    const double distance = plate.trimmed.signed_distance(point);
    if (!center) return std::optional(distance);
    const double slope = plate.trimmed.normal.dot((point - *center).normalized());
    return slope != 0 ? std::optional(distance / slope) : std::nullopt;
  });
  return plate;
}

}  // namespace pencilscan
