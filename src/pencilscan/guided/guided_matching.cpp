#include "pencilscan/guided/guided_matching.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stretches.h"
#include "pencilscan/detection/code_evidence.h"
#include "pencilscan/detection/curve_rendering.h"
#include "pencilscan/detection/refine.h"
#include "pencilscan/geometry/light_sheet.h"
#include "pencilscan/guided/denied_lines.h"
#include "pencilscan/guided/line_chains.h"
#include "pencilscan/guided/merged_lines.h"
#include "pencilscan/guided/name_colors.h"
#include "pencilscan/guided/named_ends.h"
#include "pencilscan/guided/named_points.h"
#include "pencilscan/guided/predicted_places.h"
#include "pencilscan/guided/shared_curves.h"
#include "pencilscan/points/triangulate.h"
#include "pencilscan/rig/object_space.h"
#include "pencilscan/view/places.h"

namespace pencilscan {
namespace {

/// A point of a curve.
struct CurvePlace {
  std::size_t curve;
  std::size_t point;
};

/// Guided matching in one camera.
class CameraMatching {
 public:
  CameraMatching(const Rig& rig, const std::vector<ColorFamily>& families,
                 std::vector<cv::Mat> presence, GridGraph& graph, std::vector<LabeledRun>& runs,
                 std::span<const LabeledRun> tentative, const GuidedMatchingOptions& options,
                 std::span<const MeasuredPoint> dense);

  /// Predicts all lines on the surface of what is labelled; keeps those that no labelled point
  /// shows.
  void predict();
  /// Confirms tentative labels where the predicted line is the same.
  void confirm_tentative();
  /// Gives undecided stretches of curves the predicted line they lie on.
  void adopt_curves();
  /// Names lines that lie on curves of other projectors, where the light is that of all.
  void name_shared();
  /// Fits what is still missing to what the known curves leave of the presence images.
  void find_missing();
  /// Fits it beside named curves, which hold its light too.
  void find_merged();
  /// Where colours denied a dense surface in the last pass.
  [[nodiscard]] const std::vector<DeniedRun>& denied() const { return denied_; }
  /// Per projector, since predict() was called first.
  [[nodiscard]] const std::vector<ExpectedLines>& expected() const { return expected_; }
  /// The surface of all that is labelled now.
  [[nodiscard]] LocalSurface take_surface();

 private:
  void accept(std::vector<LabeledRun> news);
  struct News {
    std::vector<Curve> curves;
    std::vector<LabeledRun> runs;
  };
  void add_good(Curve curve, const std::vector<char>& good, const LineName& name, News& news) const;
  template <class IsLine>
  void add_new(const Curve& curve, const ContinuedLine& line, IsLine is_line, const LineName& name,
               News& news) const;
  void append(News news, bool hold_light);
  void grow_surface();
  [[nodiscard]] bool fits(const CurvePoint& point, const LineName& name, int family) const;
  [[nodiscard]] bool is_supported(const Curve& curve, int begin, int end, const LineName& name,
                                  float margin) const;
  [[nodiscard]] bool is_of_object(const LabeledRun& run, int at) const;
  [[nodiscard]] bool agrees_along(int curve, int begin, int end, const LineName& name) const;
  [[nodiscard]] bool is_long_enough(const std::vector<char>& decided, int begin, int end) const;
  [[nodiscard]] std::vector<std::vector<char>> decided_points() const;
  [[nodiscard]] LabeledRun run_of(int curve, int begin, int end, const LineName& name) const {
    return {
        curve, begin, end,
        CurveLabel{name.pattern, name.line, static_cast<double>(name.line), options_.confidence}};
  }
  [[nodiscard]] std::vector<LineChain> still_missing();
  [[nodiscard]] Curve guess_of(const LineChain& chain) const;
  [[nodiscard]] Places<CurvePlace> undecided_places() const;
  [[nodiscard]] bool is_of_other(const CurvePlace& place, const LineName& name) const;
  [[nodiscard]] bool is_rest_of_other(const CurvePoint& point, const LineName& name, float reach,
                                      const Places<CurvePlace>& undecided) const;

