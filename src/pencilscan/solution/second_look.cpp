#include "pencilscan/solution/second_look.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

#include "pencilscan/core/parallel.h"
#include "pencilscan/detection/profile_fit.h"
#include "pencilscan/detection/refine.h"
#include "pencilscan/solution/triangulate.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;

/// Things at places of an image, found by place.
template <class Thing>
class Places {
 public:
  Places(int width, int height)
      : columns_(width / kCell + 1),
        rows_(height / kCell + 1),
        cells_(static_cast<std::size_t>(columns_ * rows_)) {}
  void add(const Vector2f& at, const Thing& thing) {
    cells_[index(column(at.x()), row(at.y()))].push_back(thing);
  }
  /// visit(thing) for all within `reach` px, and some farther away.
  template <class Visit>
  void around(const Vector2f& at, float reach, Visit visit) const {
    for (int y = row(at.y() - reach); y <= row(at.y() + reach); ++y) {
      for (int x = column(at.x() - reach); x <= column(at.x() + reach); ++x) {
        for (const Thing& thing : cells_[index(x, y)]) visit(thing);
      }
    }
  }

 private:
  static constexpr int kCell = 8;
  [[nodiscard]] int column(float x) const {
    return std::clamp(static_cast<int>(x) / kCell, 0, columns_ - 1);
  }
  [[nodiscard]] int row(float y) const {
    return std::clamp(static_cast<int>(y) / kCell, 0, rows_ - 1);
  }
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y * columns_ + x);
  }
  int columns_;
  int rows_;
  std::vector<std::vector<Thing>> cells_;
};

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

/// One camera's second look.
class CameraLook {
 public:
  CameraLook(const Rig& rig, const std::vector<ColorFamily>& families, GridGraph& graph,
             std::vector<LabeledRun>& runs, std::span<const LabeledRun> tentative,
             const SecondLookOptions& options)
      : rig_(rig),
        families_(families),
        camera_(rig.cameras[static_cast<std::size_t>(graph.camera)]),
        graph_(graph),
        runs_(runs),
        tentative_(tentative),
        options_(options),
        surface_(camera_, options.surface) {
    for (const ColorFamily& family : families) {
      for (const PatternRef& ref : family.patterns) {
        if (can_see_pattern(rig, camera_, ref.projector)) patterns_.push_back(ref);
      }
    }
  }

  /// Predicts all lines on the surface of what is labelled; keeps those that no labelled point
  /// shows.
  void predict();
  /// Confirms tentative labels where the predicted line is the same.
  void confirm_tentative();
  /// Gives undecided stretches of curves the predicted line they lie on.
  void adopt_curves();
  /// Fits what is still missing to the presence images.
  void find_missing(const std::vector<cv::Mat>& presence);

 private:
  void index_known_points();
  [[nodiscard]] bool is_known(const PredictedPoint& p) const;
  [[nodiscard]] std::optional<LineName> line_at(const CurvePoint& point, int family,
                                                float* spacing_px = nullptr) const;
  [[nodiscard]] std::vector<Curve> chains_of_missing(std::vector<LineName>& names) const;
  [[nodiscard]] bool fits(const CurvePoint& point, const LineName& name, int family) const;
  [[nodiscard]] bool is_near(float across_px, const PredictedPoint& p) const {
    return across_px < options_.max_offset_px &&
           across_px < options_.max_offset_lines * p.spacing_px;
  }
  [[nodiscard]] bool is_long_enough(const std::vector<char>& decided, int begin, int end) const;
  [[nodiscard]] bool lies_on(const CurvePoint& point, const LineName& name) const;
  [[nodiscard]] std::vector<std::vector<char>> decided_points() const;
  [[nodiscard]] int family_of(PatternRef ref) const;
  [[nodiscard]] std::vector<MeasuredPoint> newly_labeled_points();
  void sort_runs();

  const Rig& rig_;
  const std::vector<ColorFamily>& families_;
  const Camera& camera_;
  GridGraph& graph_;
  std::vector<LabeledRun>& runs_;
  std::span<const LabeledRun> tentative_;
  const SecondLookOptions& options_;
  std::vector<PatternRef> patterns_;  ///< that the camera can see
  LocalSurface surface_;
  std::vector<LabeledRun> triangulated_;  ///< whose points the surface holds
  std::vector<PredictedPoint> predicted_;
  std::optional<Places<KnownPoint>> known_;
  std::vector<PredictedPoint> missing_;
  std::optional<Places<PredictedPoint>> missing_places_;
};

int CameraLook::family_of(PatternRef ref) const {
  for (std::size_t f = 0; f < families_.size(); ++f) {
    const auto& patterns = families_[f].patterns;
    if (std::find(patterns.begin(), patterns.end(), ref) != patterns.end())
      return static_cast<int>(f);
  }
  return -1;
}

