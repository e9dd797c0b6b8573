#include "pencilscan/pipeline/lost_cameras.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/joint/joint.h"
#include "pencilscan/pipeline/naming_doubt.h"
#include "pencilscan/pipeline/pose_search.h"
#include "pencilscan/pipeline/seen_depths.h"
#include "pencilscan/points/settle.h"
#include "pencilscan/points/triangulate.h"
#include "pencilscan/rig/object_space.h"
#include "pencilscan/surface/point_grid.h"

namespace pencilscan {
namespace {

constexpr double kLeastCosine = 0.5;  // between where a surface faces, about, and the camera

std::vector<Labeling> labels_without(const Rig& rig, std::span<const FrameCurves> frames,
                                     std::span<const std::size_t> cameras) {
  std::vector<Labeling> labelings;
  for (const FrameCurves& frame : frames) {
    std::vector<GridGraph> graphs = frame.graphs;
    for (GridGraph& graph : graphs) {
      const auto c = static_cast<std::size_t>(graph.camera);
      if (std::find(cameras.begin(), cameras.end(), c) == cameras.end()) continue;
      GridGraph none;
      none.camera = graph.camera;
      graph = std::move(none);
    }
    labelings.push_back(solve_joint(rig, frame.families, graphs, JointOptions{}));
  }
  return labelings;
}

/// Where a camera sees curves of which colours, with a margin.
class SeenCurves {
 public:
  SeenCurves(const Camera& camera, double margin_px)
      : width_(camera.width), height_(camera.height), margin_(static_cast<int>(margin_px)) {}

  /// The camera's curves in a frame, a layer per family.
  void add_frame(const GridGraph& graph, const std::vector<ColorFamily>& families) {
    for (std::size_t k = 0; k < families.size(); ++k)
      add_layer(graph, static_cast<int>(k), families[k].colors.size());
  }
  /// When all frames are there.
  void sort() { grid_.emplace(places_, margin_); }
  [[nodiscard]] bool shows(const Vec2& pixel, const PlaceOfLine& place) const {
    const double x = pixel.x() + 0.5;
    const double y = pixel.y() + 0.5;
    if (!(x >= 0 && y >= 0 && x < width_ && y < height_)) return false;
    return (layers_[place.layer][index(static_cast<int>(x), static_cast<int>(y))] & place.color) !=
           0;
  }
  /// The nearest point of a curve of the place's colour within `radius` px.
  [[nodiscard]] std::optional<LineBeside> nearest(const Vec2& pixel, const PlaceOfLine& place,
                                                  double radius) const {
    const CurvePoint* nearest = nullptr;
    double least = std::numeric_limits<double>::max();
    grid_->for_each_within(place_of(pixel, place.layer, place.color), radius,
                           [&](std::size_t i, double squared) {
                             if (squared >= least) return;
                             least = squared;
                             nearest = &points_[i];
                           });
    if (nearest == nullptr) return std::nullopt;
    return LineBeside{nearest->position.cast<double>(), nearest->normal.cast<double>()};
  }
  [[nodiscard]] static bool tells(int /*axis*/) { return true; }

 private:
  void add_layer(const GridGraph& graph, int family, std::size_t colors) {
    std::vector<std::uint8_t>& layer =
        layers_.emplace_back(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
    for (const Curve& curve : graph.curves) {
      if (curve.family != family) continue;
      for (std::size_t i = 0; i < curve.points.size(); ++i) {
        const float* code = curve.code.data() + i * colors;
        const auto best = std::max_element(code, code + colors) - code;
        const Eigen::Vector2f at = curve.points[i].position;
        paint(static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())),
              bit_of_color(best), layer);
        points_.push_back(curve.points[i]);
        places_.push_back(place_of(at.cast<double>(), layers_.size() - 1, bit_of_color(best)));
      }
    }
  }
  /// Layers and colours lie farther from each other than nearest() looks: two margins, of which
  /// margin_ is the whole number.
  [[nodiscard]] Vec3 place_of(const Vec2& pixel, std::size_t layer, std::uint8_t color) const {
    const auto set = 8 * layer + static_cast<std::size_t>(std::countr_zero(color));
    return {pixel.x(), pixel.y(), 4.0 * margin_ * static_cast<double>(set)};
  }
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  void paint(int x, int y, std::uint8_t bit, std::vector<std::uint8_t>& layer) const {
    for (int v = std::max(0, y - margin_); v <= std::min(height_ - 1, y + margin_); ++v) {
      for (int u = std::max(0, x - margin_); u <= std::min(width_ - 1, x + margin_); ++u)
        layer[index(u, v)] |= bit;
    }
  }

