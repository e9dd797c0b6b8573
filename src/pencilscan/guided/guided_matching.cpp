#include "pencilscan/guided/guided_matching.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stretches.h"
#include "pencilscan/detection/code_evidence.h"
#include "pencilscan/detection/curve_rendering.h"
#include "pencilscan/detection/profile_fit.h"
#include "pencilscan/detection/refine.h"
#include "pencilscan/guided/denied_lines.h"
#include "pencilscan/guided/line_chains.h"
#include "pencilscan/points/triangulate.h"
#include "pencilscan/rig/object_space.h"
#include "pencilscan/view/places.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;

constexpr int kPlaceCellPx = 8;         ///< px, of what is found by place
constexpr int kNearCellPx = 3;          ///< px, of what is looked for within a pixel or two
constexpr float kSameDirection = 0.9F;  ///< cosine between a curve and a predicted line

struct KnownPoint {
  Vector2f position;
  PatternRef pattern;
  int line;
  float amplitude;
};

struct LineName {
  PatternRef pattern;
  int line;
  friend bool operator==(const LineName&, const LineName&) = default;
};

struct NamedPlace {
  Vector2f position;
  LineName name;
};

struct ShownPoint {
  const CurvePoint* point;
  int family;
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
  /// Where colours denied a dense surface in the last pass.
  [[nodiscard]] const std::vector<DeniedRun>& denied() const { return denied_; }
  /// Per projector, since predict() was called first.
  [[nodiscard]] const std::vector<ExpectedLines>& expected() const { return expected_; }
  /// The surface of all that is labelled now.
  [[nodiscard]] LocalSurface take_surface();

 private:
  void accept(std::vector<LabeledRun> news);
  void append(std::vector<Curve> found);
  void grow_surface();
  [[nodiscard]] bool is_known(const PredictedPoint& p) const;
  template <class Visit>
  void aligned_predictions(const CurvePoint& point, Visit visit) const;
  [[nodiscard]] std::optional<LineName> line_at(const CurvePoint& point, int family,
                                                float* spacing_px = nullptr) const;
  [[nodiscard]] bool lies_on(const CurvePoint& point, const LineName& name) const;
  [[nodiscard]] bool fits(const CurvePoint& point, const LineName& name, int family) const;
  [[nodiscard]] bool is_near(float across_px, const PredictedPoint& p) const {
    return across_px < options_.max_offset_px &&
           across_px < options_.max_offset_lines * p.spacing_px;
  }
  [[nodiscard]] float support_reach(float spacing_px) const {
    return std::max(static_cast<float>(options_.support_px),
                    static_cast<float>(options_.support_lines) * spacing_px);
  }
  [[nodiscard]] float color_margin(const Curve& curve, int begin, int end,
                                   const LineName& name) const;
  [[nodiscard]] bool is_supported(const Curve& curve, int begin, int end, const LineName& name,
                                  float margin) const;
  [[nodiscard]] bool is_long_enough(const std::vector<char>& decided, int begin, int end) const;
  [[nodiscard]] std::vector<std::vector<char>> decided_points() const;
  [[nodiscard]] float expected_width(const PredictedPoint& p) const;
  [[nodiscard]] LabeledRun run_of(int curve, int begin, int end, const LineName& name) const {
    return {
        curve, begin, end,
        CurveLabel{name.pattern, name.line, static_cast<double>(name.line), options_.confidence}};
  }
  [[nodiscard]] std::optional<float> amplitude_around(const Vector2f& place, const LineName& name,
                                                      float spacing_px) const;
  [[nodiscard]] std::vector<LineName> others_at(const CurvePoint& point, int family,
                                                const LineName& name) const;
  [[nodiscard]] const CurvePoint* shown_at(const PredictedPoint& p, int family,
                                           const Places<ShownPoint>& shown) const;
  [[nodiscard]] bool is_lit_too(const CurvePoint& point, int family, const PredictedPoint& p) const;
  [[nodiscard]] Curve guess_of(const LineChain& chain) const;

