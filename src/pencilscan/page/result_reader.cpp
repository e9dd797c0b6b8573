#include "pencilscan/page/result_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "pencilscan/core/error.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/evaluation/evaluate.h"
#include "pencilscan/evaluation/truth_check.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/json_text.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/page/advice.h"
#include "pencilscan/page/geometry_blocks.h"
#include "pencilscan/page/histogram.h"
#include "pencilscan/page/image_blocks.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

/// "image/3" -> 3 for prefix "image/"; nothing for another name.
std::optional<std::size_t> index_after(const std::string& name, const std::string& prefix) {
  if (!name.starts_with(prefix)) return std::nullopt;
  std::size_t value = 0;
  const char* first = name.data() + prefix.size();
  const char* last = name.data() + name.size();
  const auto [end, error] = std::from_chars(first, last, value);
  if (error != std::errc() || end != last || first == last) return std::nullopt;
  return value;
}

/// report.json without the long cost curves of the sweeps.
json without_sweeps(json report) {
  if (!report.is_object() || !report.contains("components")) return report;
  if (!report["components"].is_array()) return report;
  for (json& component : report["components"]) {
    if (!component.is_object()) continue;
    component.erase("sweep_cost");
    component.erase("sweep_stride");
  }
  return report;
}

}  // namespace

ResultReader::ResultReader(ResultEntry entry, std::shared_ptr<const Rig> rig, const Detail& detail)
    : rig_(std::move(rig)),
      detail_(detail),
      files_(std::move(entry), rig_.get(), detail.max_faces,
             [this](const std::string& file, const std::string& why) {
               note(file, why, Flaw::kUnreadable);
             }) {
  note_missing_files();
}

void ResultReader::note(const std::string& what, const std::string& why, Flaw kind) {
  const bool known = std::any_of(missing_.begin(), missing_.end(),
                                 [&](const Missing& m) { return m.what == what; });
  if (!known) missing_.push_back({what, why, kind});
}

bool ResultReader::is_scan() const {
  const fs::path& folder = files_.entry().folder;
  return is_file(folder / "points.ply") && !is_file(folder / "report.json") &&
         !is_file(folder / "curves.ply") && !is_file(folder / "mesh_measured.ply") &&
         !fs::is_directory(folder / "pictures");
}

void ResultReader::note_missing_files() {
  if (rig_ == nullptr)
    note("the devices",
         "no readable devices.json or rig.json beside the results; name the rig with --rig",
         Flaw::kMissing);
  if (is_scan()) return;
  const auto need = [&](const char* file, const char* consequence) {
    if (!is_file(files_.entry().folder / file))
      note(file, std::string("not in the folder: ") + consequence, Flaw::kMissing);
  };
  need("report.json", "no counts and warnings");
  need("points.ply", "no measured points");
  need("mesh.ply", "no closed surface");
  if (detail_.shape_only) return;
  need("timing.json", "no times");
  need("mesh_measured.ply", "no view without the closing parts");
  need("curves.ply", "no curves over the images (made by an earlier version?)");
  if (rig_ == nullptr) return;
  std::string without;
  for (std::size_t c = 0; c < rig_->cameras.size(); ++c) {
    if (rig_->cameras[c].sees_texture_only) continue;
    const auto& name = rig_->cameras[c].name;
    const bool there = is_file(files_.entry().folder / "pictures" / (name + ".jpg")) ||
                       !files_.entry().captured.empty();
    if (!there) add_name(without, name);
  }
  if (!without.empty()) {
    note("pictures",
         "no picture of " + without +
             ": reconstructed with --no-pictures? --frames names the captured images",
         Flaw::kMissing);
  }
}

std::vector<std::string> ResultReader::part_names() const {
  std::vector<std::string> names = {"details"};
  const bool has_mesh = is_file(files_.entry().folder / "mesh.ply");
  if (has_mesh) names.insert(names.end(), {"mesh", "thumb"});
  if (detail_.shape_only) return names;
  if (is_file(files_.entry().folder / "mesh_measured.ply")) names.push_back("measured");
  if (is_file(files_.entry().folder / "points.ply")) names.push_back("points");
  if (rig_ == nullptr) return names;
  if (is_file(files_.entry().folder / "curves.ply")) names.push_back("curves");
  for (std::size_t c = 0; c < rig_->cameras.size(); ++c) {
    const std::string index = std::to_string(c);
    const std::string& camera = rig_->cameras[c].name;
    const fs::path pictures = files_.entry().folder / "pictures";
    if (is_file(pictures / (camera + ".jpg")) || !files_.entry().captured.empty())
      names.push_back("image/" + index);
    if (is_file(pictures / (camera + "_holes.png"))) names.push_back("holes/" + index);
    if (is_file(files_.entry().folder / "depth" / (camera + ".tiff")) ||
        is_file(files_.entry().folder / "mesh_measured.ply")) {
      names.push_back("depth/" + index);
    }
  }
  return names;
}