  int width_;
  int height_;
  int margin_;
  std::vector<std::vector<std::uint8_t>> layers_;
  std::vector<CurvePoint> points_;
  std::vector<Vec3> places_;
  std::optional<PointGrid> grid_;
};

/// Adds what `points` show of lines that this camera should see from about where it stands.
/// `layer`: of the frame's first family.
void add_places(const Rig& rig, const std::vector<ColorFamily>& families,
                std::span<const MeasuredPoint> points, std::size_t camera, std::size_t layer,
                std::vector<PlaceOfLine>& places) {
  const Vec3 center = rig.cameras[camera].center();
  for (const MeasuredPoint& p : points) {
    const PatternRef ref{p.projector, p.pattern};
    const auto family = static_cast<std::size_t>(family_of(families, ref));
    const LinePattern& lines = rig.projectors[p.projector].patterns[p.pattern];
    const Vec3 x = position_of(p);
    if (about_facing(rig, p).dot((center - x).normalized()) < kLeastCosine) continue;
    const int color =
        families[family].color_of_symbol(lines)[static_cast<std::size_t>(lines.symbol(p.line))];
    places.push_back({x, family, layer + family, bit_of_color(color)});
  }
}

/// An even share, by family.
std::vector<PlaceOfLine> some_places(std::span<const PlaceOfLine> places) {
  std::vector<PlaceOfLine> some = evenly_picked(places, kMostPlaces);
  std::stable_sort(some.begin(), some.end(),
                   [](const PlaceOfLine& a, const PlaceOfLine& b) { return a.family < b.family; });
  return some;
}

/// What the other cameras measured and this one should see.
std::vector<PlaceOfLine> places_of_lines(const Rig& rig, std::span<const FrameCurves> frames,
                                         std::span<const Labeling> labelings, std::size_t camera) {
  TriangulationOptions options;
  options.used_of_seven = 1;
  std::vector<PlaceOfLine> places;
  std::size_t layer = 0;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    add_places(rig, frames[f].families, triangulate(rig, frames[f].graphs, labelings[f], options),
               camera, layer, places);
    layer += frames[f].families.size();
  }
  return some_places(places);
}

/// Of right ones .80 and more is shown, of pictures of other places or moments .18
/// (experiments/knocked.py shows what comes of it).
constexpr double kLeastShown = 0.5;
/// Of what the best one shows: where lines of both directions go to their neighbours, half of the
/// colours agree. Lines of one direction alone show as much anywhere along them.
constexpr double kMostElsewhere = 0.75;

/// Where the camera stands, if its picture shows most of what it should there, and clearly less
/// after any other turn.
std::optional<FoundCamera> found_pose(const PoseSearch<SeenCurves>& search) {
  if (!search.has_places()) return std::nullopt;
  const std::vector<PictureWay> ways = search.ways();
  const auto more = [](const PictureWay& a, const PictureWay& b) { return a.share < b.share; };
  const PictureWay best = *std::max_element(ways.begin(), ways.end(), more);
  double elsewhere = 0;
  for (const PictureWay& way : ways)
    if (search.are_apart(way, best)) elsewhere = std::max(elsewhere, way.share);
  const PoseCorrection settled = search.settle({best.rotation_px, Vec3::Zero()});
  const double share = search.shown(settled);
  if (share < kLeastShown || elsewhere > kMostElsewhere * share) return std::nullopt;
  return FoundCamera{0, settled, share};
}

double margin_of(const Rig& rig) { return std::max(1.0, kBesideLine * line_spacing(rig)); }