  const Rig& rig_;
  const std::vector<ColorFamily>& families_;
  const Camera& camera_;
  GridGraph& graph_;
  std::vector<LabeledRun>& runs_;
  std::span<const LabeledRun> tentative_;
  const GuidedMatchingOptions& options_;
  std::vector<PatternRef> patterns_;  ///< that the camera can see
  std::vector<cv::Mat> unexplained_;  ///< per family; empty without images
  ObjectSpace space_;
  LocalSurface surface_;
  std::vector<char> shows_object_;          ///< per patch, 0: floors and walls
  bool has_dense_;                          ///< the surface does not rest on labels alone
  std::vector<MeasuredPoint> dense_;        ///< more points, not on the surface yet
  std::vector<LabeledRun> not_on_surface_;  ///< runs whose points it does not hold yet
  Places<KnownPoint> known_;
  Places<NamedPlace> known_names_;       ///< of the same points
  std::vector<PredictedPoint> missing_;  ///< predicted points that no label explains
  Places<PredictedPoint> missing_places_;
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
      camera_(rig.camera(graph.camera)),
      graph_(graph),
      runs_(runs),
      tentative_(tentative),
      options_(options),
      space_(rig),
      surface_(camera_, options.surface),
      has_dense_(!dense.empty()),
      known_(camera_.width, camera_.height, kPlaceCellPx),
      known_names_(camera_.width, camera_.height, kNearCellPx),
      missing_places_(camera_.width, camera_.height, kNearCellPx) {
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
  for (const MeasuredPoint& p : dense) {
    if (p.camera == graph.camera) dense_.push_back(p);
  }
  accept(std::exchange(runs, {}));
}

/// Width of the profile of a predicted line, px.
float CameraMatching::expected_width(const PredictedPoint& p) const {
  const LinePattern& pattern = rig_.pattern(p.pattern);
  return line_profile_width(p.spacing_px *
                            static_cast<float>(pattern.line_width_px / pattern.pitch_px));
}

/// Adds runs to what is labelled.
void CameraMatching::accept(std::vector<LabeledRun> news) {
  for (const LabeledRun& run : news) {
    const Curve& curve = graph_.curves[static_cast<std::size_t>(run.curve)];
    for (int i = run.begin; i < run.end; ++i) {
      const CurvePoint& p = curve.points[static_cast<std::size_t>(i)];
      known_.add(p.position, {p.position, run.label.pattern, run.label.line, p.amplitude});
      known_names_.add(p.position, {p.position, {run.label.pattern, run.label.line}});
    }
  }
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
  }
}

LocalSurface CameraMatching::take_surface() {
  grow_surface();
  return std::move(surface_);
}

bool CameraMatching::is_known(const PredictedPoint& p) const {
  constexpr float kSame = 1.5F;  // px
  bool found = false;
  known_names_.around(p.position, kSame, [&](const NamedPlace& k) {
    found = found || (k.name.line == p.line && k.name.pattern == p.pattern &&
                      (k.position - p.position).squaredNorm() < kSame * kSame);
  });
  return found;
}

void CameraMatching::predict() {
  grow_surface();
  // Those that became known lie where the surface grew.
  std::erase_if(missing_,
                [&](const PredictedPoint& p) { return surface_.refitted()[p.patch] != 0; });
  constexpr float kFarApart = 5;  // px; of denser lines more are missing by themselves
  const bool is_first = expected_.empty();
  expected_.resize(rig_.projectors.size());
  for (const PredictedPoint& p :
       predict_lines(rig_, camera_, surface_, patterns_, options_.prediction)) {
    const bool is_named = is_known(p);
    if (!is_named) missing_.push_back(p);
    if (!is_first || p.spacing_px < kFarApart || shows_object_[p.patch] == 0) continue;
    ExpectedLines& of_projector = expected_[static_cast<std::size_t>(p.pattern.projector)];
    ++of_projector.points;
    of_projector.named += is_named ? 1 : 0;
  }
  missing_places_.clear();
  for (const PredictedPoint& p : missing_) missing_places_.add(p.position, p);
}

/// Calls visit(predicted, across_px) for missing points beside a curve point. Their lines have its
/// direction and are not much thinner: a curve that is wider than a line shows another line, or
/// two.
template <class Visit>
void CameraMatching::aligned_predictions(const CurvePoint& point, Visit visit) const {
  constexpr float kAlong = 1.5F;  // px
  constexpr float kWidest = 1.2F;
  const float across = 2 * static_cast<float>(options_.max_offset_px);  // what line_at() looks at
  missing_places_.around(point.position, std::hypot(across, kAlong), [&](const PredictedPoint& p) {
    const Vector2f way = point.position - p.position;
    const float along = std::abs(way.x() * p.normal.y() - way.y() * p.normal.x());
    if (along > kAlong || std::abs(p.normal.dot(point.normal)) < kSameDirection ||
        point.width_px > kWidest * expected_width(p))
      return;
    visit(p, std::abs(way.dot(p.normal)));
  });
}

