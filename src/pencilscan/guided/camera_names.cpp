#include "pencilscan/guided/camera_names.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "pencilscan/geometry/light_sheet.h"
#include "pencilscan/points/triangulate.h"

namespace pencilscan {

CameraNames::CameraNames(const Rig& rig, const std::vector<ColorFamily>& families, GridGraph& graph,
                         std::vector<LabeledRun>& runs, const GuidedMatchingOptions& options,
                         std::span<const MeasuredPoint> dense)
    : rig_(rig),
      camera_(rig.camera(graph.camera)),
      graph_(graph),
      runs_(runs),
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
  for (const MeasuredPoint& p : dense) {
    if (p.camera == graph.camera) dense_.push_back(p);
  }
  accept(std::exchange(runs, {}));
}

void CameraNames::accept(std::vector<LabeledRun> news) {
  for (const LabeledRun& run : news) named_.add(curve(run.curve), run);
  not_on_surface_.insert(not_on_surface_.end(), news.begin(), news.end());
  runs_.insert(runs_.end(), news.begin(), news.end());
  std::sort(runs_.begin(), runs_.end(), [](const LabeledRun& a, const LabeledRun& b) {
    return std::tie(a.curve, a.begin) < std::tie(b.curve, b.begin);
  });
}

void CameraNames::grow_surface() {
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

LocalSurface CameraNames::take_surface() {
  grow_surface();
  return std::move(surface_);
}

void CameraNames::predict() {
  grow_surface();
  // Those that became known lie where the surface grew; there all are predicted again.
  const auto is_again = [&](const PredictedPoint& p) { return is_new(p); };
  std::erase_if(missing_, is_again);
  std::erase_if(shown_, is_again);
  constexpr float kFarApart = 5;  // px; of denser lines more are missing by themselves
  const bool is_first = expected_.empty();
  expected_.resize(rig_.projectors.size());
  if (missing_.empty()) not_shown_by_ = named_.count();
  for (const PredictedPoint& p :
       predict_lines(rig_, camera_, surface_, patterns_, options_.prediction)) {
    const bool is_named = named_.show(p);
    (is_named ? shown_ : missing_).push_back(p);
    if (!is_first || p.spacing_px < kFarApart || !is_of_object(p)) continue;
    ExpectedLines& of_projector = expected_[static_cast<std::size_t>(p.pattern.projector)];
    ++of_projector.points;
    of_projector.named += is_named ? 1 : 0;
  }
  missing_places_.set(missing_);
}

std::vector<LineChain> CameraNames::still_missing() {
  const std::size_t known = std::exchange(not_shown_by_, named_.count());
  std::erase_if(missing_, [&](const PredictedPoint& p) { return named_.show(p, known); });
  return chain_points(missing_);
}

std::vector<std::vector<char>> CameraNames::decided_points() const {
  std::vector<std::vector<char>> decided;
  for (const Curve& curve : graph_.curves) decided.emplace_back(curve.points.size(), 0);
  for (const LabeledRun& run : runs_) {
    for (int i = run.begin; i < run.end; ++i)
      decided[static_cast<std::size_t>(run.curve)][static_cast<std::size_t>(i)] = 1;
  }
  return decided;
}

bool CameraNames::is_of_object(const LabeledRun& run, int at) const {
  const LinePattern& pattern = rig_.pattern(run.label.pattern);
  const CurvePoint& p = curve(run.curve).points[static_cast<std::size_t>(at)];
  const Vec2 pixel = p.position.cast<double>();
  const auto projector = static_cast<std::size_t>(run.label.pattern.projector);
  const auto depth = RayInProjector(camera_, rig_.projectors[projector], pixel)
                         .depth(pattern.position_px(run.label.line), pattern.axis);
  return !depth || space_.holds(camera_.point_at_depth(pixel, *depth));
}

bool CameraNames::fits(const CurvePoint& point, const LineName& name, int family) const {
  if (point.sigma_px > options_.max_sigma_px) return false;
  const auto line = missing_places_.line_at(point, family);
  if (!line || line->name != name) return false;
  const auto around = named_.amplitude_around(point.position, name, line->spacing_px, 0, 1);
  return around && point.amplitude > options_.min_amplitude * *around;
}

}  // namespace pencilscan
