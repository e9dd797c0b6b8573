#include "pencilscan/pipeline/lost_projectors.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/median.h"
#include "pencilscan/geometry/least_squares.h"
#include "pencilscan/pipeline/projector_places.h"

namespace pencilscan {
namespace {

/// Of fewer places a share says little: by chance the best of many turns shows three quarters
/// of 50.
constexpr std::size_t kLeastPlaces = 200;

/// What a projector shows: the lines of its patterns.
class ShownPatterns {
 public:
  ShownPatterns(const Projector& projector, std::size_t p,
                const std::vector<ColorFamily>& families) {
    for (std::size_t k = 0; k < projector.patterns.size(); ++k) {
      const PatternRef ref{static_cast<int>(p), static_cast<int>(k)};
      const LinePattern& lines = projector.patterns[k];
      const auto family = static_cast<std::size_t>(family_of(families, ref));
      Shown shown{&lines, family, projector.line_count(lines), {}};
      for (const int color : families[family].color_of_symbol(lines))
        shown.bits.push_back(bit_of_color(color));
      shown_.push_back(std::move(shown));
    }
  }

  [[nodiscard]] bool tells(int axis) const {
    return std::any_of(shown_.begin(), shown_.end(), [&](const Shown& shown) {
      return static_cast<int>(shown.lines->axis) == axis;
    });
  }
  [[nodiscard]] bool shows(const Vec2& pixel, const PlaceOfLine& place) const {
    return std::any_of(shown_.begin(), shown_.end(), [&](const Shown& shown) {
      return line_beside(shown, pixel, place, kBesideLine).has_value();
    });
  }
  [[nodiscard]] std::optional<LineBeside> nearest(const Vec2& pixel, const PlaceOfLine& place,
                                                  double radius) const {
    std::optional<LineBeside> nearest;
    double least = radius;
    for (const Shown& shown : shown_) {
      const auto line = line_beside(shown, pixel, place, radius / shown.lines->pitch_px);
      if (!line) continue;
      const auto axis = static_cast<Eigen::Index>(shown.lines->axis);
      const double position = shown.lines->position_px(*line);
      if (std::abs(pixel[axis] - position) > least) continue;
      least = std::abs(pixel[axis] - position);
      nearest = LineBeside{pixel, Vec2::Unit(axis)};
      nearest->position[axis] = position;
    }
    return nearest;
  }
  /// Turns by whole periods of the code, within a reach; px.
  [[nodiscard]] std::vector<Vec3> turns_by_periods(double reach_px) const {
    std::vector<Vec3> turns;
    for (const Shown& shown : shown_) {
      const double period = shown.lines->period() * shown.lines->pitch_px;
      // A turn about y moves the picture along x, one about x moves it against y.
      const Vec3 axis = shown.lines->axis == Axis::kColumn ? Vec3::UnitY() : Vec3::UnitX();
      for (double way = period; way <= reach_px; way += period) {
        turns.emplace_back(way * axis);
        turns.emplace_back(-way * axis);
      }
    }
    return turns;
  }
  [[nodiscard]] double pitch_px() const { return shown_.front().lines->pitch_px; }

 private:
  struct Shown {
    const LinePattern* lines = nullptr;
    std::size_t family = 0;
    int count = 0;
    std::vector<std::uint8_t> bits;  ///< by symbol
  };

  /// The nearest line, if it has the colour of the place.
  static std::optional<int> line_beside(const Shown& shown, const Vec2& pixel,
                                        const PlaceOfLine& place, double reach) {
    if (shown.family != place.family) return std::nullopt;
    const double at = shown.lines->coordinate(pixel[static_cast<Eigen::Index>(shown.lines->axis)]);
    const double nearest = std::round(at);
    if (!(std::abs(at - nearest) <= reach && nearest >= 0 && nearest < shown.count))
      return std::nullopt;
    const int line = static_cast<int>(nearest);
    if (shown.bits[static_cast<std::size_t>(shown.lines->symbol(line))] != place.color)
      return std::nullopt;
    return line;
  }