  const Rig& rig_;
  const std::vector<ColorFamily>& families_;
  NameColors colors_;
  const Camera& camera_;
  GridGraph& graph_;
  std::vector<LabeledRun>& runs_;
  std::span<const LabeledRun> tentative_;
  const GuidedMatchingOptions& options_;
  std::vector<PatternRef> patterns_;  ///< that the camera can see
  std::vector<cv::Mat> unexplained_;  ///< per family; empty without images
  std::vector<char> is_subtracted_;   ///< per curve, from them
  ObjectSpace space_;
  LocalSurface surface_;
  std::vector<char> shows_object_;          ///< per patch, 0: floors and walls
  bool shows_background_ = false;           ///< some patch did
  bool has_dense_;                          ///< the surface does not rest on labels alone
  std::vector<MeasuredPoint> dense_;        ///< more points, not on the surface yet
  std::vector<LabeledRun> not_on_surface_;  ///< runs whose points it does not hold yet
  NamedPoints named_;
  std::vector<PredictedPoint> missing_;  ///< predicted points that no label explains
  std::size_t not_shown_by_ = 0;         ///< so many named points do not show any of those
  std::vector<PredictedPoint> shown_;    ///< those that one does
  PredictedPlaces missing_places_;       ///< those as of the last predict()
  std::vector<DeniedRun> denied_;
  std::vector<ExpectedLines> expected_;
};

CameraMatching::CameraMatching(const Rig& rig, const std::vector<ColorFamily>& families,
                               std::vector<cv::Mat> presence, GridGraph& graph,
                               std::vector<LabeledRun>& runs, std::span<const LabeledRun> tentative,
                               const GuidedMatchingOptions& options,
                               std::span<const MeasuredPoint> dense)
    : rig_(rig),
      families_(families),
      colors_(rig, families),
      camera_(rig.camera(graph.camera)),
      graph_(graph),
      runs_(runs),
      tentative_(tentative),
      options_(options),
      space_(rig),
      surface_(camera_, options.surface),
      has_dense_(!dense.empty()),
      named_(camera_, options),
      missing_places_(rig, families, camera_, options) {
  for (const ColorFamily& family : families) {
    for (const PatternRef& ref : family.patterns) {
      if (can_see_pattern(rig, camera_, ref.projector)) patterns_.push_back(ref);
    }
  }
  for (std::size_t f = 0; f < presence.size(); ++f) {
    cv::Mat rest = std::move(presence[f]);
    if (rest.u == nullptr || rest.u->refcount > 1) rest = rest.clone();
    for (const Curve& curve : graph.curves) {
      if (curve.family == static_cast<int>(f)) subtract_curve(curve, rest);
    }
    unexplained_.push_back(std::move(rest));
  }
  is_subtracted_.assign(graph.curves.size(), 1);
  for (const MeasuredPoint& p : dense) {
    if (p.camera == graph.camera) dense_.push_back(p);
  }
  accept(std::exchange(runs, {}));
}

/// Adds runs to what is labelled.
void CameraMatching::accept(std::vector<LabeledRun> news) {
  for (const LabeledRun& run : news)
    named_.add(graph_.curves[static_cast<std::size_t>(run.curve)], run);
  not_on_surface_.insert(not_on_surface_.end(), news.begin(), news.end());
  runs_.insert(runs_.end(), news.begin(), news.end());
  std::sort(runs_.begin(), runs_.end(), [](const LabeledRun& a, const LabeledRun& b) {
    return std::tie(a.curve, a.begin) < std::tie(b.curve, b.begin);
  });
}

void CameraMatching::grow_surface() {
  Labeling labeling;
  labeling.runs.resize(rig_.cameras.size());
  labeling.runs[static_cast<std::size_t>(graph_.camera)] = std::exchange(not_on_surface_, {});
  TriangulationOptions options;
  // Floors and walls are surfaces like others here: their lines keep curves from names in the air
  // before them.
  options.keeps_background = true;
  options.used_of_seven = options_.surface.used_of_seven;
  std::vector<MeasuredPoint> points = triangulate(rig_, {&graph_, 1}, labeling, options);
  points.insert(points.end(), dense_.begin(), dense_.end());
  dense_.clear();
  surface_.add(points);
  shows_object_.resize(surface_.patches().size());
  for (std::size_t k = 0; k < shows_object_.size(); ++k) {
    const SurfacePatch& patch = surface_.patches()[k];
    if (surface_.refitted()[k] == 0 || !patch.exists()) continue;
    const double depth = 1 / static_cast<double>(patch.inverse_depth(patch.pixel));
    const Vec3 place = camera_.point_at_depth(patch.pixel.cast<double>(), depth);
    shows_object_[k] = space_.holds(place) ? 1 : 0;
    shows_background_ = shows_background_ || shows_object_[k] == 0;
  }
}

LocalSurface CameraMatching::take_surface() {
  grow_surface();
  return std::move(surface_);
}

void CameraMatching::predict() {
  grow_surface();
  // Those that became known lie where the surface grew.
  const auto is_old = [&](const PredictedPoint& p) { return surface_.refitted()[p.patch] != 0; };
  std::erase_if(missing_, is_old);
  std::erase_if(shown_, is_old);
  constexpr float kFarApart = 5;  // px; of denser lines more are missing by themselves
  const bool is_first = expected_.empty();
  expected_.resize(rig_.projectors.size());
  if (missing_.empty()) not_shown_by_ = named_.count();
  for (const PredictedPoint& p :
       predict_lines(rig_, camera_, surface_, patterns_, options_.prediction)) {
    const bool is_named = named_.show(p);
    (is_named ? shown_ : missing_).push_back(p);
    if (!is_first || p.spacing_px < kFarApart || shows_object_[p.patch] == 0) continue;
    ExpectedLines& of_projector = expected_[static_cast<std::size_t>(p.pattern.projector)];
    ++of_projector.points;
    of_projector.named += is_named ? 1 : 0;
  }
  missing_places_.set(missing_);
}

std::vector<std::vector<char>> CameraMatching::decided_points() const {
  std::vector<std::vector<char>> decided;
  for (const Curve& curve : graph_.curves) decided.emplace_back(curve.points.size(), 0);
  for (const LabeledRun& run : runs_) {
    for (int i = run.begin; i < run.end; ++i)
      decided[static_cast<std::size_t>(run.curve)][static_cast<std::size_t>(i)] = 1;
  }
  return decided;
}

void CameraMatching::confirm_tentative() {
  const auto decided = decided_points();
  std::vector<LabeledRun> confirmed;
  std::vector<char> agrees;
  for (const LabeledRun& run : tentative_) {
    if (run.label.confidence < static_cast<float>(options_.min_tentative)) continue;
    const Curve& curve = graph_.curves[static_cast<std::size_t>(run.curve)];
    const LineName name{run.label.pattern, run.label.line};
    agrees.clear();
    for (int i = run.begin; i < run.end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      agrees.push_back(decided[static_cast<std::size_t>(run.curve)][k] == 0 &&
                       missing_places_.lies_on(curve.points[k], name));
    }
    for_each_stretch(agrees, [&](int begin, int end) {
      if (agrees[static_cast<std::size_t>(begin)] != 0 && end - begin >= options_.min_points)
        confirmed.push_back(run_of(run.curve, run.begin + begin, run.begin + end, name));
    });
  }
  accept(std::move(confirmed));
}

/// True where the lines around support a name. On a dense surface the stretch's own colour may do
/// so instead: where all lines of a projector were missed, there are none around.
bool CameraMatching::is_supported(const Curve& curve, int begin, int end, const LineName& name,
                                  float margin) const {
  if (has_dense_ && margin > 0 && end - begin >= options_.min_adopted) return true;
  const auto first = curve.points.begin() + begin;
  const auto supported = std::count_if(first, first + (end - begin), [&](const CurvePoint& p) {
    return fits(p, name, curve.family);
  });
  return 2 * supported > end - begin;
}

/// True where a label puts a point of its curve where the object can be.
bool CameraMatching::is_of_object(const LabeledRun& run, int at) const {
  const LinePattern& pattern = rig_.pattern(run.label.pattern);
  const CurvePoint& p =
      graph_.curves[static_cast<std::size_t>(run.curve)].points[static_cast<std::size_t>(at)];
  const Vec2 pixel = p.position.cast<double>();
  const auto projector = static_cast<std::size_t>(run.label.pattern.projector);
  const auto depth = RayInProjector(camera_, rig_.projectors[projector], pixel)
                         .depth(pattern.position_px(run.label.line), pattern.axis);
  return !depth || space_.holds(camera_.point_at_depth(pixel, *depth));
}

/// True where the name of a stretch [begin, end) agrees with those of its curve before and after
/// it. Lines of the object end at a floor or wall; a surface that is wrong by whole lines makes
/// them go on along its curves. Both names then say what colour the stretch has.
bool CameraMatching::agrees_along(int curve, int begin, int end, const LineName& name) const {
  constexpr float kJump = 6;  // of a curve to another line, as for the joint solution (joint.cpp)
  const float certainty = std::log(options_.confidence / (1 - options_.confidence));
  const auto after = std::lower_bound(
      runs_.begin(), runs_.end(), std::pair(curve, begin),
      [](const LabeledRun& r, const auto& at) { return std::pair(r.curve, r.begin) < at; });
  const auto has_other = [&](const LabeledRun& run, int at) {
    const LineName other{run.label.pattern, run.label.line};
    return !(other == name) && !is_of_object(run, at) &&
           colors_.lead(graph_.curves[static_cast<std::size_t>(curve)], {begin, end}, name, other) <
               kJump - certainty;
  };
  if (after != runs_.end() && after->curve == curve && has_other(*after, after->begin))
    return false;
  return after == runs_.begin() || (after - 1)->curve != curve ||
         !has_other(*(after - 1), (after - 1)->end - 1);
}

/// A stretch [begin, end) on one line, within what is undecided of its curve.
bool CameraMatching::is_long_enough(const std::vector<char>& decided, int begin, int end) const {
  // Share of the undecided stretch that is most of it. Chosen; no fit of it is kept.
  constexpr double kMost = 0.8;
  const int n = static_cast<int>(decided.size());
  const int length = end - begin;
  // A dense surface says as much for a stretch as for a line that was not found at all.
  if (length >= (has_dense_ ? options_.min_points : options_.min_adopted)) return true;
  while (begin > 0 && decided[static_cast<std::size_t>(begin - 1)] == 0) --begin;
  while (end < n && decided[static_cast<std::size_t>(end)] == 0) ++end;
  return length >= options_.min_whole && length >= kMost * (end - begin);
}

void CameraMatching::adopt_curves() {
  const auto decided = decided_points();
  // A colour denies a name if it says more against it than a guided name is certain. A surface that
  // is not there predicts lines too: their places fit, their colours do not.
  const float certainty = std::log(options_.confidence / (1 - options_.confidence));
  const auto denies = [&](float margin, int points) {
    return margin < -certainty && has_dense_ && points >= options_.min_adopted;
  };
  std::vector<LabeledRun> adopted;
  std::vector<std::optional<LineName>> names;
  std::vector<float> spacings;
  denied_.clear();
  for (std::size_t c = 0; c < graph_.curves.size(); ++c) {
    const Curve& curve = graph_.curves[c];
    names.assign(curve.points.size(), std::nullopt);
    spacings.assign(curve.points.size(), 0.F);
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (decided[c][i] != 0) continue;
      const auto line = missing_places_.line_at(curve.points[i], curve.family);
      if (!line) continue;
      names[i] = line->name;
      spacings[i] = line->spacing_px;
    }
    for (const auto& [name, pieces] : pieces_of_names(names)) {
      // Pieces of a curve on which one line is predicted are that line, or another one, together.
      const float of_all = colors_.margin(curve, pieces, name);
      const bool are_denied = denies(of_all, points_of(pieces));
      for (const PointRange& piece : pieces) {
        const auto [begin, end] = piece;
        const float own = pieces.size() == 1 ? of_all : colors_.margin(curve, {piece}, name);
        const float margin = has_dense_ ? std::min(own, of_all) : own;
        if (are_denied || denies(own, end - begin))
          denied_.push_back({run_of(static_cast<int>(c), begin, end, name),
                             spacings[static_cast<std::size_t>((begin + end) / 2)]});
        if (margin > -certainty && is_long_enough(decided[c], begin, end) &&
            agrees_along(static_cast<int>(c), begin, end, name) &&
            is_supported(curve, begin, end, name, margin))
          adopted.push_back(run_of(static_cast<int>(c), begin, end, name));
      }
    }
  }
  accept(std::move(adopted));
}

bool CameraMatching::fits(const CurvePoint& point, const LineName& name, int family) const {
  if (point.sigma_px > options_.max_sigma_px) return false;
  const auto line = missing_places_.line_at(point, family);
  if (!line || line->name != name) return false;
  const auto around = named_.amplitude_around(point.position, name, line->spacing_px, 0, 1);
  return around && point.amplitude > options_.min_amplitude * *around;
}

/// Missing points that no curve shows by now, in chains.
std::vector<LineChain> CameraMatching::still_missing() {
  const std::size_t known = std::exchange(not_shown_by_, named_.count());
  std::erase_if(missing_, [&](const PredictedPoint& p) { return named_.show(p, known); });
  return chain_points(missing_);
}

void CameraMatching::name_shared() {
  News news;
  for (SharedCurve& shared : find_shared(camera_, families_, graph_.curves, still_missing(), named_,
                                         missing_places_, options_)) {
    const std::vector<char> all(shared.curve.points.size(), 1);
    add_good(std::move(shared.curve), all, shared.name, news);
  }
  append(std::move(news), false);
}

/// Names the good stretches of a curve, where they are long enough; a curve without one is none.
void CameraMatching::add_good(Curve curve, const std::vector<char>& good, const LineName& name,
                              News& news) const {
  const int index = static_cast<int>(graph_.curves.size() + news.curves.size());
  const std::size_t before = news.runs.size();
  for_each_stretch(good, [&](int begin, int end) {
    if (good[static_cast<std::size_t>(begin)] != 0 && end - begin >= options_.min_points)
      news.runs.push_back(run_of(index, begin, end, name));
  });
  if (news.runs.size() > before) news.curves.push_back(std::move(curve));
}

/// Names what is new on a fitted line: of stretches that are the line, and long enough with the
/// ends of curves that they continue, what these do not show.
template <class IsLine>
void CameraMatching::add_new(const Curve& curve, const ContinuedLine& line, IsLine is_line,
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
      const auto index = static_cast<int>(graph_.curves.size() + news.curves.size());
      news.curves.push_back({curve.family, {points + first, points + last}, {}});
      news.runs.push_back(run_of(index, 0, last - first, name));
    });
  });
}

