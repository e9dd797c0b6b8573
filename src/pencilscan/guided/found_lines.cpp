#include "pencilscan/guided/found_lines.h"

#include <algorithm>
#include <utility>

#include "pencilscan/core/stretches.h"
#include "pencilscan/detection/code_evidence.h"
#include "pencilscan/detection/curve_rendering.h"
#include "pencilscan/detection/refine.h"
#include "pencilscan/guided/merged_lines.h"
#include "pencilscan/guided/shared_curves.h"

namespace pencilscan {

LineSearch::LineSearch(const Rig& rig, const std::vector<ColorFamily>& families,
                       std::vector<cv::Mat> presence, const GuidedMatchingOptions& options,
                       CameraNames& names)
    : families_(families), colors_(rig, families), options_(options), names_(names) {
  const std::vector<Curve>& curves = names.graph().curves;
  for (std::size_t f = 0; f < presence.size(); ++f) {
    cv::Mat rest = std::move(presence[f]);
    if (rest.u == nullptr || rest.u->refcount > 1) rest = rest.clone();
    for (const Curve& curve : curves) {
      if (curve.family == static_cast<int>(f)) subtract_curve(curve, rest);
    }
    unexplained_.push_back(std::move(rest));
  }
  is_subtracted_.assign(curves.size(), 1);
}

void LineSearch::name_shared() {
  News news;
  for (SharedCurve& shared :
       find_shared(names_.camera(), families_, names_.graph().curves, names_.still_missing(),
                   names_.named(), names_.missing_places(), options_)) {
    const std::vector<char> all(shared.curve.points.size(), 1);
    add_good(std::move(shared.curve), all, shared.name, news);
  }
  append(std::move(news), false);
}

/// Names the good stretches of a curve, where they are long enough; a curve without one is none.
void LineSearch::add_good(Curve curve, const std::vector<char>& good, const LineName& name,
                          News& news) const {
  const int index = static_cast<int>(names_.graph().curves.size() + news.curves.size());
  const std::size_t before = news.runs.size();
  for_each_stretch(good, [&](int begin, int end) {
    if (good[static_cast<std::size_t>(begin)] != 0 && end - begin >= options_.min_points)
      news.runs.push_back(names_.run_of(index, begin, end, name));
  });
  if (news.runs.size() > before) news.curves.push_back(std::move(curve));
}

/// Names what is new on a fitted line: of stretches that are the line, and long enough with the
/// ends of curves that they continue, what these do not show.
template <class IsLine>
void LineSearch::add_new(const Curve& curve, const ContinuedLine& line, IsLine is_line,
                         const LineName& name, News& news) const {
  std::vector<char> is_known;
  std::vector<char> good;
  for (const CurvePoint& p : curve.points) {
    is_known.push_back(line.is_of_end(p) ? 1 : 0);
    good.push_back(is_known.back() != 0 || is_line(p) ? 1 : 0);
  }
  for_each_stretch(good, [&](int begin, int end) {
    if (good[static_cast<std::size_t>(begin)] == 0 || end - begin < options_.min_points) return;
    const std::span of_stretch(is_known.begin() + begin, is_known.begin() + end);
    for_each_stretch(of_stretch, [&](int first, int last) {
      if (of_stretch[static_cast<std::size_t>(first)] != 0) return;
      const auto points = curve.points.begin() + begin;
      const auto index = static_cast<int>(names_.graph().curves.size() + news.curves.size());
      news.curves.push_back({curve.family, {points + first, points + last}, {}});
      news.runs.push_back(names_.run_of(index, 0, last - first, name));
    });
  });
}

/// Curves that no image showed by themselves. `hold_light`: that no other curve holds.
void LineSearch::append(News news, bool hold_light) {
  GridGraph& graph = names_.graph();
  is_subtracted_.resize(graph.curves.size() + news.curves.size(), hold_light ? 1 : 0);
  for (Curve& curve : news.curves) {
    const auto family = static_cast<std::size_t>(curve.family);
    if (hold_light) subtract_curve(curve, unexplained_[family]);
    curve.code.assign(curve.points.size() * families_[family].colors.size(), 0.F);
    graph.curves.push_back(std::move(curve));
    graph.component_of_curve.push_back(-1);
    if (!graph.identities.empty()) graph.identities.emplace_back();
  }
  names_.accept(std::move(news.runs));
}

/// A curve where a line is predicted, as wide as it would be there, and as high as lines around.
Curve LineSearch::guess_of(const LineChain& chain) const {
  constexpr std::size_t kStep = 8;  // points; what counts as around reaches farther
  Curve curve;
  curve.family = family_of(families_, chain.front().pattern);
  float height = 0;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const PredictedPoint& p = chain[i];
    if (i % kStep == 0)
      height =
          names_.named().amplitude_around(p.position, name_of(p), p.spacing_px, 0, 1).value_or(0.F);
    CurvePoint point;
    point.position = p.position;
    point.normal = p.normal;
    point.width_px = names_.missing_places().expected_width(p);
    point.amplitude = height;
    curve.points.push_back(point);
  }
  return curve;
}

