#include "pencilscan/api/evaluate.h"

#include <array>
#include <nlohmann/json.hpp>

#include "pencilscan/api/run_stages.h"
#include "pencilscan/core/error.h"
#include "pencilscan/evaluation/evaluate.h"
#include "pencilscan/evaluation/truth_check.h"
#include "pencilscan/io/json_text.h"

namespace pencilscan {
namespace {

AlignmentKind alignment_kind(const std::string& name) {
  if (name == "none") return AlignmentKind::kNone;
  if (name == "rigid") return AlignmentKind::kRigid;
  if (name == "similarity") return AlignmentKind::kSimilarity;
  throw InputError("options", "align", name, "must be none, rigid or similarity");
}

}  // namespace

std::string judge(const TriangleMesh& truth, const Rig& rig,
                  const std::vector<MeasuredPoint>* points, const TriangleMesh* measured,
                  const JudgementOptions& options) {
  EvaluationOptions evaluation;
  evaluation.align = alignment_kind(options.align);
  evaluation.completeness.seed = options.seed;
  EvaluationInput input;
  if (points != nullptr) input.points = *points;
  if (measured != nullptr) input.mesh = *measured;
  constexpr std::array<std::string_view, 1> kStages = {"evaluating"};
  std::string text;
  run_stages(options.progress, kStages, [&](const Progress&) {
    nlohmann::ordered_json figures = figures_json(evaluate(truth, rig, input, evaluation), rig);
    if (const auto warning = unit_warning(rig, evaluation.align))
      figures["warnings"].push_back("rig: " + *warning);
    if (input.points) {
      if (const auto warning = other_rig_warning(rig, *input.points))
        figures["warnings"].push_back("rig: " + *warning);
    }
    text = json_text(figures);
  });
  return text;
}

std::string judge(const TriangleMesh& truth, const Rig& rig, const Reconstruction& result,
                  const JudgementOptions& options) {
  return judge(truth, rig, &result.points,
               result.measured.faces.empty() ? nullptr : &result.measured, options);
}

}  // namespace pencilscan