/// Curves that no image showed by themselves. `hold_light`: that no other curve holds.
void CameraMatching::append(News news, bool hold_light) {
  is_subtracted_.resize(graph_.curves.size() + news.curves.size(), hold_light ? 1 : 0);
  for (Curve& curve : news.curves) {
    const auto family = static_cast<std::size_t>(curve.family);
    if (hold_light) subtract_curve(curve, unexplained_[family]);
    curve.code.assign(curve.points.size() * families_[family].colors.size(), 0.F);
    graph_.curves.push_back(std::move(curve));
    graph_.component_of_curve.push_back(-1);
    if (!graph_.identities.empty()) graph_.identities.emplace_back();
  }
  accept(std::move(news.runs));
}

/// A curve where a line is predicted, as wide as it would be there, and as high as lines around.
Curve CameraMatching::guess_of(const LineChain& chain) const {
  constexpr std::size_t kStep = 8;  // points; what counts as around reaches farther
  Curve curve;
  curve.family = family_of(families_, chain.front().pattern);
  float height = 0;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const PredictedPoint& p = chain[i];
    if (i % kStep == 0)
      height = named_.amplitude_around(p.position, name_of(p), p.spacing_px, 0, 1).value_or(0.F);
    CurvePoint point;
    point.position = p.position;
    point.normal = p.normal;
    point.width_px = missing_places_.expected_width(p);
    point.amplitude = height;
    curve.points.push_back(point);
  }
  return curve;
}

