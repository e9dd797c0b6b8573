#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "pencilscan/cli/command.h"
#include "pencilscan/cli/evaluation_table.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/evaluation/evaluate.h"
#include "pencilscan/evaluation/truth_check.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/labeling/point_file.h"

namespace pencilscan::cli {
namespace {

namespace fs = std::filesystem;

struct EvaluateOptions {
  CommonOptions common;
  std::string truth_path;
  std::string rig_path;
  std::string result_path;
  std::string align = "none";
};

AlignmentKind kind_of(const std::string& name) {
  if (name == "rigid") return AlignmentKind::kRigid;
  return name == "similarity" ? AlignmentKind::kSimilarity : AlignmentKind::kNone;
}

/// True for a PLY file without faces: points rather than a mesh.
bool holds_points(const fs::path& path) {
  if (path.extension() != ".ply") return false;
  std::ifstream file(path, std::ios::binary);
  constexpr std::size_t kLongestHeader = 200;  // lines
  std::string line;
  for (std::size_t i = 0; i < kLongestHeader && std::getline(file, line); ++i) {
    if (line.starts_with("element face ")) return line.starts_with("element face 0");
    if (line.starts_with("end_header")) return true;
  }
  return false;
}

/// What there is to judge, and the file that holds the points.
struct Result {
  EvaluationInput input;
  fs::path points_path;
};

/// Of the output folder of a run: which of its folders is meant; else empty.
std::string frame_hint(const fs::path& run) {
  std::string first;
  for (const auto& entry : fs::directory_iterator(run)) {
    const std::string name = entry.path().filename().string();
    if (fs::exists(entry.path() / "points.ply") && (first.empty() || name < first)) first = name;
  }
  return first.empty() ? "" : ": give the folder of a frame, as " + (run / first).string();
}

Result read_result(const fs::path& path) {
  Result result;
  if (!fs::exists(path)) throw InputError(path.string(), "", "", "no such file or folder");
  if (!fs::is_directory(path)) {
    if (holds_points(path)) {
      result.points_path = path;
      result.input.points = read_points(path);
    } else {
      result.input.mesh = read_mesh(path);
    }
    return result;
  }
  const fs::path points = path / "points.ply";
  const fs::path mesh = path / "mesh_measured.ply";
  if (!fs::exists(points) && !fs::exists(mesh)) {
    throw InputError(path.string(), "", "",
                     "must hold points.ply or mesh_measured.ply" + frame_hint(path));
  }
  for (const fs::path& file : {points, mesh}) {
    if (!fs::exists(file)) {
      std::cerr << "warning: " << file.string() << " is missing, its figures are left out\n";
    }
  }
  if (fs::exists(points)) {
    result.points_path = points;
    result.input.points = read_points(points);
  }
  if (fs::exists(mesh)) result.input.mesh = read_mesh(mesh);
  return result;
}

void run_evaluate(const EvaluateOptions& options) {
  const ThreadLimit threads(options.common.threads);
  const Rig rig = read_rig(options.rig_path);
  const TriangleMesh truth = read_mesh(options.truth_path);
  const Result result = read_result(options.result_path);
  EvaluationOptions evaluation_options;
  evaluation_options.align = kind_of(options.align);
  evaluation_options.completeness.seed = options.common.seed;
  evaluation_options.progress = stderr_progress("nothing was written");
  try {
    const Evaluation evaluation = evaluate(truth, rig, result.input, evaluation_options);
    nlohmann::ordered_json figures = figures_json(evaluation, rig);
    const auto warn_of_the_rig = [&](const std::optional<std::string>& warning) {
      if (!warning) return;
      warn_of(options.rig_path + ": " + *warning);
      figures["warnings"].push_back(options.rig_path + ": " + *warning);
    };
    warn_of_the_rig(unit_warning(rig, evaluation_options.align));
    if (result.input.points) warn_of_the_rig(other_rig_warning(rig, *result.input.points));
    for (const std::string& warning : evaluation.warnings)
      warn_of(options.truth_path + ": " + warning);
    if (evaluation.point_distance && !evaluation.labels) {
      std::cerr << "pencilscan: " << result.points_path.string()
                << " is of a scan: it has no lines, and their figures are left out\n";
    }
    print_evaluation(figures, std::cout);
    write_figures(options.common, figures);
  } catch (const InputError& error) {
    if (error.path != "points.ply") throw;
    throw InputError(result.points_path.string(), error.field, error.value, error.rule);
  }
}

}  // namespace

void add_evaluate_command(CLI::App& app) {
  auto options = std::make_shared<EvaluateOptions>();
  CLI::App* command =
      app.add_subcommand("evaluate", "Measure a result against the truth (see docs/figures.md)");
  command->add_option("--truth", options->truth_path, "The true mesh (PLY, OBJ, STL, OFF; mm)")
      ->required();
  command->add_option("--rig", options->rig_path, "The rig that the result was made with")
      ->required();
  command
      ->add_option("--result", options->result_path,
                   "A frame's output folder, or one file: points.ply or a mesh")
      ->required();
  command->add_option("--align", options->align, "Move the result onto the truth first")
      ->check(one_of({"none", "rigid", "similarity"}))
      ->capture_default_str();
  add_common_options(*command, options->common,
                     "pencilscan evaluate --truth truth/mesh.ply --rig rig.json --result "
                     "out/000000 --json figures.json");
  command->callback([options] { run_evaluate(*options); });
}

}  // namespace pencilscan::cli
