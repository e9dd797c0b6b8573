#include "pencilscan/page/result_files.h"

#include "pencilscan/io/file.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/labeling/point_file.h"

namespace pencilscan {

bool is_file(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}

ResultFiles::ResultFiles(ResultEntry entry, const Rig* rig, std::size_t max_faces, Note note)
    : entry_(std::move(entry)), rig_(rig), max_faces_(max_faces), note_(std::move(note)) {}

template <class Read>
auto ResultFiles::attempt(const std::filesystem::path& file, Read read)
    -> std::optional<decltype(read(file))> {
  if (!is_file(file)) return std::nullopt;  // noted with all that is absent
  try {
    return read(file);
  } catch (const std::exception& error) {
    note_(file.filename().string(), std::string("unreadable: ") + error.what());
    return std::nullopt;
  }
}

const nlohmann::json* ResultFiles::report() {
  return report_.get([&] { return attempt(entry_.folder / "report.json", read_json); });
}

const nlohmann::json* ResultFiles::timing() {
  return timing_.get([&] { return attempt(entry_.folder / "timing.json", read_json); });
}

const nlohmann::json* ResultFiles::figures() {
  return figures_.get([&] { return attempt(entry_.figures, read_json); });
}

const std::vector<MeasuredPoint>* ResultFiles::points() {
  return points_.get([&] { return attempt(entry_.folder / "points.ply", read_points); });
}

const CurveFile* ResultFiles::curves() {
  return curves_.get([&] { return attempt(entry_.folder / "curves.ply", read_curves); });
}

const TriangleMesh* ResultFiles::mesh() {
  const auto read = [&](const auto& file) { return decimated(read_mesh(file), max_faces_); };
  return mesh_.get([&] { return attempt(entry_.folder / "mesh.ply", read); });
}

const TriangleMesh* ResultFiles::measured() {
  const auto read = [&](const auto& file) { return decimated(read_mesh(file), max_faces_); };
  return measured_.get([&] { return attempt(entry_.folder / "mesh_measured.ply", read); });
}

const RayScene* ResultFiles::measured_scene() {
  const TriangleMesh* mesh = measured();
  if (mesh == nullptr) return nullptr;
  return measured_scene_.get([&] { return std::optional<RayScene>(RayScene(*mesh)); });
}

const RayScene* ResultFiles::truth() {
  const auto read = [](const auto& file) { return RayScene(read_mesh(file)); };
  return truth_.get([&] { return attempt(entry_.truth, read); });
}

const PointErrors* ResultFiles::errors() {
  const auto* measured_points = points();
  const RayScene* scene = truth();
  if (measured_points == nullptr || scene == nullptr || rig_ == nullptr) return nullptr;
  return errors_.get([&] { return std::optional(point_errors(*rig_, *measured_points, *scene)); });
}

}  // namespace pencilscan