std::vector<ResultReader::Missing> ResultReader::missing() const {
  const std::lock_guard lock(mutex_);
  return missing_;
}

ordered_json ResultReader::missing_json() const {
  ordered_json list = ordered_json::array();
  for (const Missing& m : missing())
    list.push_back({{"what", m.what}, {"why", m.why}, {"kind", to_string(m.kind)}});
  return list;
}

std::optional<std::string> ResultReader::part(const std::string& name) {
  const std::lock_guard lock(mutex_);
  try {
    return make_part(name);
  } catch (const std::exception& error) {
    note(name, error.what(), Flaw::kUnreadable);
    return std::nullopt;
  }
}

std::optional<std::string> ResultReader::make_part(const std::string& name) {
  if (name == "details") return compress(json_line(details()));
  if (name == "thumb") {
    const TriangleMesh* mesh = files_.mesh();
    if (mesh == nullptr) return std::nullopt;
    return mesh_thumbnail(*mesh, 160, 120).bytes;
  }
  if (name == "mesh" || name == "measured") {
    const TriangleMesh* mesh = name == "mesh" ? files_.mesh() : files_.measured();
    if (mesh == nullptr) return std::nullopt;
    if (detail_.for_playing) return unpacked_mesh(*mesh);
    const RayScene* truth = files_.truth();
    const auto distances =
        truth == nullptr ? std::vector<float>() : vertex_distances(*mesh, *truth);
    return mesh_block(*mesh, distances,
                      detail_.shape_only ? MeshPrecision::kCoarse : MeshPrecision::kFine)
        .bytes();
  }
  if (detail_.shape_only) return std::nullopt;
  if (name == "points") {
    const auto* points = files_.points();
    if (points == nullptr) return std::nullopt;
    const PointErrors* errors = files_.errors();
    return points_block(*points, errors == nullptr ? std::vector<float>() : errors->distance_mm,
                        detail_.point_stride)
        .bytes();
  }
  return rig_ == nullptr ? std::nullopt : make_camera_part(name);
}

std::optional<std::string> ResultReader::make_camera_part(const std::string& name) {
  if (name == "curves") {
    const CurveFile* curves = files_.curves();
    if (curves == nullptr) return std::nullopt;
    return curves_block(*rig_, *curves).bytes();
  }
  const auto camera = [&](const char* prefix) -> const Camera* {
    const auto index = index_after(name, prefix);
    return index && *index < rig_->cameras.size() ? &rig_->cameras[*index] : nullptr;
  };
  const ResultEntry& entry = files_.entry();
  if (const Camera* c = camera("image/")) {
    const auto image = camera_image(entry, *c, detail_.image_width, detail_.image_quality);
    if (image) return image->bytes;
  } else if (const Camera* h = camera("holes/")) {
    const auto image = hole_image(entry, *h);
    if (image) return image->bytes;
  } else if (const Camera* d = camera("depth/")) {
    const auto block = depth_block(entry, *d, files_.measured_scene());
    if (block) return block->bytes();
  }
  return std::nullopt;
}

ordered_json ResultReader::histograms(bool has_truth) {
  ordered_json result = ordered_json::object();
  const auto* points = files_.points();
  if (points == nullptr) return result;
  std::vector<float> sigmas;
  std::vector<float> confidences;
  for (const MeasuredPoint& p : *points) {
    if (p.sigma > 0) sigmas.push_back(p.sigma);
    confidences.push_back(p.confidence);
  }
  result["sigma_mm"] = histogram(sigmas);
  result["confidence"] = histogram(confidences);
  if (const PointErrors* errors = has_truth ? files_.errors() : nullptr) {
    result["error_mm"] = histogram(errors->distance_mm);
    std::vector<float> ratio;
    for (std::size_t i = 0; i < points->size(); ++i) {
      if ((*points)[i].sigma > 0) ratio.push_back(errors->along_ray_mm[i] / (*points)[i].sigma);
    }
    result["error_over_sigma"] = histogram(ratio);
  }
  return result;
}

