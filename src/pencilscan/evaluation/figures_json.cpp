#include <cmath>
#include <nlohmann/json.hpp>

#include "pencilscan/evaluation/evaluate.h"

namespace pencilscan {
namespace {

using Json = nlohmann::ordered_json;

/// Null for a figure without a value: JSON has no NaN.
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

void put_distance(Json& json, const std::string& prefix, const DistanceFigures& d) {
  json[prefix + "distance_count"] = d.count;
  json[prefix + "distance_median_mm"] = number(d.median_mm);
  json[prefix + "distance_p90_mm"] = number(d.p90_mm);
  json[prefix + "distance_rms_mm"] = number(d.rms_mm);
  json[prefix + "share_above_2mm"] = number(d.share_above_2mm);
}

const char* band_name(std::size_t band) {
  constexpr const char* kNames[kSpacingBandCount] = {"below_3px", "3_5px", "5_8px", "8_12px",
                                                     "from_12px"};
  return kNames[band];
}

void put_lines(Json& json, const LabelFigures& labels, const RecallFigures& recall) {
  json["label_error"] = number(labels.wrong.value());
  json["labelled_pixels"] = labels.wrong.count;
  json["largest_wrong_patch_mm2"] = number(labels.largest_wrong_patch_mm2);
  json["line_recall"] = number(recall.recall.value());
  json["line_recall_3_5px"] = number(recall.recall_dense.value());
  json["line_recall_any_line"] = number(recall.any_line.value());
  json["true_line_pixels"] = recall.recall.count;
  json["line_error_median_px"] = number(labels.line_error_median_px);
  json["line_error_p90_px"] = number(labels.line_error_p90_px);
  Json bands = Json::array();
  for (const ConfidenceBand& band : labels.right_by_confidence) {
    if (band.right.count == 0) continue;
    bands.push_back({{"confidence", number(band.mean_confidence())},
                     {"right", number(band.right.value())},
                     {"points", band.right.count}});
  }
  json["right_by_confidence"] = bands;
}

void put_sigma(Json& json, const std::string& prefix, const SigmaFigures& sigma) {
  json[prefix + "sigma_count"] = sigma.below_one.count;
  json[prefix + "sigma_below_1"] = number(sigma.below_one.value());
  json[prefix + "sigma_below_2"] = number(sigma.below_two.value());
  json[prefix + "sigma_rank_correlation"] = number(sigma.rank_correlation);
  Json tenths = Json::array();
  for (const double t : sigma.tenths) tenths.push_back(number(t));
  json[prefix + "sigma_below_1_by_tenth"] = tenths;
}

std::string threshold_name(double mm) {
  Json text = mm;  // shortest digits: 0.5, 1.0
  std::string name = text.dump();
  if (name.ends_with(".0")) name.resize(name.size() - 2);
  return name + "mm";
}

void put_surface(Json& json, const SurfaceFigures& surface) {
  json["measurable_share"] = number(surface.measurable_share);
  json["measurable_mm2"] = number(surface.measurable_mm2);
  json["lit_by_1_share"] = number(surface.lit_by_one_share);
  json["lit_by_2_share"] = number(surface.lit_by_two_share);
  for (const CompletenessFigures& c : surface.completeness) {
    const std::string at = threshold_name(c.threshold_mm);
    json["completeness_" + at] = number(c.measurable);
    json["completeness_lit_by_1_" + at] = number(c.lit_by_one);
    json["completeness_lit_by_2_" + at] = number(c.lit_by_two);
    json["precision_" + at] = number(c.precision);
    json["f_score_" + at] = number(c.f_score);
  }
}

Json breakdown(const Share& wrong, const Share& found) {
  return {{"label_error", number(wrong.value())},
          {"labelled_pixels", wrong.count},
          {"line_recall", number(found.value())},
          {"true_line_pixels", found.count}};
}

void put_breakdown(Json& json, const LabelFigures& labels, const RecallFigures& recall,
                   const Rig& rig) {
  for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
    json["by_projector"][rig.projectors[p].name] =
        breakdown(labels.wrong_by_projector[p], recall.by_projector[p]);
  }
  for (std::size_t b = 0; b < kSpacingBandCount; ++b) {
    json["by_spacing"][band_name(b)] = breakdown(labels.wrong_by_spacing[b], recall.by_spacing[b]);
  }
  json["by_spacing"]["unlit"] = breakdown(labels.wrong_unlit, {});
}

void put_alignment(Json& json, const AlignmentReport& alignment) {
  const Similarity& s = alignment.truth_from_result;
  Json rotation = Json::array();
  for (Eigen::Index r = 0; r < 3; ++r) {
    rotation.push_back({s.rotation(r, 0), s.rotation(r, 1), s.rotation(r, 2)});
  }
  json["alignment"] = {
      {"scale", s.scale},
      {"rotation", rotation},
      {"translation_mm", {s.translation.x(), s.translation.y(), s.translation.z()}},
      {"median_mm", number(alignment.median_mm)},
      {"iterations", alignment.iterations}};
}

}  // namespace

nlohmann::ordered_json figures_json(const Evaluation& evaluation, const Rig& rig) {
  Json json;
  if (evaluation.point_distance) json["points"] = evaluation.point_count;
  if (evaluation.labels && evaluation.recall)
    put_lines(json, *evaluation.labels, *evaluation.recall);
  // The plain keys are those of points.ply where there is one, else of the mesh.
  if (evaluation.point_distance) {
    put_distance(json, "", *evaluation.point_distance);
  } else if (evaluation.surface) {
    put_distance(json, "", evaluation.surface->distance);
  }
  if (evaluation.surface) {
    put_distance(json, "mesh_", evaluation.surface->distance);
    put_surface(json, *evaluation.surface);
  }
  if (evaluation.sigma) put_sigma(json, "", *evaluation.sigma);
  if (evaluation.surface && evaluation.surface->sigma)
    put_sigma(json, "mesh_", *evaluation.surface->sigma);
  if (evaluation.labels && evaluation.recall) {
    put_breakdown(json, *evaluation.labels, *evaluation.recall, rig);
  }
  if (evaluation.alignment) put_alignment(json, *evaluation.alignment);
  if (!evaluation.warnings.empty()) json["warnings"] = evaluation.warnings;
  return json;
}

}  // namespace pencilscan