/// The points of curves that have no name.
Places<CurvePlace> CameraMatching::undecided_places() const {
  const auto decided = decided_points();
  Places<CurvePlace> places(camera_.width, camera_.height, 3);
  for (std::size_t c = 0; c < graph_.curves.size(); ++c) {
    const Curve& curve = graph_.curves[c];
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
      if (decided[c][i] == 0) places.add(curve.points[i].position, {c, i});
    }
  }
  return places;
}

/// True where a curve without a name may be of another line than the named one, on which it lies:
/// its colour says so, or it may be of a wall, whose lines have all colours.
bool CameraMatching::is_of_other(const CurvePlace& place, const LineName& name) const {
  const Curve& curve = graph_.curves[place.curve];
  const auto middle = static_cast<int>(place.point);
  const int begin = std::max(0, middle - kPointsPerMeasurement / 2);
  const int end =
      std::min(static_cast<int>(curve.points.size()), middle + kPointsPerMeasurement / 2 + 1);
  return shows_background_ || colors_.margin(curve, {PointRange{begin, end}}, name) < 0;
}

/// True where what the curves leave of the light may be left of a curve of another line, within
/// `reach` px of a point.
bool CameraMatching::is_rest_of_other(const CurvePoint& point, const LineName& name, float reach,
                                      const Places<CurvePlace>& undecided) const {
  const int family = family_of(families_, name.pattern);
  bool found = false;
  undecided.around(point.position, reach, [&](const CurvePlace& place) {
    const Curve& curve = graph_.curves[place.curve];
    const CurvePoint& other = curve.points[place.point];
    found = found || (curve.family == family &&
                      (other.position - point.position).squaredNorm() < reach * reach &&
                      PredictedPlaces::have_same_direction(other.normal, point.normal) &&
                      is_of_other(place, name));
  });
  return found;
}