/// How a camera would have to turn for its curves to lie where the others measured lines.
std::optional<TurnedCamera> turn_of(const Rig& rig, const SeenCurves& seen,
                                    const std::vector<PlaceOfLine>& places, std::size_t c) {
  constexpr double kFar = 2;  // margins; what has no line there is hidden or not drawn
  const double margin_px = margin_of(rig);
  PoseSearchOptions nearby;
  nearby.reach = 0;
  nearby.most_roll_degrees = 0;
  const PoseSearch<SeenCurves> search(rig.cameras[c], places, seen, margin_px, nearby);
  if (!search.has_places()) return std::nullopt;
  const std::vector<PictureWay> ways = search.ways();
  const PictureWay best =
      *std::max_element(ways.begin(), ways.end(),
                        [](const PictureWay& a, const PictureWay& b) { return a.share < b.share; });
  const auto given = search.pixels_of({});
  const auto turned = search.pixels_of(search.settle({best.rotation_px, Vec3::Zero()}));
  const auto distance = [&](const Vec2& pixel, const auto& line) {
    return line ? std::abs(line->normal.dot(line->position - pixel)) : kFar * margin_px;
  };
  TurnedCamera result;
  result.camera = c;
  std::vector<double> shifts;
  std::vector<double> before;
  std::vector<double> after;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (!given[i] || !turned[i] || !rig.cameras[c].contains(*given[i])) continue;
    shifts.push_back((*turned[i] - *given[i]).norm());
    const auto line_before = seen.nearest(*given[i], places[i], kFar * margin_px);
    const auto line_after = seen.nearest(*turned[i], places[i], kFar * margin_px);
    before.push_back(distance(*given[i], line_before));
    after.push_back(distance(*turned[i], line_after));
    const bool is_on = before.back() < margin_px / 2;
    const bool comes_on = after.back() < margin_px / 2;
    // What slides along its line meets the end of a curve, or leaves it: no turn is told by that.
    const auto& line = line_after ? line_after : line_before;
    const double across = line ? std::abs(line->normal.dot(*turned[i] - *given[i])) : 0;
    if (across < 0.5 * std::abs(after.back() - before.back())) continue;
    result.won += comes_on && !is_on ? 1U : 0U;
    result.lost += is_on && !comes_on ? 1U : 0U;
  }
  result.places = shifts.size();
  if (shifts.empty()) return std::nullopt;
  result.shift_px = upper_median(std::move(shifts));
  result.median_px = upper_median(std::move(before));
  result.expected_px = upper_median(std::move(after));
  return result;
}

/// That a camera is off, and not that the others measured little: cameras of right rigs have shifts
/// up to .1 px (a film of 320x240, every sixth of 120 frames), one turned by 2 px wins half of its
/// places and loses a fiftieth. After the turn its places lie .08 px from their lines in the
/// median, as those of right cameras do (.07 to .26); by chance, where relief is as fine as lines
/// and hides them from the others, .6 px and more.
bool is_off(const TurnedCamera& turn, double margin_px) {
  constexpr double kClearly = 3;     // three in four of those that change
  constexpr double kLeastWon = 0.1;  // of the places
  return turn.shift_px > margin_px / 2 && turn.expected_px < margin_px / 4 &&
         static_cast<double>(turn.won) > kClearly * static_cast<double>(turn.lost) &&
         static_cast<double>(turn.won - turn.lost) > kLeastWon * static_cast<double>(turn.places);
}

/// A camera's crossings are enough, and meet with its picture where it is.
bool meets_where_it_stands(const CrossingDisagreement& crossings) {
  constexpr double kMeetsPx = 0.25;   // half of a bump that is to be told from it
  constexpr double kAsClosely = 1.2;  // the misses that noise lets expect are known to a fifth
  return crossings.shift_px && crossings.shift_px->norm() < kMeetsPx &&
         crossings.median_px <= kAsClosely * crossings.expected_px;
}

/// Those of some cameras that are found by what all others measure.
std::vector<FoundCamera> found_by_others(const Rig& rig, std::span<const FrameCurves> frames,
                                         std::span<const std::size_t> lost,
                                         const PoseSearchOptions& options) {
  const std::vector<Labeling> of_others = labels_without(rig, frames, lost);
  const double margin_px = margin_of(rig);
  std::vector<FoundCamera> found;
  for (const std::size_t c : lost) {
    SeenCurves seen(rig.cameras[c], margin_px);
    for (const FrameCurves& frame : frames) seen.add_frame(frame.graphs[c], frame.families);
    seen.sort();
    const PoseSearch<SeenCurves> search(rig.cameras[c], places_of_lines(rig, frames, of_others, c),
                                        seen, margin_px, options);
    if (std::optional<FoundCamera> here = found_pose(search)) {
      here->camera = c;
      found.push_back(*here);
    }
  }
  return found;
}

}  // namespace

std::vector<PairAgreement> agreement_of_cameras(const Rig& rig, std::span<const FrameCurves> frames,
                                                std::span<const Labeling> labelings) {
  TriangulationOptions some;
  some.used_of_seven = 1;
  std::vector<PairAgreement> said(rig.cameras.size());
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const ViewAgreement views(
        rig, points_by_camera(rig, triangulate(rig, frames[f].graphs, labelings[f], some)));
    for (std::size_t c = 0; c < said.size(); ++c) {
      const PairAgreement of_frame = views.with_others(c);
      said[c].same += of_frame.same;
      said[c].apart += of_frame.apart;
    }
  }
  return said;
}