bool ResultReader::is_truth(const RayScene& truth) {
  std::vector<Vec3> positions;
  if (const auto* points = detail_.shape_only ? nullptr : files_.points()) {
    for (const MeasuredPoint& p : *points) positions.push_back(position_of(p));
  } else if (const TriangleMesh* mesh = files_.mesh()) {
    positions = mesh->vertices;
  }
  const auto warning = truth_warning(truth, positions);
  if (warning) {
    note(files_.entry().truth.string(), *warning + "; figures against it are left out",
         Flaw::kDoubtful);
  }
  return !warning;
}

/// Where the points are hardly those of this rig, whose cameras show them.
void ResultReader::note_other_rig() {
  const auto* points = rig_ == nullptr || detail_.shape_only ? nullptr : files_.points();
  if (points == nullptr) return;
  const auto camera = [](const MeasuredPoint& a, const MeasuredPoint& b) {
    return a.camera < b.camera;
  };
  const auto last = std::max_element(points->begin(), points->end(), camera);
  if (last == points->end()) return;
  const std::optional<std::string> warning =
      last->camera < rig_->cameras.size()
          ? other_rig_warning(*rig_, *points)
          : "the points are of camera " + std::to_string(last->camera) +
                " and the rig's last one is " + std::to_string(rig_->cameras.size() - 1);
  if (warning) note(files_.entry().rig.string(), *warning, Flaw::kDoubtful);
}

ordered_json ResultReader::details() {
  ordered_json result;
  if (const json* report = files_.report()) {
    result["report"] = without_sweeps(*report);
    result["warnings"] = ordered_json::array();
    for (const Advice& advice : advise(*report))
      result["warnings"].push_back({{"text", advice.warning}, {"action", advice.action}});
  }
  if (const json* timing = files_.timing()) result["timing"] = *timing;
  const RayScene* truth = files_.truth();
  const bool has_truth = truth != nullptr && is_truth(*truth);
  note_other_rig();
  for (const Missing& m : missing_) {  // `view` makes its index before it knows
    if (m.kind == Flaw::kDoubtful)
      result["doubts"].push_back({{"what", m.what}, {"why", m.why}, {"kind", to_string(m.kind)}});
  }
  if (!detail_.shape_only) result["histograms"] = histograms(has_truth);
  if (const json* figures = files_.figures()) {
    result["figures"] = *figures;
  } else if (has_truth && rig_ != nullptr && detail_.evaluate && !detail_.shape_only) {
    EvaluationInput input;
    if (const auto* points = files_.points()) input.points = *points;
    const auto measured = files_.entry().folder / "mesh_measured.ply";
    if (files_.measured() != nullptr) input.mesh = read_mesh(measured);
    evaluated_ = figures_json(evaluate(truth->mesh(), *rig_, input), *rig_);
    result["figures"] = evaluated_;
  }
  return result;
}

ordered_json ResultReader::summary() {
  const std::lock_guard lock(mutex_);
  ordered_json summary = ordered_json::object();
  const auto take = [&](const json* from, std::initializer_list<const char*> path) {
    const char* key = "";
    for (const char* step : path) {
      if (from == nullptr || !from->is_object() || !from->contains(step)) return;
      from = &(*from)[step];
      key = step;
    }
    if (from != nullptr && from->is_number()) summary[key] = *from;
  };
  const json* report = files_.report();
  take(report, {"points"});
  // Without a surface (--no-mesh) the report states a share of nothing.
  if (is_file(files_.entry().folder / "mesh.ply")) take(report, {"surface", "measured_share"});
  take(report, {"crossing_disagreement", "median_px"});
  if (report != nullptr && report->is_object() && report->contains("warnings"))
    summary["warnings"] = (*report)["warnings"].size();
  take(files_.timing(), {"seconds", "total"});
  const json* figures = files_.figures();
  for (const char* key : {"label_error", "line_recall", "line_recall_3_5px", "distance_median_mm",
                          "completeness_1mm"}) {
    take(figures != nullptr ? figures : &evaluated_, {key});
  }
  return summary;
}

}  // namespace pencilscan
