#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/core/progress.h"
#include "pencilscan/evaluation/alignment.h"
#include "pencilscan/evaluation/label_error.h"
#include "pencilscan/evaluation/surface_figures.h"

namespace pencilscan {

struct EvaluationOptions {
  AlignmentKind align = AlignmentKind::kNone;
  CompletenessOptions completeness;  ///< its seed draws all surface samples
  Progress progress;
};

/// What one frame's reconstruction is judged by. Either part may be absent.
struct EvaluationInput {
  std::optional<std::vector<MeasuredPoint>> points;  ///< points.ply
  std::optional<TriangleMesh> mesh;                  ///< mesh_measured.ply
};

/// All figures; those of an absent part are absent, and so are labels and recall of a scan's points
/// (are_of_gray_scan()), which have no lines.
struct Evaluation {
  std::optional<AlignmentReport> alignment;
  std::size_t point_count = 0;
  std::optional<LabelFigures> labels;
  std::optional<RecallFigures> recall;
  std::optional<DistanceFigures> point_distance;
  std::optional<SigmaFigures> sigma;
  std::optional<SurfaceFigures> surface;
  std::vector<std::string> warnings;  ///< that the mesh can hardly be the truth, or is alike turned
};

/// Computes every figure of docs/figures.md. The rig is the one that the result was made with: with
/// an alignment the truth is moved into its frame, so that its camera rays stay valid. InputError
/// when a vertex names a camera, projector or (but for scans) pattern that the rig lacks, has a
/// non-finite number, or when there is too little to align.
[[nodiscard]] Evaluation evaluate(const TriangleMesh& truth, const Rig& rig,
                                  const EvaluationInput& result,
                                  const EvaluationOptions& options = {});

/// The figures under the keys of docs/figures.md; a figure that has no value is null.
[[nodiscard]] nlohmann::ordered_json figures_json(const Evaluation& evaluation, const Rig& rig);

}  // namespace pencilscan