bool is_before(const LabeledRun& a, const LabeledRun& b) {
  return std::tie(a.curve, a.begin) < std::tie(b.curve, b.begin);
}

void CameraLook::sort_runs() { std::sort(runs_.begin(), runs_.end(), is_before); }

void CameraLook::index_known_points() {
  known_.emplace(camera_.width, camera_.height);
  for (const LabeledRun& run : runs_) {
    const Curve& curve = graph_.curves[static_cast<std::size_t>(run.curve)];
    for (int i = run.begin; i < run.end; ++i) {
      const CurvePoint& p = curve.points[static_cast<std::size_t>(i)];
      known_->add(p.position, {p.position, run.label.pattern, run.label.line, p.amplitude});
    }
  }
}

bool CameraLook::is_known(const PredictedPoint& p) const {
  constexpr float kSame = 1.5F;  // px
  bool found = false;
  known_->around(p.position, kSame, [&](const KnownPoint& k) {
    found = found || (k.line == p.line && k.pattern == p.pattern &&
                      (k.position - p.position).squaredNorm() < kSame * kSame);
  });
  return found;
}

void CameraLook::predict() {
  surface_.add(newly_labeled_points());
  std::erase_if(predicted_,
                [&](const PredictedPoint& p) { return surface_.refitted()[p.patch] != 0; });
  const auto news = predict_lines(rig_, camera_, surface_, patterns_, options_.prediction);
  predicted_.insert(predicted_.end(), news.begin(), news.end());
  index_known_points();
  missing_.clear();
  missing_places_.emplace(camera_.width, camera_.height);
  for (const PredictedPoint& p : predicted_) {
    if (is_known(p)) continue;
    missing_.push_back(p);
    missing_places_->add(p.position, p);
  }
}

std::vector<MeasuredPoint> CameraLook::newly_labeled_points() {
  Labeling labeling;
  labeling.runs.resize(rig_.cameras.size());
  auto& runs = labeling.runs[static_cast<std::size_t>(graph_.camera)];
  std::set_difference(runs_.begin(), runs_.end(), triangulated_.begin(), triangulated_.end(),
                      std::back_inserter(runs), is_before);
  triangulated_ = runs_;
  return triangulate(rig_, {&graph_, 1}, labeling);
}

std::optional<LineName> CameraLook::line_at(const CurvePoint& point, int family,
                                            float* spacing_px) const {
  constexpr float kAlong = 1.5F;  // px
  constexpr float kSameDirection = 0.9F;
  constexpr float kClear = 0.8F;  // px that another line must be farther away
  float best = 1e9F;
  float second = 1e9F;
  std::optional<LineName> name;
  missing_places_->around(point.position, 3, [&](const PredictedPoint& p) {
    const Vector2f way = point.position - p.position;
    const float across = std::abs(way.dot(p.normal));
    const float along = std::abs(way.x() * p.normal.y() - way.y() * p.normal.x());
    if (along > kAlong || std::abs(p.normal.dot(point.normal)) < kSameDirection) return;
    if (across > 2 * options_.max_offset_px || family_of(p.pattern) != family) return;
    const LineName candidate{p.pattern, p.line};
    if (name == candidate) {
      best = std::min(best, across);
    } else if (across < best) {
      second = best;
      best = across;
      if (spacing_px != nullptr) *spacing_px = p.spacing_px;
      name = is_near(across, p) ? std::optional(candidate) : std::nullopt;
    } else {
      second = std::min(second, across);
    }
  });
  if (second < best + kClear) return std::nullopt;
  return name;
}

bool CameraLook::lies_on(const CurvePoint& point, const LineName& name) const {
  constexpr float kAlong = 1.5F;  // px
  constexpr float kSameDirection = 0.9F;
  bool found = false;
  missing_places_->around(point.position, 3, [&](const PredictedPoint& p) {
    if (found || p.line != name.line || !(p.pattern == name.pattern)) return;
    const Vector2f way = point.position - p.position;
    const float across = std::abs(way.dot(p.normal));
    const float along = std::abs(way.x() * p.normal.y() - way.y() * p.normal.x());
    found = along < kAlong && std::abs(p.normal.dot(point.normal)) > kSameDirection &&
            is_near(across, p);
  });
  return found;
}

std::vector<std::vector<char>> CameraLook::decided_points() const {
  std::vector<std::vector<char>> decided;
  for (const Curve& curve : graph_.curves) decided.emplace_back(curve.points.size(), 0);
  for (const LabeledRun& run : runs_) {
    for (int i = run.begin; i < run.end; ++i)
      decided[static_cast<std::size_t>(run.curve)][static_cast<std::size_t>(i)] = 1;
  }
  return decided;
}