std::optional<LineName> CameraMatching::line_at(const CurvePoint& point, int family,
                                                float* spacing_px) const {
  constexpr float kClear = 0.8F;  // px that another line must be farther away
  // Of each line the point that is nearest across it; a line's farther points say nothing.
  struct Candidate {
    LineName name;
    float across = 0;
    bool is_near = false;
    float spacing_px = 0;
  };
  std::vector<Candidate> candidates;
  aligned_predictions(point, [&](const PredictedPoint& p, float across) {
    if (across > 2 * options_.max_offset_px || family_of(families_, p.pattern) != family) return;
    const Candidate candidate{{p.pattern, p.line}, across, is_near(across, p), p.spacing_px};
    const auto known = std::find_if(candidates.begin(), candidates.end(),
                                    [&](const Candidate& c) { return c.name == candidate.name; });
    if (known == candidates.end()) {
      candidates.push_back(candidate);
    } else if (across < known->across) {
      *known = candidate;
    }
  });
  const auto nearer = [](const Candidate& a, const Candidate& b) { return a.across < b.across; };
  const auto best = std::min_element(candidates.begin(), candidates.end(), nearer);
  if (best == candidates.end() || !best->is_near) return std::nullopt;
  for (auto other = candidates.begin(); other != candidates.end(); ++other) {
    if (other != best && other->across < best->across + kClear) return std::nullopt;
  }
  if (spacing_px != nullptr) *spacing_px = best->spacing_px;
  return best->name;
}

bool CameraMatching::lies_on(const CurvePoint& point, const LineName& name) const {
  bool found = false;
  aligned_predictions(point, [&](const PredictedPoint& p, float across) {
    found = found || (p.line == name.line && p.pattern == name.pattern && is_near(across, p));
  });
  return found;
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
                       lies_on(curve.points[k], name));
    }
    for_each_stretch(agrees, [&](int begin, int end) {
      if (agrees[static_cast<std::size_t>(begin)] != 0 && end - begin >= options_.min_points)
        confirmed.push_back(run_of(run.curve, run.begin + begin, run.begin + end, name));
    });
  }
  accept(std::move(confirmed));
}

/// Logarithm of how much likelier the colour of a stretch [begin, end) is under a name than under
/// the likeliest other colour; 0 where the family has one colour.
float CameraMatching::color_margin(const Curve& curve, int begin, int end,
                                   const LineName& name) const {
  const auto family = static_cast<std::size_t>(curve.family);
  const LinePattern& pattern = rig_.pattern(name.pattern);
  const auto own = static_cast<std::size_t>(families_[family].color_of_symbol(
      pattern)[static_cast<std::size_t>(pattern.symbol(name.line))]);
  std::vector<float> evidence = color_evidence(curve, begin, end, families_[family].colors.size());
  std::swap(evidence[own], evidence.back());
  const float of_name = evidence.back();
  evidence.pop_back();
  return evidence.empty() ? 0 : of_name - *std::max_element(evidence.begin(), evidence.end());
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
  std::vector<LabeledRun> adopted;
  std::vector<std::optional<LineName>> names;
  std::vector<float> spacings;
  denied_.clear();
  for (std::size_t c = 0; c < graph_.curves.size(); ++c) {
    const Curve& curve = graph_.curves[c];
    names.assign(curve.points.size(), std::nullopt);
    spacings.assign(curve.points.size(), 0.F);
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (decided[c][i] == 0) names[i] = line_at(curve.points[i], curve.family, &spacings[i]);
    }
    for_each_stretch(names, [&](int begin, int end) {
      const auto& name = names[static_cast<std::size_t>(begin)];
      if (!name || !is_long_enough(decided[c], begin, end)) return;
      const float margin = color_margin(curve, begin, end, *name);
      if (margin < -certainty && has_dense_ && end - begin >= options_.min_adopted)
        denied_.push_back({run_of(static_cast<int>(c), begin, end, *name),
                           spacings[static_cast<std::size_t>((begin + end) / 2)]});
      if (margin > -certainty && is_supported(curve, begin, end, *name, margin))
        adopted.push_back(run_of(static_cast<int>(c), begin, end, *name));
    });
  }
  accept(std::move(adopted));
}