  std::vector<Shown> shown_;
};

/// A pose at which the places that it shows lie on lines.
struct SettledPose {
  PoseCorrection correction;
  double share = 0;
  double scale = 0;  ///< median of how far places lie beside their lines, over what noise explains
  double cost = 0;
};

/// Poses whose lines go through places as closely as these are known.
class CloseFit {
 public:
  CloseFit(const Projector& projector, std::span<const MeasuredPlace> places,
           const ShownPatterns& shown)
      : projector_(projector), places_(places), shown_(shown) {}

  /// The pose near this one with the least cost, the names of the lines those that it has here.
  [[nodiscard]] SettledPose fitted(const PoseCorrection& start) const {
    constexpr int kRounds = 20;
    SettledPose pose{start, 0, 1, 0};
    const auto lines = lines_at(start);
    for (int round = 0; round < kRounds; ++round) {
      const Equations at = equations(pose.correction, lines);
      pose.scale = std::max(kLeastResidualScale, at.deviation);
      Mat6 normal = Mat6::Zero();
      Vec6 right = Vec6::Zero();
      for (const Equation& e : at.all) {
        const double weight = 1 / (1 + std::pow(e.residual / (kLossScale * pose.scale), 2));
        normal += weight * e.row.transpose() * e.row;
        right -= weight * e.row.transpose() * e.residual;
      }
      // The step along the lines, which nothing tells, is none.
      normal.diagonal().array() += 1e-3;
      const Vec6 change = solve_symmetric(normal, right);
      pose.correction.rotation_px += change.head<3>();
      pose.correction.translation_mm += change.tail<3>();
    }
    return pose;
  }

  /// Sum of Cauchy's losses of all places at this scale, in squared deviations; one beside which
  /// there is no line of its colour counts as one at the border.
  [[nodiscard]] double cost(const PoseCorrection& at, double scale) const {
    Projector moved = projector_;
    moved.device_from_world = corrected_pose(projector_, at);
    const double bound = kLossScale * scale;
    const auto lines = lines_at(at);
    double sum = 0;
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const auto beside = equation(moved, at, i, lines[i]);
      const double residual = (beside ? beside->residual : border(moved, i)) / bound;
      sum += kLossScale * kLossScale * std::log1p(residual * residual);
    }
    return sum;
  }

 private:
  static constexpr double kLossScale = 3;  // as RefineRigOptions::loss_scale
  struct Equation {
    double residual = 0;  ///< in deviations
    Eigen::Matrix<double, 1, 6> row;
  };
  struct Equations {
    std::vector<Equation> all;
    double deviation = 0;
  };

  [[nodiscard]] std::vector<std::optional<LineBeside>> lines_at(const PoseCorrection& at) const {
    Projector moved = projector_;
    moved.device_from_world = corrected_pose(projector_, at);
    std::vector<std::optional<LineBeside>> lines;
    for (const MeasuredPlace& place : places_) {
      const auto pixel = moved.project(place.place.position);
      lines.push_back(pixel ? shown_.nearest(*pixel, place.place, kBesideLine * shown_.pitch_px())
                            : std::nullopt);
    }
    return lines;
  }

  /// How far the border of what counts as beside a line lies from it, in deviations.
  [[nodiscard]] double border(const Projector& moved, std::size_t i) const {
    const Vec3 x = moved.device_from_world * places_[i].place.position;
    if (!(x.z() > 0)) return kBesideLine * shown_.pitch_px() / RefineRigOptions().line_sigma_px;
    double sigma = RefineRigOptions().line_sigma_px;
    for (int axis = 0; axis < 2; ++axis) {
      if (!shown_.tells(axis)) continue;
      sigma = std::hypot(sigma, (projection_jacobian(moved, x).row(axis) *
                                 moved.device_from_world.rotation * places_[i].spread)
                                    .norm());
    }
    return kBesideLine * shown_.pitch_px() / sigma;
  }

  [[nodiscard]] std::optional<Equation> equation(const Projector& moved, const PoseCorrection& at,
                                                 std::size_t i,
                                                 const std::optional<LineBeside>& line) const {
    const double line_sigma_px = RefineRigOptions().line_sigma_px;
    const auto pixel = line ? moved.project(places_[i].place.position) : std::nullopt;
    if (!pixel) return std::nullopt;
    const Vec3 x = moved.device_from_world * places_[i].place.position;
    const Eigen::Matrix<double, 1, 3> slope =
        line->normal.transpose() * projection_jacobian(moved, x);
    const double sigma = std::hypot(
        (slope * moved.device_from_world.rotation * places_[i].spread).norm(), line_sigma_px);
    return Equation{line->normal.dot(*pixel - line->position) / sigma,
                    slope * pose_jacobian(projector_, at, x) / sigma};
  }

