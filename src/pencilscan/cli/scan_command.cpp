#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "pencilscan/cli/command.h"
#include "pencilscan/core/counted_progress.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/labeling/point_file.h"
#include "pencilscan/scan/gray_scan.h"

namespace pencilscan::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPointsFile = "points.ply";
constexpr const char* kMeshFile = "mesh.ply";

struct ScanCommand {
  CommonOptions common;
  std::string captures;
  std::string rig;
  std::string out;
  GrayScanOptions scan;
  double cell_mm = 0;
  bool no_mesh = false;
  bool overwrite = false;
};

double median_spacing(std::vector<SurfaceSample> samples) {
  const auto middle = samples.begin() + std::ptrdiff_t(samples.size() / 2);
  std::nth_element(samples.begin(), middle, samples.end(),
                   [](const auto& a, const auto& b) { return a.spacing < b.spacing; });
  return middle->spacing;
}

/// Points and mesh of one scan: a mesh of an earlier one does not stay beside new points.
void write_scan(const fs::path& out, const std::vector<MeasuredPoint>& points,
                const TriangleMesh& mesh, bool unit_known) {
  remove_older_mesh(out / kMeshFile);
  write_points(out / kPointsFile, points, unit_known);
  if (!mesh.faces.empty()) write_mesh(out / kMeshFile, mesh, unit_known);
}

void run_scan(const ScanCommand& command) {
  const ThreadLimit threads(command.common.threads);
  const Stopwatch watch;
  const fs::path out(command.out);
  for (const char* file : {kPointsFile, kMeshFile})
    refuse_existing("--out", out / file, command.overwrite);
  const Rig rig = read_rig(command.rig);
  const auto pairs = list_captures(command.captures, rig);
  Progress progress = stderr_progress("nothing was written");
  std::vector<MeasuredPoint> points;
  std::vector<SurfaceSample> samples;
  std::vector<PairYield> yields;
  std::size_t missed = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    tell_steps(progress, "decoding: pair", i, pairs.size());
    const DecodedView decoded = decode_gray_stack(read_gray_stack(pairs[i], rig));
    const GrayScan scan =
        gray_scan(rig, pairs[i].camera, pairs[i].projector, decoded, command.scan);
    points.insert(points.end(), scan.points.begin(), scan.points.end());
    samples.insert(samples.end(), scan.samples.begin(), scan.samples.end());
    missed += scan.missed;
    yields.push_back(
        {rig.projectors[pairs[i].projector].name + "/" + rig.cameras[pairs[i].camera].name,
         scan.points.size(), scan.missed - scan.narrow});
  }
  tell_steps(progress, "decoding: pair", pairs.size(), pairs.size());
  warn_of(misfit_warning(yields));
  if (points.empty()) throw StageError("no pixel could be measured: see pencilscan calibrate");
  nlohmann::ordered_json figures{
      {"pairs", pairs.size()}, {"points", points.size()}, {"codes_without_point", missed}};
  TriangleMesh mesh;
  if (!command.no_mesh) {
    progress("meshing", 0);
    const double cell = command.cell_mm > 0 ? command.cell_mm : 1.5 * median_spacing(samples);
    mesh = scan_mesh(samples, cell);
    progress("meshing", 1);
    figures["faces"] = mesh.faces.size();
  }
  progress = {};  // from here on something is written
  write_scan(out, points, mesh, rig.unit_known);
  if (!command.no_mesh && mesh.faces.empty())
    throw StageError("the points are too few for a mesh; " + (out / kPointsFile).string() +
                     " has them");
  figures["seconds"] = watch.seconds();
  print_figures(command.common, figures);
}

}  // namespace

void add_scan_command(CLI::App& app) {
  auto options = std::make_shared<ScanCommand>();
  CLI::App* command = app.add_subcommand("scan", "The dense surface from Gray-code captures");
  command->add_option("--captures", options->captures, "Folder <projector>/<camera>/NNN.png")
      ->required();
  command->add_option("--rig", options->rig, "The rig (rig.json)")->required();
  command->add_option("--out", options->out, "Folder for points.ply and mesh.ply")->required();
  command->add_option("--step", options->scan.step_px, "Measure every n-th pixel and row")
      ->check(between(1, 64))
      ->capture_default_str();
  command->add_flag("--no-mesh", options->no_mesh, "Write points.ply only");
  command->add_option("--cell-mm", options->cell_mm, "Size of the mesh's cells; 0: from the points")
      ->check(zero_or_more())
      ->check(told_where_not(
          "--cell-mm", [options] { return !options->no_mesh; }, "changes the mesh alone"))
      ->capture_default_str();
  add_overwrite(*command, options->overwrite, "Replace an earlier result in --out");
  add_common_options(*command, options->common,
                     "pencilscan scan --captures captures --rig rig.json --out surface");
  command->callback([options] { run_scan(*options); });
}

}  // namespace pencilscan::cli
