#include "pencilscan/evaluation/evaluate.h"

#include <cmath>

#include "pencilscan/core/counted_progress.h"
#include "pencilscan/core/error.h"
#include "pencilscan/evaluation/truth_check.h"

namespace pencilscan {
namespace {

void require_index(std::size_t vertex, const char* property, std::size_t value, std::size_t count) {
  if (value < count) return;
  throw InputError("points.ply", "vertex " + std::to_string(vertex) + " " + property,
                   std::to_string(value),
                   "must be below " + std::to_string(count) + ", the number in the rig");
}

void validate(const Rig& rig, const std::vector<MeasuredPoint>& points) {
  const bool have_lines = !are_of_gray_scan(points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const MeasuredPoint& p = points[i];
    require_index(i, "camera", p.camera, rig.cameras.size());
    require_index(i, "projector", p.projector, rig.projectors.size());
    if (have_lines)
      require_index(i, "pattern", p.pattern, rig.projectors[p.projector].patterns.size());
    for (const float value : {p.x, p.y, p.z, p.u, p.v, p.sigma}) {
      if (std::isfinite(value)) continue;
      throw InputError("points.ply", "vertex " + std::to_string(i), std::to_string(value),
                       "must be finite");
    }
  }
}

/// Where the result is: its points, or else the vertices of its mesh.
std::vector<Vec3> positions_of(const EvaluationInput& result) {
  if (!result.points) return result.mesh->vertices;
  std::vector<Vec3> positions;
  for (const MeasuredPoint& p : *result.points) positions.push_back(position_of(p));
  return positions;
}

AlignmentReport align(const TriangleMesh& truth, const EvaluationInput& result,
                      AlignmentKind kind) {
  const std::vector<Vec3> points = positions_of(result);
  constexpr std::size_t kFewest = 10;
  if (points.size() < kFewest) {
    throw InputError("result", "vertices", std::to_string(points.size()),
                     "must be at least 10 to align");
  }
  return align_to_surface(points, RayScene(truth), kind);
}

/// True line pixels of all cameras, camera by camera to keep one map in memory.
std::vector<TrueLinePixel> all_true_lines(const TruthScene& truth, const Progress& progress) {
  std::vector<TrueLinePixel> all;
  const std::size_t count = truth.rig().cameras.size();
  for (std::size_t c = 0; c < count; ++c) {
    tell_steps(progress, "tracing true lines: camera", c, count);
    const auto lines = true_line_pixels(truth, static_cast<int>(c));
    all.insert(all.end(), lines.begin(), lines.end());
  }
  return all;
}

void evaluate_points(const TruthScene& truth, const std::vector<MeasuredPoint>& points,
                     double mm_per_unit, const Progress& progress, Evaluation& evaluation) {
  evaluation.point_count = points.size();
  std::vector<Vec3> positions;
  for (const MeasuredPoint& p : points) positions.push_back(position_of(p));
  auto distances = distances_to(truth.scene(), positions);
  for (double& d : distances) d *= mm_per_unit;
  evaluation.point_distance = distance_figures(distances);

  if (are_of_gray_scan(points)) {
    evaluation.sigma = sigma_figures(points, judge_rays(truth, points));
    return;
  }
  if (progress) progress("judging labels", 0);
  const auto verdicts = judge_points(truth, points);
  evaluation.labels = label_figures(truth, points, verdicts);
  evaluation.labels->largest_wrong_patch_mm2 *= mm_per_unit * mm_per_unit;
  evaluation.sigma = sigma_figures(points, verdicts);
  evaluation.recall = line_recall(truth.rig(), all_true_lines(truth, progress), points);
}

}  // namespace

Evaluation evaluate(const TriangleMesh& truth, const Rig& rig, const EvaluationInput& result,
                    const EvaluationOptions& options) {
  if (truth.faces.empty()) throw InputError("truth", "faces", "0", "must be at least 1");
  if (!result.points && !result.mesh) {
    throw InputError("result", "", "", "must hold points.ply or mesh_measured.ply");
  }
  if (result.points) validate(rig, *result.points);

  Evaluation evaluation;
  double mm_per_unit = 1;
  TriangleMesh truth_in_rig = truth;
  if (options.align != AlignmentKind::kNone) {
    if (options.progress) options.progress("aligning", 0);
    evaluation.alignment = align(truth, result, options.align);
    if (auto warning = alignment_warning(*evaluation.alignment))
      evaluation.warnings.push_back(*std::move(warning));
    mm_per_unit = evaluation.alignment->truth_from_result.scale;
    truth_in_rig = transformed(truth, evaluation.alignment->truth_from_result.inverse());
  }
  const TruthScene scene(truth_in_rig, rig);
  if (auto warning = truth_warning(scene.scene(), positions_of(result)))
    evaluation.warnings.push_back(*std::move(warning));
  if (result.points) {
    evaluate_points(scene, *result.points, mm_per_unit, options.progress, evaluation);
  }
  if (result.mesh) {
    if (options.progress) options.progress("comparing surfaces", 0);
    evaluation.surface = surface_figures(scene, *result.mesh, options.completeness, mm_per_unit);
  }
  if (options.progress) options.progress("evaluated", 1);
  return evaluation;
}

}  // namespace pencilscan