  [[nodiscard]] Equations equations(const PoseCorrection& at,
                                    const std::vector<std::optional<LineBeside>>& lines) const {
    Projector moved = projector_;
    moved.device_from_world = corrected_pose(projector_, at);
    Equations equations;
    std::vector<double> residuals;
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const auto e = equation(moved, at, i, lines[i]);
      if (!e) continue;
      equations.all.push_back(*e);
      residuals.push_back(std::abs(e->residual));
    }
    if (!residuals.empty())
      equations.deviation = kDeviationPerMedian * upper_median(std::move(residuals));
    return equations;
  }

  const Projector& projector_;
  std::span<const MeasuredPlace> places_;
  const ShownPatterns& shown_;
};

class ProjectorSearch {
 public:
  ProjectorSearch(const Projector& projector, std::span<const MeasuredPlace> places,
                  const ShownPatterns& shown, const PoseSearchOptions& options)
      : shown_(shown),
        reach_(options.reach * std::max(projector.width, projector.height)),
        search_(projector, some(places), shown, kBesideLine * shown.pitch_px(), options),
        fit_(projector, places, shown) {}

  /// Where the projector stands; nothing where no pose explains most of the places.
  [[nodiscard]] std::optional<FoundProjector> found() const {
    if (!search_.has_places()) return std::nullopt;
    std::vector<SettledPose> poses = {settled(Vec3::Zero())};
    for (const PictureWay& way : best_ways()) poses.push_back(settled(way.rotation_px));
    // The others that its code lets expect.
    const SettledPose first = *std::max_element(
        poses.begin(), poses.end(),
        [](const SettledPose& a, const SettledPose& b) { return a.share < b.share; });
    if (first.share < kLeastShown) return std::nullopt;
    for (const Vec3& turn : shown_.turns_by_periods(2 * reach_)) {
      const Vec3 there = first.correction.rotation_px + turn;
      if (there.head<2>().cwiseAbs().maxCoeff() > reach_) continue;
      poses.push_back(fitted({there, first.correction.translation_mm}));
    }
    // At the scale of the best one, which is wider where the others are off themselves.
    SettledPose best = of_least_cost(poses, 1);
    best = of_least_cost(poses, best.scale);
    if (best.share < kLeastShown) return std::nullopt;
    // The rig is right where no other pose explains the places clearly better.
    const SettledPose& given = poses.front();
    if (given.share >= kLeastShown && gain(given, best) <= FoundProjector::kClearGain) best = given;
    FoundProjector found;
    found.correction = best.correction;
    found.share = best.share;
    found.gain = gain(given, best);
    found.lines_away = apart(PoseCorrection{}, best.correction);
    for (const SettledPose& pose : poses)
      found.is_ambiguous |= gain(pose, best) < FoundProjector::kClearGain &&
                            apart(pose.correction, best.correction) > FoundProjector::kOtherLine;
    return found;
  }

 private:
  /// Of right poses .85 and more is shown; of wrong ones a sixth by chance, and what one can choose
  /// among them.
  static constexpr double kLeastShown = 0.5;
  static constexpr std::size_t kWays = 6;

  static std::vector<PlaceOfLine> some(std::span<const MeasuredPlace> all) {
    std::vector<PlaceOfLine> places;
    for (const MeasuredPlace& place : evenly_picked(all, kMostPlaces))
      places.push_back(place.place);
    std::stable_sort(places.begin(), places.end(), [](const PlaceOfLine& a, const PlaceOfLine& b) {
      return a.family < b.family;
    });
    return places;
  }

  /// Gives every pose its cost.
  [[nodiscard]] SettledPose of_least_cost(std::span<SettledPose> poses, double scale) const {
    for (SettledPose& pose : poses) pose.cost = fit_.cost(pose.correction, scale);
    return *std::min_element(
        poses.begin(), poses.end(),
        [](const SettledPose& a, const SettledPose& b) { return a.cost < b.cost; });
  }