/// The points of curves that have no name.
Places<LineSearch::CurvePlace> LineSearch::undecided_places() const {
  const auto decided = names_.decided_points();
  Places<CurvePlace> places(names_.camera().width, names_.camera().height, 3);
  for (std::size_t c = 0; c < decided.size(); ++c) {
    const Curve& curve = names_.graph().curves[c];
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
      if (decided[c][i] == 0) places.add(curve.points[i].position, {c, i});
    }
  }
  return places;
}

/// True where a curve without a name may be of another line than the named one, on which it lies:
/// its colour says so, or it may be of a wall, whose lines have all colours.
bool LineSearch::is_of_other(const CurvePlace& place, const LineName& name) const {
  const Curve& curve = names_.graph().curves[place.curve];
  const auto middle = static_cast<int>(place.point);
  const int begin = std::max(0, middle - kPointsPerMeasurement / 2);
  const int end =
      std::min(static_cast<int>(curve.points.size()), middle + kPointsPerMeasurement / 2 + 1);
  return names_.shows_background() || colors_.margin(curve, {PointRange{begin, end}}, name) < 0;
}

/// True where what the curves leave of the light may be left of a curve of another line, within
/// `reach` px of a point.
bool LineSearch::is_rest_of_other(const CurvePoint& point, const LineName& name, float reach,
                                  const Places<CurvePlace>& undecided) const {
  const int family = family_of(families_, name.pattern);
  bool found = false;
  undecided.around(point.position, reach, [&](const CurvePlace& place) {
    const Curve& curve = names_.graph().curves[place.curve];
    const CurvePoint& other = curve.points[place.point];
    found = found || (curve.family == family &&
                      (other.position - point.position).squaredNorm() < reach * reach &&
                      PredictedPlaces::have_same_direction(other.normal, point.normal) &&
                      is_of_other(place, name));
  });
  return found;
}

void LineSearch::find_missing() {
  if (unexplained_.empty()) return;
  const Places<CurvePlace> undecided = undecided_places();
  RefineOptions fitting;
  fitting.min_points = options_.min_points;
  const NamedEnds ends(names_.camera(), names_.graph().curves, names_.runs(), is_subtracted_);
  News news;
  for (const LineChain& chain : names_.still_missing()) {
    // Where the surface is as it was, the line was not found before. Lines of floors and walls that
    // no curve shows give no curve a wrong name.
    const auto is_worth_it = [&](const PredictedPoint& p) {
      return names_.is_new(p) && names_.is_of_object(p);
    };
    if (std::none_of(chain.begin(), chain.end(), is_worth_it)) continue;
    const LineName name = name_of(chain.front());
    const ContinuedLine line = ends.continued(guess_of(chain), name, fitting.half_arc + 1);
    if (static_cast<int>(line.curve.points.size()) < options_.min_points) continue;
    const int family = line.curve.family;
    cv::Mat& image = unexplained_[static_cast<std::size_t>(family)];
    // As near as a curve lies to its line.
    const auto reach = static_cast<float>(
        std::min(options_.max_offset_px,
                 options_.max_offset_lines * static_cast<double>(chain.front().spacing_px)));
    const float least = static_cast<float>(fitting.end_amplitude_ratio) * line.amplitude_within();
    const auto is_line = [&](const CurvePoint& p) {
      return p.amplitude >= least && names_.fits(p, name, family) &&
             !is_rest_of_other(p, name, reach, undecided);
    };
    for (const Curve& end : line.ends) add_curve(end, image);
    for (const Curve& curve : fit_guess(image, line.curve, fitting))
      add_new(curve, line, is_line, name, news);
    for (const Curve& end : line.ends) subtract_curve(end, image);
  }
  append(std::move(news), true);
}

void LineSearch::find_merged() {
  if (unexplained_.empty()) return;
  // Of the points beside named curves. A line that is there shows along most of them; what the
  // curves beside an unlit one leave is found here and there.
  constexpr double kMost = 0.5;
  const MergedLines merged(names_.camera(), names_.graph().curves, names_.runs(), is_subtracted_,
                           names_.shown(), unexplained_);
  News news;
  for (const LineChain& chain : names_.still_missing()) {
    const auto is_of_object = [&](const PredictedPoint& p) { return names_.is_of_object(p); };
    if (static_cast<int>(chain.size()) < options_.min_points ||
        std::none_of(chain.begin(), chain.end(), is_of_object))
      continue;
    const LineName name = name_of(chain.front());
    MergedLines::Fit fit = merged.fit(guess_of(chain), name);
    std::vector<std::vector<char>> good;
    std::ptrdiff_t count = 0;
    for (const Curve& piece : fit.pieces) {
      good.emplace_back();
      for (const CurvePoint& p : piece.points)
        good.back().push_back(names_.fits(p, name, piece.family));
      count += std::count(good.back().begin(), good.back().end(), 1);
    }
    if (static_cast<double>(count) < kMost * static_cast<double>(fit.beside)) continue;
    for (std::size_t k = 0; k < fit.pieces.size(); ++k)
      add_good(std::move(fit.pieces[k]), good[k], name, news);
  }
  // The curves beside them hold their light.
  append(std::move(news), false);
}

}  // namespace pencilscan
