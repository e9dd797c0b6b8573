// What sigma and confidence of a frame rest on, beside the true errors:
//   error_evidence <scene folder: rig.json, frames/000000, truth/mesh.ply> <folder for the answer>
// surface.f32: a row of 7 floats per measured vertex; points.f32: a row of 8 per point, with the
// confidence that the lines' margins give. Lengths in footprints (experiments/error_model.py).
//   error_evidence --lines <scene folder> <folder for the answer>
// lines.f32: per point of the joint labels, however unsure, before any surface: 1 if its line is
// right, else 0, and the confidence (experiments/one_projector.py --fit).
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <string_view>
#include <vector>

#include "pencilscan/core/error.h"
#include "pencilscan/evaluation/label_error.h"
#include "pencilscan/evaluation/surface_figures.h"
#include "pencilscan/evaluation/truth_scene.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/pipeline/frame.h"
#include "read_frame.h"

namespace pencilscan {
namespace {

void write_floats(const std::filesystem::path& path, const std::vector<float>& values) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(values.data()),
             static_cast<std::streamsize>(values.size() * sizeof(float)));
  if (!file.flush()) throw StageError("cannot write " + path.string());
}

std::vector<float> surface_rows(const TruthScene& truth, const SurfaceResult& surface,
                                float per_unit) {
  std::vector<float> rows;
  const TriangleMesh& mesh = surface.mesh;
  const std::vector<double> errors = distances_to(truth.scene(), mesh.vertices);
  for (std::size_t v = 0; v < surface.evidence.size(); ++v) {
    const SurfaceEvidence& e = surface.evidence[v];
    if (!(mesh.confidence[v] > 0)) continue;
    rows.insert(rows.end(), {static_cast<float>(errors[v]) * per_unit, e.predicted, e.scatter,
                             e.bend, e.one_sidedness, e.cameras, mesh.sigma[v] * per_unit});
  }
  return rows;
}

/// Confidences that report less than 1 for errors that no margin tells, without that.
float confidence_of_lines(const MeasuredPoint& point) {
  return std::min(1.F, point.confidence + (1 - reported_confidence(1)));
}

std::vector<float> point_rows(const TruthScene& truth, const PointResult& result, float per_unit) {
  std::vector<float> rows;
  const std::vector<PointVerdict> verdicts = judge_points(truth, result.points);
  for (std::size_t i = 0; i < result.evidence.size(); ++i) {
    if (!verdicts[i].counted) continue;
    const PointEvidence& e = result.evidence[i];
    const MeasuredPoint& p = result.points[i];
    rows.insert(rows.end(),
                {static_cast<float>(verdicts[i].ray_error_mm) * per_unit, e.own, e.surface,
                 e.difference, e.settled ? 1.F : 0.F, verdicts[i].right ? 1.F : 0.F,
                 confidence_of_lines(p), p.sigma * per_unit});
  }
  return rows;
}

void write_lines(const std::filesystem::path& scene, const std::filesystem::path& out) {
  cv::setNumThreads(1);
  const Rig rig = read_rig(scene / "rig.json");
  JointOptions joint;
  joint.min_confidence = 0;
  joint.min_uncrossed_confidence = 0;
  FrameOptions options;
  options.meshes = false;
  options.points.method = joint;
  options.points.guided.passes = 0;
  const FrameResult result =
      reconstruct_frame(rig, read_frame(rig, scene / "frames/000000"), options);
  const TruthScene truth(read_mesh(scene / "truth/mesh.ply"), rig);
  const std::vector<MeasuredPoint>& points = result.points.points;
  const std::vector<PointVerdict> verdicts = judge_points(truth, points);
  std::vector<float> rows;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!verdicts[i].counted) continue;
    rows.insert(rows.end(), {verdicts[i].right ? 1.F : 0.F, confidence_of_lines(points[i])});
  }
  std::filesystem::create_directories(out);
  write_floats(out / "lines.f32", rows);
}

void run(const std::filesystem::path& scene, const std::filesystem::path& out) {
  cv::setNumThreads(1);
  const Rig rig = read_rig(scene / "rig.json");
  const FrameResult result = reconstruct_frame(rig, read_frame(rig, scene / "frames/000000"));
  const TruthScene truth(read_mesh(scene / "truth/mesh.ply"), rig);
  const auto per_unit = static_cast<float>(1 / footprint(rig));
  std::filesystem::create_directories(out);
  write_floats(out / "surface.f32", surface_rows(truth, result.shape.surface, per_unit));
  write_floats(out / "points.f32", point_rows(truth, result.points, per_unit));
}

}  // namespace
}  // namespace pencilscan

int main(int argc, char** argv) {
  const bool of_lines = argc == 4 && std::string_view(argv[1]) == "--lines";
  if (argc != 3 && !of_lines) {
    std::fprintf(stderr, "error_evidence [--lines] <scene folder> <folder for the answer>\n");
    return 2;
  }
  try {
    (of_lines ? pencilscan::write_lines : pencilscan::run)(argv[argc - 2], argv[argc - 1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
