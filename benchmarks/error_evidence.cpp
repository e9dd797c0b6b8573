// What sigma and confidence of a frame rest on, beside the true errors:
//   error_evidence <scene folder: rig.json, frames/000000, truth/mesh.ply> <folder for the answer>
// surface.f32: a row of 7 floats per measured vertex; points.f32: a row of 9 per point, with the
// confidence that the lines' margins give and the one that is stated; lines.f32: of points that no
// surface was asked of, 1 if the line is right, else 0, and what margins give. Lengths in
// footprints (experiments/error_model.py).
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
#include "pencilscan/pipeline/sensor_frame.h"
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
  const std::vector<PointVerdict> verdicts = judge_points(truth, result.points);
  for (std::size_t i = 0; i < result.evidence.size(); ++i) {
    if (!verdicts[i].counted) continue;
    const PointEvidence& e = result.evidence[i];
    const MeasuredPoint& p = result.points[i];
    rows.insert(rows.end(),
                {static_cast<float>(verdicts[i].ray_error_mm) * per_unit, e.own, e.surface,
                 e.difference, e.settled ? 1.F : 0.F, verdicts[i].right ? 1.F : 0.F, e.confidence,
                 p.sigma * per_unit, p.confidence});
  }
  return rows;
}

/// Points whose confidence is what margins say; no surface was asked.
std::vector<MeasuredPoint> points_by_margins(const Rig& rig, const Frame& frame,
                                             const PointOptions& options) {
  std::vector<StageTime> times;
  const StageClock clock({}, times);
  const SensorFrame sensor = sensor_frame(in_footprints(rig), frame);
  PointResult curves = detect_frame(sensor.rig, sensor.frame, options, clock);
  curves = check_pictures(sensor.rig, sensor.frame, std::move(curves));
  PointResult lines = solve_frame(sensor.rig, sensor.frame, std::move(curves), options, clock);
  std::vector<MeasuredPoint> points =
      place_points(sensor.rig, std::move(lines), options, clock).points;
  const auto unit = static_cast<float>(footprint(rig));
  for (MeasuredPoint& p : points) {
    for (float* length : {&p.x, &p.y, &p.z}) *length *= unit;
  }
  return points;
}

void write_lines(const std::filesystem::path& scene, const std::filesystem::path& out,
                 const PointOptions& options) {
  cv::setNumThreads(1);
  const Rig rig = read_rig(scene / "rig.json");
  const std::vector<MeasuredPoint> points =
      points_by_margins(rig, read_frame(rig, scene / "frames/000000"), options);
  const TruthScene truth(read_mesh(scene / "truth/mesh.ply"), rig);
  const std::vector<PointVerdict> verdicts = judge_points(truth, points);
  std::vector<float> rows;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!verdicts[i].counted) continue;
    rows.insert(rows.end(), {verdicts[i].right ? 1.F : 0.F, points[i].confidence});
  }
  std::filesystem::create_directories(out);
  write_floats(out / "lines.f32", rows);
}

/// Of all pieces, however unsure, before guided matching.
PointOptions of_all_pieces() {
  JointOptions joint;
  joint.min_confidence = 0;
  joint.min_uncrossed_confidence = 0;
  PointOptions options;
  options.method = joint;
  options.guided.passes = 0;
  return options;
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
  write_lines(scene, out, {});
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
    const char* scene = argv[argc - 2];
    const char* out = argv[argc - 1];
    if (of_lines) {
      pencilscan::write_lines(scene, out, pencilscan::of_all_pieces());
    } else {
      pencilscan::run(scene, out);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