void CameraLook::confirm_tentative() {
  const auto decided = decided_points();
  for (const LabeledRun& run : tentative_) {
    if (run.label.confidence < static_cast<float>(options_.min_tentative)) continue;
    const Curve& curve = graph_.curves[static_cast<std::size_t>(run.curve)];
    const LineName name{run.label.pattern, run.label.line};
    const auto agrees = [&](int i) {
      const auto k = static_cast<std::size_t>(i);
      return decided[static_cast<std::size_t>(run.curve)][k] == 0 && lies_on(curve.points[k], name);
    };
    for (int begin = run.begin; begin < run.end; ++begin) {
      int end = begin;
      while (end < run.end && agrees(end)) ++end;
      if (end - begin >= options_.min_points) {
        runs_.push_back({run.curve, begin, end, run.label});
        runs_.back().label.confidence = options_.confidence;
      }
      begin = end;
    }
  }
  sort_runs();
}

/// A stretch [begin, end) on one line, within what is undecided of its curve.
bool CameraLook::is_long_enough(const std::vector<char>& decided, int begin, int end) const {
  constexpr double kMost = 0.8;
  const int n = static_cast<int>(decided.size());
  const int length = end - begin;
  if (length >= options_.min_adopted) return true;
  while (begin > 0 && decided[static_cast<std::size_t>(begin - 1)] == 0) --begin;
  while (end < n && decided[static_cast<std::size_t>(end)] == 0) ++end;
  return length >= options_.min_whole && length >= kMost * (end - begin);
}

void CameraLook::adopt_curves() {
  const auto decided = decided_points();
  for (std::size_t c = 0; c < graph_.curves.size(); ++c) {
    const Curve& curve = graph_.curves[c];
    const int n = static_cast<int>(curve.points.size());
    std::vector<std::optional<LineName>> names(curve.points.size());
    for (int i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (decided[c][k] == 0) names[k] = line_at(curve.points[k], curve.family);
    }
    for (int begin = 0; begin < n;) {
      int end = begin + 1;
      const auto& name = names[static_cast<std::size_t>(begin)];
      while (end < n && names[static_cast<std::size_t>(end)] == name) ++end;
      int supported = 0;
      for (int i = begin; name && i < end; ++i)
        supported += fits(curve.points[static_cast<std::size_t>(i)], *name, curve.family) ? 1 : 0;
      if (name && 2 * supported > end - begin && is_long_enough(decided[c], begin, end)) {
        runs_.push_back({static_cast<int>(c), begin, end,
                         CurveLabel{name->pattern, name->line, static_cast<double>(name->line),
                                    options_.confidence}});
      }
      begin = end;
    }
  }
  sort_runs();
}

/// Missing points of one line, linked to neighbours up to 2.5 px away.
std::vector<Curve> CameraLook::chains_of_missing(std::vector<LineName>& names) const {
  constexpr float kLink2 = 2.5F * 2.5F;
  std::map<std::tuple<int, int, int>, std::vector<const PredictedPoint*>> lines;
  for (const PredictedPoint& p : missing_) {
    if (!is_known(p)) lines[{p.pattern.projector, p.pattern.pattern, p.line}].push_back(&p);
  }
  std::vector<Curve> chains;
  for (auto& [key, points] : lines) {
    std::vector<char> used(points.size(), 0);
    const auto nearest = [&](const Vector2f& at, const Vector2f& ahead) -> int {
      float best = kLink2;
      int found = -1;
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Vector2f way = points[i]->position - at;
        if (used[i] != 0 || way.squaredNorm() >= best || way.dot(ahead) <= 0) continue;
        best = way.squaredNorm();
        found = static_cast<int>(i);
      }
      return found;
    };
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (used[i] != 0) continue;
      used[i] = 1;
      std::vector<const PredictedPoint*> chain = {points[i]};
      for (const float direction : {1.F, -1.F}) {
        const PredictedPoint* end = points[i];
        for (;;) {
          const Vector2f ahead = direction * Vector2f(-end->normal.y(), end->normal.x());
          const int next = nearest(end->position, ahead);
          if (next < 0) break;
          used[static_cast<std::size_t>(next)] = 1;
          end = points[static_cast<std::size_t>(next)];
          chain.push_back(end);
        }
        std::reverse(chain.begin(), chain.end());
      }
      if (static_cast<int>(chain.size()) < options_.min_points) continue;
      const auto is_new = [&](const PredictedPoint* p) { return surface_.refitted()[p->patch] != 0; };
      if (std::none_of(chain.begin(), chain.end(), is_new)) continue;
      const PatternRef ref = chain[0]->pattern;
      const LinePattern& pattern = rig_.projectors[static_cast<std::size_t>(ref.projector)]
                                       .patterns[static_cast<std::size_t>(ref.pattern)];
      Curve curve;
      curve.family = family_of(ref);
      for (const PredictedPoint* p : chain) {
        CurvePoint point;
        point.position = p->position;
        point.normal = p->normal;
        point.width_px = line_profile_width(
            p->spacing_px * static_cast<float>(pattern.line_width_px / pattern.pitch_px));
        curve.points.push_back(point);
      }
      chains.push_back(std::move(curve));
      names.push_back({ref, chain[0]->line});
    }
  }
  return chains;
}

