// Accuracy of every stage up to labelled points on one frame with truth:
//   accuracy --rig rig.json --frames frames --frame 000000 --truth truth/mesh.ply
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "cluster_enumeration.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/evaluation/label_error.h"
#include "pencilscan/evaluation/line_recall.h"
#include "pencilscan/evaluation/surface_figures.h"
#include "pencilscan/evaluation/true_lines.h"
#include "pencilscan/evaluation/truth_scene.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/pipeline/frame.h"
#include "read_frame.h"

namespace pencilscan {
namespace {

/// Detected points of one colour family against the truth, over all cameras.
void print_detection(const Rig& rig, const PointResult& result,
                     const std::vector<std::vector<TrueLinePixel>>& truth) {
  for (std::size_t f = 0; f < result.families.size(); ++f) {
    std::vector<TrueLinePixel> lines;
    std::vector<DetectedPoint> detected;
    std::vector<PatternChannel> family;
    for (const PatternRef& ref : result.families[f].patterns) {
      family.push_back({ref.projector, ref.pattern});
    }
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      lines.insert(lines.end(), truth[c].begin(), truth[c].end());
      for (const Curve& curve : result.graphs[c].curves) {
        if (curve.family != static_cast<int>(f)) continue;
        for (const CurvePoint& p : curve.points) {
          detected.push_back({static_cast<int>(c), p.position.x(), p.position.y()});
        }
      }
    }
    const DetectionFigures figures = detection_figures(lines, detected, family);
    std::string name;
    for (const PatternColor& color : result.families[f].colors) {
      name += (name.empty() ? "" : "/") + color.text();
    }
    std::printf(
        "detection %-12s recall %.4f  recall 3-5 px %.4f  spurious %.4f  error px median %.4f p90 "
        "%.4f\n",
        name.c_str(), figures.recall.value(), figures.recall_dense.value(),
        figures.spurious.value(), figures.error_median_px, figures.error_p90_px);
  }
}

/// Share of curve points whose projector and local ID are true (a 0.3 line window at the pixel).
void print_identities(const TruthScene& truth, const Rig& rig, const PointResult& result) {
  std::size_t points = 0;
  std::size_t pattern_right = 0;
  std::size_t id_right = 0;
  for (const GridGraph& graph : result.graphs) {
    for (std::size_t k = 0; k < graph.identities.size(); ++k) {
      const CurveIdentity& identity = graph.identities[k];
      for (std::size_t i = 0; i < graph.curves[k].points.size(); i += 8) {
        ++points;
        if (!identity.pattern) continue;
        const auto sample = sample_line(truth, graph.camera,
                                        {identity.pattern->projector, identity.pattern->pattern},
                                        graph.curves[k].points[i].position.cast<double>());
        if (!sample) continue;
        const int line = static_cast<int>(std::lround(sample->coordinate));
        if (std::abs(sample->coordinate - line) > 0.3) continue;
        ++pattern_right;
        const Projector& projector =
            rig.projectors[static_cast<std::size_t>(identity.pattern->projector)];
        id_right +=
            projector.patterns[static_cast<std::size_t>(identity.pattern->pattern)].local_id(
                line) == identity.local_id;
      }
    }
  }
  const auto n = static_cast<double>(std::max<std::size_t>(1, points));
  std::printf("identity  projector %.4f  projector and local ID %.4f of all curve points\n",
              static_cast<double>(pattern_right) / n, static_cast<double>(id_right) / n);
}

void print_distances(const TruthScene& truth, const PointResult& result,
                     const std::vector<PointVerdict>& verdicts,
                     const std::vector<StageTime>& times) {
  std::vector<Vec3> points;
  for (const MeasuredPoint& p : result.points) points.emplace_back(p.x, p.y, p.z);
  std::vector<double> distances = distances_to(truth.scene(), points);
  if (distances.empty()) return;
  std::sort(distances.begin(), distances.end());
  const auto n = distances.size();
  const auto beyond = distances.end() - std::upper_bound(distances.begin(), distances.end(), 2.0);
  const SigmaFigures sigma = sigma_figures(result.points, verdicts);
  std::printf(
      "  distance mm median %.4f p90 %.4f  > 2 mm %.5f  below sigma %.3f 2 sigma %.3f  tenths",
      distances[n / 2], distances[n * 9 / 10], static_cast<double>(beyond) / static_cast<double>(n),
      sigma.below_one.value(), sigma.below_two.value());
  for (const double t : sigma.tenths) std::printf(" %.2f", t);
  std::printf("  rank %.2f\n  seconds", sigma.rank_correlation);
  for (const StageTime& time : times) std::printf(" %s %.3f", time.stage.c_str(), time.seconds);
  std::printf("\n");
}

/// Of points with confidence near c, which share is right?
void print_reliability(const LabelFigures& labels) {
  for (const ConfidenceBand& band : labels.right_by_confidence) {
    if (band.right.count == 0) continue;
    std::printf("  confidence %.4f  right %.4f  of %zu points\n", band.mean_confidence(),
                band.right.value(), band.right.count);
  }
}

struct MethodChoice {
  const char* name;
  MethodOptions method;
  bool is_guided = true;
};

int run(const std::filesystem::path& rig_path, const std::filesystem::path& frames,
        const std::string& name, const std::filesystem::path& mesh_path, const std::string& methods,
        int threads) {
  const ThreadLimit limit(threads);
  cv::setNumThreads(1);
  const Rig rig = read_rig(rig_path);
  const Frame frame = read_frame(rig, frames / name);
  const TruthScene truth(read_mesh(mesh_path), rig);
  std::vector<std::vector<TrueLinePixel>> true_lines(rig.cameras.size());
  parallel_for(rig.cameras.size(), [&](std::size_t c) {
    true_lines[c] = true_line_pixels(truth, static_cast<int>(c));
  });
  std::vector<TrueLinePixel> all_lines;
  for (const auto& lines : true_lines)
    all_lines.insert(all_lines.end(), lines.begin(), lines.end());

  MultiviewOptions published;
  published.cost = MultiviewCost::kPublished;
  JointOptions clusters;
  clusters.inference = [](const PairwiseEnergy& energy) { return enumerate_clusters(energy); };
  const MethodChoice choices[] = {
      {"linear", LinearOptions{}},
      {"multiview published", published},
      {"multiview", MultiviewOptions{}},
      {"joint", JointOptions{}},
      {"joint, not guided", JointOptions{}, false},
      {"clusters, not guided", clusters, false},
      {"clusters", clusters},
  };
  bool is_first = true;
  for (std::size_t k = 0; k < std::size(choices); ++k) {
    if (!methods.empty() && methods != choices[k].name) continue;
    FrameOptions options;
    options.meshes = false;
    options.points.method = choices[k].method;
    if (!choices[k].is_guided) options.points.guided.passes = 0;
    const FrameResult made = reconstruct_frame(rig, frame, options);
    const PointResult& result = made.points;
    if (is_first) {
      print_detection(rig, result, true_lines);
      print_identities(truth, rig, result);
      is_first = false;
    }
    const std::vector<PointVerdict> verdicts = judge_points(truth, result.points);
    const LabelFigures labels = label_figures(truth, result.points, verdicts);
    const RecallFigures recall = line_recall(rig, all_lines, result.points);
    std::printf(
        "%-20s points %zu  label error %.4f  line recall %.4f  3-5 px %.4f  line error px median "
        "%.4f\n",
        choices[k].name, result.points.size(), labels.wrong.value(), recall.recall.value(),
        recall.recall_dense.value(), labels.line_error_median_px);
    print_distances(truth, result, verdicts, made.times);
    print_reliability(labels);
  }
  return 0;
}

}  // namespace
}  // namespace pencilscan

int main(int argc, char** argv) {
  CLI::App app("Accuracy of the stages up to labelled points on a frame with truth.");
  std::string rig;
  std::string frames;
  std::string frame = "000000";
  std::string mesh;
  std::string method;
  int threads = 2;
  app.add_option("--rig", rig, "rig.json")->required();
  app.add_option("--frames", frames, "folder of frame folders")->required();
  app.add_option("--frame", frame, "name of the frame");
  app.add_option("--truth", mesh, "true mesh")->required();
  app.add_option("--method", method, "one row of the table only");
  app.add_option("--threads", threads, "threads");
  CLI11_PARSE(app, argc, argv);
  return pencilscan::run(rig, frames, frame, mesh, method, threads);
}