void CameraMatching::find_missing() {
  if (unexplained_.empty()) return;
  const Places<CurvePlace> undecided = undecided_places();
  RefineOptions fitting;
  fitting.min_points = options_.min_points;
  const NamedEnds ends(camera_, graph_.curves, runs_, is_subtracted_);
  News news;
  for (const LineChain& chain : still_missing()) {
    // Where the surface is as it was, the line was not found before. Lines of floors and walls that
    // no curve shows give no curve a wrong name.
    const auto is_new = [&](const PredictedPoint& p) {
      return surface_.refitted()[p.patch] != 0 && shows_object_[p.patch] != 0;
    };
    if (std::none_of(chain.begin(), chain.end(), is_new)) continue;
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
      return p.amplitude >= least && fits(p, name, family) &&
             !is_rest_of_other(p, name, reach, undecided);
    };
    for (const Curve& end : line.ends) add_curve(end, image);
    for (const Curve& curve : fit_guess(image, line.curve, fitting))
      add_new(curve, line, is_line, name, news);
    for (const Curve& end : line.ends) subtract_curve(end, image);
  }
  append(std::move(news), true);
}

void CameraMatching::find_merged() {
  if (unexplained_.empty()) return;
  // Of the points beside named curves. A line that is there shows along most of them; what the
  // curves beside an unlit one leave is found here and there.
  constexpr double kMost = 0.5;
  const MergedLines merged(camera_, graph_.curves, runs_, is_subtracted_, shown_, unexplained_);
  News news;
  for (const LineChain& chain : still_missing()) {
    const auto is_of_object = [&](const PredictedPoint& p) { return shows_object_[p.patch] != 0; };
    if (static_cast<int>(chain.size()) < options_.min_points ||
        std::none_of(chain.begin(), chain.end(), is_of_object))
      continue;
    const LineName name = name_of(chain.front());
    MergedLines::Fit fit = merged.fit(guess_of(chain), name);
    std::vector<std::vector<char>> good;
    std::ptrdiff_t count = 0;
    for (const Curve& piece : fit.pieces) {
      good.emplace_back();
      for (const CurvePoint& p : piece.points) good.back().push_back(fits(p, name, piece.family));
      count += std::count(good.back().begin(), good.back().end(), 1);
    }
    if (static_cast<double>(count) < kMost * static_cast<double>(fit.beside)) continue;
    for (std::size_t k = 0; k < fit.pieces.size(); ++k)
      add_good(std::move(fit.pieces[k]), good[k], name, news);
  }
  // The curves beside them hold their light.
  append(std::move(news), false);
}

}  // namespace