bool CameraMatching::fits(const CurvePoint& point, const LineName& name, int family) const {
  if (point.sigma_px > options_.max_sigma_px) return false;
  float spacing = 0;
  if (line_at(point, family, &spacing) != name) return false;
  std::vector<float> around;
  const float reach = support_reach(spacing);
  known_.around(point.position, reach, [&](const KnownPoint& k) {
    if (k.pattern == name.pattern && std::abs(k.line - name.line) <= 1 &&
        (k.position - point.position).squaredNorm() < reach * reach)
      around.push_back(k.amplitude);
  });
  if (static_cast<int>(around.size()) < options_.min_support) return false;
  return point.amplitude > options_.min_amplitude * upper_median(std::move(around));
}

/// Amplitude of the two lines to either side of a named one, around a place; nothing where too few
/// are known.
std::optional<float> CameraMatching::amplitude_around(const Vector2f& place, const LineName& name,
                                                      float spacing_px) const {
  std::vector<float> around;
  constexpr int kLines = 2;
  const float reach = kLines * support_reach(spacing_px);
  known_.around(place, reach, [&](const KnownPoint& k) {
    const int lines = std::abs(k.line - name.line);
    if (k.pattern == name.pattern && lines > 0 && lines <= kLines &&
        (k.position - place).squaredNorm() < reach * reach)
      around.push_back(k.amplitude);
  });
  if (static_cast<int>(around.size()) < options_.min_support) return std::nullopt;
  return upper_median(std::move(around));
}

/// Lines of other patterns of the family at a point of a curve, named or predicted.
std::vector<LineName> CameraMatching::others_at(const CurvePoint& point, int family,
                                                const LineName& name) const {
  std::vector<LineName> others;
  const auto add = [&](const LineName& other) {
    if (other.pattern != name.pattern && family_of(families_, other.pattern) == family &&
        std::find(others.begin(), others.end(), other) == others.end())
      others.push_back(other);
  };
  const auto reach = static_cast<float>(options_.max_offset_px);
  known_names_.around(point.position, reach, [&](const NamedPlace& k) {
    if ((k.position - point.position).squaredNorm() < reach * reach) add(k.name);
  });
  aligned_predictions(point, [&](const PredictedPoint& p, float across) {
    if (is_near(across, p)) add({p.pattern, p.line});
  });
  return others;
}

/// The nearest point of a curve of the family on a predicted line; nullptr: none.
const CurvePoint* CameraMatching::shown_at(const PredictedPoint& p, int family,
                                           const Places<ShownPoint>& shown) const {
  const auto reach = static_cast<float>(options_.max_offset_px);
  float best = reach * reach;
  const CurvePoint* nearest = nullptr;
  shown.around(p.position, reach, [&](const ShownPoint& s) {
    const float apart2 = (s.point->position - p.position).squaredNorm();
    if (s.family != family || apart2 >= best || !is_near(std::sqrt(apart2), p) ||
        s.point->sigma_px > options_.max_sigma_px ||
        std::abs(s.point->normal.dot(p.normal)) < kSameDirection)
      return;
    best = apart2;
    nearest = s.point;
  });
  return nearest;
}

/// True where a point of a curve, which lines of other patterns explain as well, is as bright as if
/// a predicted line lay there too.
bool CameraMatching::is_lit_too(const CurvePoint& point, int family,
                                const PredictedPoint& p) const {
  // Share of its light that must be there. A half would weigh both answers alike; but nine in ten
  // predicted lines are there, and lines differ from those beside them by a third: 1/2 - ln 9 /
  // 3^2.
  constexpr float kLeastOwn = 0.25F;
  const LineName name{p.pattern, p.line};
  const auto own = amplitude_around(point.position, name, p.spacing_px);
  if (!own) return false;
  const std::vector<LineName> others = others_at(point, family, name);
  float rest = point.amplitude;
  for (const LineName& other : others) {
    const auto of_other = amplitude_around(point.position, other, p.spacing_px);
    if (!of_other) return false;
    rest -= *of_other;
  }
  return !others.empty() && rest > kLeastOwn * *own;
}