std::string contradicted_camera(const Rig& rig, std::span<const FrameCurves> frames,
                                std::span<const Labeling> labelings) {
  const std::vector<PairAgreement> said = agreement_of_cameras(rig, frames, labelings);
  // A right camera beside a wrong one is contradicted too: the one with the least on its side.
  const auto least = std::min_element(
      said.begin(), said.end(),
      [](const PairAgreement& a, const PairAgreement& b) { return a.share() < b.share(); });
  return least->is_doubtful() ? rig.cameras[static_cast<std::size_t>(least - said.begin())].name
                              : std::string();
}

std::string contradiction_text(const std::string& camera) {
  return "what " + camera + " measures lies elsewhere than what the other cameras do";
}

std::vector<FoundCamera> find_lost_cameras(const Rig& rig, std::span<const FrameCurves> frames,
                                           std::span<const Labeling> labelings,
                                           const PoseSearchOptions& options) {
  const NamingDoubt doubt = naming_doubt(rig, frames, labelings);
  if (const std::vector<std::size_t> lost = doubt.cameras(); !lost.empty())
    return found_by_others(rig, frames, lost, options);
  // Of two that contradict each other either may be wrong: only the wrong one is found elsewhere.
  std::vector<FoundCamera> best;
  const std::vector<PairAgreement> said = agreement_of_cameras(rig, frames, labelings);
  for (std::size_t c = 0; c < said.size(); ++c) {
    if (!said[c].is_doubtful()) continue;
    std::vector<FoundCamera> found = found_by_others(rig, frames, {&c, 1}, options);
    if (!found.empty() && (best.empty() || found.front().share > best.front().share))
      best = std::move(found);
  }
  return best;
}

std::optional<TurnedCamera> turned_camera(const Rig& rig, const std::vector<ColorFamily>& families,
                                          const std::vector<GridGraph>& graphs,
                                          const Labeling& labeling,
                                          std::span<const CrossingDisagreement> device_crossings) {
  constexpr double kMostSigma = 0.5;  // px, of a point in this camera
  const std::size_t cameras = rig.cameras.size();
  // A camera whose crossings meet is where it stands: of a right rig, most frames end here.
  std::vector<std::size_t> doubtful;
  for (std::size_t c = 0; c < cameras; ++c) {
    const bool meets = c < device_crossings.size() && meets_where_it_stands(device_crossings[c]);
    if (!meets && !graphs[c].curves.empty()) doubtful.push_back(c);
  }
  if (doubtful.empty()) return std::nullopt;
  const double margin_px = margin_of(rig);
  TriangulationOptions options;
  options.used_of_seven = 2;
  const std::vector<MeasuredPoint> points = triangulate(rig, graphs, labeling, options);
  std::vector<std::optional<SeenCurves>> seen(cameras);
  parallel_for(cameras, [&](std::size_t c) {
    seen[c].emplace(rig.cameras[c], margin_px).add_frame(graphs[c], families);
    seen[c]->sort();
  });
  // By what all other cameras but one measured.
  const auto turn = [&](std::size_t c, std::size_t without) {
    const Camera& camera = rig.cameras[c];
    std::vector<MeasuredPoint> of_others;
    for (const MeasuredPoint& p : points) {
      if (p.camera == c || p.camera == without) continue;
      const double depth = (camera.device_from_world * position_of(p)).z();
      if (double{p.sigma} * camera.focal_px() < kMostSigma * depth) of_others.push_back(p);
    }
    std::vector<PlaceOfLine> places;
    add_places(rig, families, of_others, c, 0, places);
    return turn_of(rig, *seen[c], some_places(places), c);
  };
  std::vector<std::optional<TurnedCamera>> turns(doubtful.size());
  parallel_for(doubtful.size(), [&](std::size_t k) { turns[k] = turn(doubtful[k], doubtful[k]); });
  std::optional<TurnedCamera> most;
  const auto won = [](const TurnedCamera& t) {
    return (static_cast<double>(t.won) - static_cast<double>(t.lost)) /
           static_cast<double>(t.places);
  };
  for (const std::optional<TurnedCamera>& found : turns) {
    if (found && is_off(*found, margin_px) && (!most || won(*found) > won(*most))) most = found;
  }
  if (!most) return std::nullopt;
  std::size_t right = 0;
  for (std::size_t c = 0; c < cameras; ++c) {
    if (c == most->camera || graphs[c].curves.empty()) continue;
    const std::optional<TurnedCamera> found = turn(c, most->camera);
    if (!found) continue;
    if (is_off(*found, margin_px)) return std::nullopt;
    ++right;
  }
  return right >= 2 ? most : std::nullopt;
}

}  // namespace pencilscan