std::vector<LocalSurface> match_guided(const Rig& rig, const std::vector<ColorFamily>& families,
                                       std::vector<std::vector<cv::Mat>> presence,
                                       std::span<GridGraph> graphs, Labeling& labeling,
                                       const GuidedMatchingOptions& options,
                                       std::span<const MeasuredPoint> dense) {
  std::vector<std::optional<LocalSurface>> surfaces(graphs.size());
  std::vector<std::vector<ExpectedLines>> expected(graphs.size());
  labeling.denied.assign(labeling.runs.size(), {});
  labeling.undecided.resize(labeling.runs.size());
  parallel_for(graphs.size(), [&](std::size_t g) {
    const auto camera = static_cast<std::size_t>(graphs[g].camera);
    CameraMatching look(rig, families, std::move(presence[g]), graphs[g], labeling.runs[camera],
                        labeling.tentative[camera], options, dense);
    for (int pass = 0; pass < options.passes; ++pass) {
      look.predict();
      look.confirm_tentative();
      look.adopt_curves();
      look.find_missing();
      if (!dense.empty()) {
        look.find_merged();
        look.name_shared();
      }
    }
    if (!look.denied().empty())
      drop_beside_denied(graphs[g], look.denied(), labeling.runs[camera],
                         labeling.undecided[camera]);
    labeling.denied[camera] = look.denied();
    expected[g] = look.expected();
    surfaces[g] = look.take_surface();
  });
  labeling.expected.assign(rig.projectors.size(), {});
  for (const std::vector<ExpectedLines>& of_camera : expected) {
    for (std::size_t p = 0; p < of_camera.size(); ++p) {
      labeling.expected[p].points += of_camera[p].points;
      labeling.expected[p].named += of_camera[p].named;
    }
  }
  std::vector<LocalSurface> result;
  for (auto& surface : surfaces) result.push_back(*std::move(surface));
  return result;
}

}  // namespace pencilscan
