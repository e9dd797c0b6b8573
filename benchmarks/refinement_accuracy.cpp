// What --refine-rig makes good on one frame with truth: every device is turned and shifted into a
// random direction, and the labelled points of the true, the wrong and the refined rig are compared
// after the best rigid motion onto the truth:
//   refinement_accuracy --rig rig.json --frames frames --truth truth/mesh.ply --seeds 3
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "pencilscan/core/parallel.h"
#include "pencilscan/core/random.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/evaluation/alignment.h"
#include "pencilscan/evaluation/label_error.h"
#include "pencilscan/evaluation/surface_figures.h"
#include "pencilscan/evaluation/truth_scene.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/pipeline/rig_refinement.h"
#include "read_frame.h"

namespace pencilscan {
namespace {

struct Arguments {
  std::filesystem::path rig;
  std::filesystem::path frames;
  std::string frame = "000000";
  std::filesystem::path mesh;
  double rotation_px = 1;
  double translation_mm = 0.3;
  int seeds = 3;
  int threads = 2;
};

RigCorrection errors(const Rig& rig, const Arguments& arguments, std::uint64_t seed) {
  Random random(seed);
  const auto direction = [&] {
    return Vec3(random.normal(), random.normal(), random.normal()).normalized();
  };
  RigCorrection result;
  for (std::size_t d = 0; d < device_count(rig); ++d)
    result.push_back({arguments.rotation_px * direction(), arguments.translation_mm * direction()});
  return result;
}

void print_points(const std::string& name, const Rig& rig, const TruthScene& truth,
                  const PointResult& detected) {
  const Labeling labeling = solve_joint(rig, detected.families, detected.graphs, {});
  const auto crossings =
      crossing_disagreement(rig, crossing_tracks(rig, detected.graphs, labeling));
  const auto measured = triangulate(rig, detected.graphs, labeling);
  const auto verdicts = judge_points(truth, measured);
  std::vector<Vec3> points;
  for (const MeasuredPoint& p : measured) points.emplace_back(p.x, p.y, p.z);
  if (points.size() < 10) {
    std::printf("%-12s %zu points\n", name.c_str(), points.size());
    return;
  }
  const AlignmentReport alignment = align_to_surface(points, truth.scene(), AlignmentKind::kRigid);
  for (Vec3& x : points) x = alignment.truth_from_result * x;
  std::vector<double> distances = distances_to(truth.scene(), points);
  std::sort(distances.begin(), distances.end());
  std::printf(
      "%-12s points %zu  label error %.4f  crossings px %.3f  distance mm median %.4f p90 %.4f\n",
      name.c_str(), points.size(), label_figures(truth, measured, verdicts).wrong.value(),
      crossings.median_px, distances[distances.size() / 2], distances[distances.size() * 9 / 10]);
}

int run(const Arguments& arguments) {
  const ThreadLimit limit(arguments.threads);
  cv::setNumThreads(1);
  const Rig rig = read_rig(arguments.rig);
  const Frame frame = read_frame(rig, arguments.frames / arguments.frame);
  const TruthScene truth(read_mesh(arguments.mesh), rig);
  const PointResult detected = detect_frame(rig, frame);
  const FrameCurves curves{detected.families, detected.graphs};
  print_points("true rig", rig, truth, detected);
  for (int seed = 1; seed <= arguments.seeds; ++seed) {
    const Rig wrong = corrected_rig(rig, errors(rig, arguments, static_cast<std::uint64_t>(seed)));
    print_points("wrong " + std::to_string(seed), wrong, truth, detected);
    const Stopwatch watch;
    const RigRefinement refinement = refine_rig_on_frames(wrong, {&curves, 1});
    const double seconds = watch.seconds();
    print_points("refined " + std::to_string(seed), refinement.rig, truth, detected);
    std::printf("  %s  rounds %zu  expected line error px %.2f  remaining %.2f  seconds %.1f\n",
                refinement.report.refined ? "refined" : refinement.report.reason.c_str(),
                refinement.rounds.size(), refinement.report.expected_error_px,
                refinement.report.remaining_error_px, seconds);
  }
  return 0;
}

}  // namespace
}  // namespace pencilscan

int main(int argc, char** argv) {
  CLI::App app("What --refine-rig makes good of errors of all devices.");
  pencilscan::Arguments arguments;
  app.add_option("--rig", arguments.rig, "rig.json, true")->required();
  app.add_option("--frames", arguments.frames, "folder of frame folders")->required();
  app.add_option("--frame", arguments.frame, "name of the frame");
  app.add_option("--truth", arguments.mesh, "true mesh")->required();
  app.add_option("--rotation-px", arguments.rotation_px, "error of every device");
  app.add_option("--translation-mm", arguments.translation_mm, "error of every device");
  app.add_option("--seeds", arguments.seeds, "how many wrong rigs");
  app.add_option("--threads", arguments.threads, "threads");
  CLI11_PARSE(app, argc, argv);
  return pencilscan::run(arguments);
}