  /// The turns that show most, each apart from those before.
  [[nodiscard]] std::vector<PictureWay> best_ways() const {
    std::vector<PictureWay> ways = search_.ways();
    std::stable_sort(ways.begin(), ways.end(),
                     [](const PictureWay& a, const PictureWay& b) { return a.share > b.share; });
    std::vector<PictureWay> best;
    for (const PictureWay& way : ways) {
      if (best.size() == kWays) break;
      const bool is_new = std::all_of(best.begin(), best.end(), [&](const PictureWay& other) {
        return search_.are_apart(other, way);
      });
      if (is_new) best.push_back(way);
    }
    return best;
  }

  [[nodiscard]] SettledPose settled(const Vec3& rotation_px) const {
    return fitted(search_.settle({rotation_px, Vec3::Zero()}));
  }
  /// Fitted twice: the names of the lines are those of the first fit then.
  [[nodiscard]] SettledPose fitted(const PoseCorrection& start) const {
    SettledPose pose = fit_.fitted(fit_.fitted(start).correction);
    pose.share = search_.shown(pose.correction);
    return pose;
  }

  /// How much more one pose explains than another, in squared deviations.
  static double gain(const SettledPose& from, const SettledPose& to) {
    return (from.cost - to.cost) / RefineRigOptions().correlated_crossings;
  }
  /// Median way between the pictures of two poses across the lines, in lines.
  [[nodiscard]] double apart(const PoseCorrection& a, const PoseCorrection& b) const {
    const auto from = search_.pixels_of(a);
    const auto to = search_.pixels_of(b);
    std::vector<double> ways;
    for (std::size_t i = 0; i < from.size(); ++i) {
      if (!from[i] || !to[i]) continue;
      Vec2 way = *from[i] - *to[i];
      for (int axis = 0; axis < 2; ++axis)
        if (!shown_.tells(axis)) way[axis] = 0;
      ways.push_back(way.norm() / shown_.pitch_px());
    }
    return ways.empty() ? 0 : upper_median(std::move(ways));
  }

  const ShownPatterns& shown_;
  double reach_;
  PoseSearch<ShownPatterns> search_;
  CloseFit fit_;
};

}  // namespace

std::vector<FoundProjector> find_projectors(const Rig& rig, std::span<const FrameCurves> frames,
                                            std::span<const Labeling> labelings,
                                            const PoseSearchOptions& options) {
  std::vector<FoundProjector> found;
  if (frames.empty()) return found;
  for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
    if (rig.projectors[p].patterns.empty()) continue;
    const ShownPatterns shown(rig.projectors[p], p, frames.front().families);
    const std::vector<MeasuredPlace> places = places_of_projector(rig, frames, labelings, p);
    if (places.size() < kLeastPlaces) continue;
    std::optional<FoundProjector> here =
        ProjectorSearch(rig.projectors[p], places, shown, options).found();
    if (!here) continue;
    here->projector = p;
    found.push_back(*here);
  }
  return found;
}

std::optional<FoundProjector> misplaced_projector(const Rig& rig,
                                                  std::span<const FrameCurves> frames,
                                                  std::span<const Labeling> labelings,
                                                  std::span<const std::size_t> put_back) {
  // Names that meet though they are those of other lines are so many lines further on, not rolled.
  PoseSearchOptions across;
  across.most_roll_degrees = 0;
  // The names of the others may be wrong with those of the projector; labels made without it know
  // nothing of these, but may be few.
  for (const auto& names : {labelings, std::span<const Labeling>()}) {
    for (const FoundProjector& found : find_projectors(rig, frames, names, across)) {
      const bool was_put_back =
          std::find(put_back.begin(), put_back.end(), found.projector) != put_back.end();
      if (found.is_elsewhere() || (found.is_ambiguous && was_put_back && !names.empty()))
        return found;
    }
  }
  return std::nullopt;
}

std::string misplaced_text(const Rig& rig, const FoundProjector& projector) {
  return "the lines of " + rig.projectors[projector.projector].name +
         (projector.is_elsewhere() ? " cross those of others elsewhere"
                                   : " fit as well with the names of others, further on");
}

}  // namespace pencilscan
