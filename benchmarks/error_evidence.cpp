// What sigma and confidence of a frame rest on, beside the true errors, for
// experiments/error_model.py:
//   error_evidence <scene folder: rig.json, frames/000000, truth/mesh.ply> <folder for the answer>
// surface.f32: a row of 7 floats per measured vertex; points.f32: a row of 8 per point, with the
// confidence that the lines' margins give. Lengths in footprints.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
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

std::vector<float> point_rows(const TruthScene& truth, const PointResult& result, float per_unit) {
  std::vector<float> rows;
  const float taken_off = 1 - reported_confidence(1);
  const std::vector<PointVerdict> verdicts = judge_points(truth, result.points);
  for (std::size_t i = 0; i < result.evidence.size(); ++i) {
    if (!verdicts[i].counted) continue;
    const PointEvidence& e = result.evidence[i];
    const MeasuredPoint& p = result.points[i];
    rows.insert(rows.end(),
                {static_cast<float>(verdicts[i].ray_error_mm) * per_unit, e.own, e.surface,
                 e.difference, e.settled ? 1.F : 0.F, verdicts[i].right ? 1.F : 0.F,
                 std::min(1.F, p.confidence + taken_off), p.sigma * per_unit});
  }
  return rows;
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
  if (argc != 3) {
    std::fprintf(stderr, "error_evidence <scene folder> <folder for the answer>\n");
    return 2;
  }
  try {
    pencilscan::run(argv[1], argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