/// Lines of two projectors with like colours that meet within a pixel or so make one curve, which
/// has one name or none. What the lines beside it tell is whether the light of both is in it.
void CameraMatching::name_shared() {
  Places<ShownPoint> shown(camera_.width, camera_.height, kNearCellPx);
  for (const Curve& curve : graph_.curves) {
    for (const CurvePoint& p : curve.points) shown.add(p.position, {&p, curve.family});
  }
  std::erase_if(missing_, [&](const PredictedPoint& p) { return is_known(p); });
  std::vector<LabeledRun> labeled;
  std::vector<Curve> found;
  for (const LineChain& chain : chain_points(missing_)) {
    const LineName name{chain.front().pattern, chain.front().line};
    const int family = family_of(families_, name.pattern);
    std::vector<CurvePoint> points(chain.size());
    std::vector<char> is_lit(chain.size(), 0);
    for (std::size_t i = 0; i < chain.size(); ++i) {
      const CurvePoint* point = shown_at(chain[i], family, shown);
      if (point == nullptr || !is_lit_too(*point, family, chain[i])) continue;
      is_lit[i] = 1;
      points[i] = *point;
      points[i].sigma_px =
          std::hypot(point->sigma_px, (point->position - chain[i].position).norm());
    }
    for_each_stretch(is_lit, [&](int begin, int end) {
      if (is_lit[static_cast<std::size_t>(begin)] == 0 || end - begin < options_.min_points) return;
      const int index = static_cast<int>(graph_.curves.size() + found.size());
      labeled.push_back(run_of(index, 0, end - begin, name));
      Curve& curve = found.emplace_back();
      curve.family = family;
      curve.points.assign(points.begin() + begin, points.begin() + end);
    });
  }
  append(std::move(found));
  accept(std::move(labeled));
}

/// Curves that no image showed by themselves.
void CameraMatching::append(std::vector<Curve> found) {
  for (Curve& curve : found) {
    const auto family = static_cast<std::size_t>(curve.family);
    curve.code.assign(curve.points.size() * families_[family].colors.size(), 0.F);
    graph_.curves.push_back(std::move(curve));
    graph_.component_of_curve.push_back(-1);
    if (!graph_.identities.empty()) graph_.identities.emplace_back();
  }
}

/// A curve where a line is predicted, as wide as it would be there.
Curve CameraMatching::guess_of(const LineChain& chain) const {
  Curve curve;
  curve.family = family_of(families_, chain.front().pattern);
  for (const PredictedPoint& p : chain) {
    CurvePoint point;
    point.position = p.position;
    point.normal = p.normal;
    point.width_px = expected_width(p);
    curve.points.push_back(point);
  }
  return curve;
}

void CameraMatching::find_missing() {
  if (unexplained_.empty()) return;
  RefineOptions fitting;
  fitting.min_points = options_.min_points;
  std::erase_if(missing_, [&](const PredictedPoint& p) { return is_known(p); });
  std::vector<LabeledRun> labeled;
  std::vector<Curve> found;
  for (const LineChain& chain : chain_points(missing_)) {
    // Where the surface is as it was, the line was not found before. Lines of floors and walls that
    // no curve shows give no curve a wrong name.
    const auto is_new = [&](const PredictedPoint& p) {
      return surface_.refitted()[p.patch] != 0 && shows_object_[p.patch] != 0;
    };
    if (static_cast<int>(chain.size()) < options_.min_points ||
        std::none_of(chain.begin(), chain.end(), is_new))
      continue;
    const LineName name{chain.front().pattern, chain.front().line};
    Curve guess = guess_of(chain);
    const int family = guess.family;
    const cv::Mat& image = unexplained_[static_cast<std::size_t>(family)];
    for (Curve& curve : fit_guess(image, std::move(guess), fitting)) {
      std::vector<char> good;
      for (const CurvePoint& p : curve.points) good.push_back(fits(p, name, family));
      const int index = static_cast<int>(graph_.curves.size() + found.size());
      bool any = false;
      for_each_stretch(good, [&](int begin, int end) {
        if (good[static_cast<std::size_t>(begin)] == 0 || end - begin < options_.min_points) return;
        labeled.push_back(run_of(index, begin, end, name));
        any = true;
      });
      if (any) found.push_back(std::move(curve));
    }
  }
  for (const Curve& curve : found)
    subtract_curve(curve, unexplained_[static_cast<std::size_t>(curve.family)]);
  append(std::move(found));
  accept(std::move(labeled));
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
      if (!dense.empty()) look.name_shared();
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