bool CameraLook::fits(const CurvePoint& point, const LineName& name, int family) const {
  if (point.sigma_px > options_.max_sigma_px) return false;
  float spacing = 0;
  if (line_at(point, family, &spacing) != name) return false;
  std::vector<float> around;
  const float reach = std::max(static_cast<float>(options_.support_px),
                               static_cast<float>(options_.support_lines) * spacing);
  known_->around(point.position, reach, [&](const KnownPoint& k) {
    if (k.pattern == name.pattern && std::abs(k.line - name.line) <= 1 &&
        (k.position - point.position).squaredNorm() < reach * reach)
      around.push_back(k.amplitude);
  });
  if (static_cast<int>(around.size()) < options_.min_support) return false;
  const auto middle = around.begin() + static_cast<std::ptrdiff_t>(around.size() / 2);
  std::nth_element(around.begin(), middle, around.end());
  return point.amplitude > options_.min_amplitude * *middle;
}

void CameraLook::find_missing(const std::vector<cv::Mat>& presence) {
  index_known_points();
  RefineOptions fitting;
  fitting.min_points = options_.min_points;
  std::vector<LineName> names;
  const std::vector<Curve> guesses = chains_of_missing(names);
  for (std::size_t f = 0; f < families_.size(); ++f) {
    std::vector<Curve> known;
    for (const Curve& curve : graph_.curves) {
      if (curve.family == static_cast<int>(f)) known.push_back(curve);
    }
    std::vector<Curve> wanted;
    std::vector<LineName> wanted_names;
    for (std::size_t i = 0; i < guesses.size(); ++i) {
      if (guesses[i].family != static_cast<int>(f)) continue;
      wanted.push_back(guesses[i]);
      wanted_names.push_back(names[i]);
    }
    for (GuidedCurve& found : fit_guesses(presence[f], known, std::move(wanted), fitting)) {
      const LineName& name = wanted_names[static_cast<std::size_t>(found.guess)];
      Curve& curve = found.curve;
      const int n = static_cast<int>(curve.points.size());
      std::vector<char> good;
      for (const CurvePoint& p : curve.points) {
        good.push_back(fits(p, name, static_cast<int>(f)) ? 1 : 0);
      }
      const int index = static_cast<int>(graph_.curves.size());
      bool any = false;
      for (int begin = 0; begin < n;) {
        int end = begin + 1;
        while (end < n &&
               good[static_cast<std::size_t>(end)] == good[static_cast<std::size_t>(begin)])
          ++end;
        if (good[static_cast<std::size_t>(begin)] != 0 && end - begin >= options_.min_points) {
          runs_.push_back({index, begin, end,
                           CurveLabel{name.pattern, name.line, static_cast<double>(name.line),
                                      options_.confidence}});
          any = true;
        }
        begin = end;
      }
      if (!any) continue;
      curve.code.assign(curve.points.size() * families_[f].colors.size(), 0.F);
      graph_.curves.push_back(std::move(curve));
      graph_.component_of_curve.push_back(-1);
      if (!graph_.identities.empty()) graph_.identities.emplace_back();
    }
  }
  sort_runs();
}

}  // namespace

void second_look(const Rig& rig, const std::vector<ColorFamily>& families,
                 std::span<const std::vector<cv::Mat>> presence, std::span<GridGraph> graphs,
                 Labeling& labeling, const SecondLookOptions& options) {
  parallel_for(graphs.size(), [&](std::size_t g) {
    CameraLook look(rig, families, graphs[g],
                    labeling.runs[static_cast<std::size_t>(graphs[g].camera)],
                    labeling.tentative[static_cast<std::size_t>(graphs[g].camera)], options);
    for (int pass = 0; pass < options.passes; ++pass) {
      look.predict();
      look.confirm_tentative();
      look.adopt_curves();
      if (!presence[g].empty()) look.find_missing(presence[g]);
    }
  });
}

}  // namespace pencilscan
