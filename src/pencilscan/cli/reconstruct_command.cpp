#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "pencilscan/cli/own_command.h"
#include "pencilscan/cli/reconstruct_options.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/jobs/job_folder.h"
#include "pencilscan/pipeline/sequence.h"

namespace pencilscan::cli {
namespace {

void print_refinement(const RefinementOutcome& refinement, nlohmann::ordered_json& figures) {
  for (const std::string& move : refinement.moves) std::cerr << "pencilscan: " << move << "\n";
  for (const std::string& warning : refinement.warnings) warn_of(warning);
  figures["rig_refined"] = refinement.refined;
  if (!refinement.refined) {
    warn_of("the rig was not refined: " + refinement.reason);
    return;
  }
  figures["crossing_disagreement_before_px"] = refinement.before_px;
  figures["crossing_disagreement_after_px"] = refinement.after_px;
}

/// Of a frame that an earlier run made, its report knows the number.
std::size_t points_of(const FrameOutcome& outcome, const std::string& out) {
  if (!outcome.resumed) return outcome.points;
  const auto report = read_json(std::filesystem::path(out) / outcome.name / "report.json");
  const auto points = report.is_object() ? report.find("points") : report.end();
  return points != report.end() && points->is_number_unsigned() ? points->get<std::size_t>() : 0;
}

void reconstruct(const ReconstructOptions& options) {
  const ThreadLimit limit(options.common.threads);
  const SequenceOptions sequence = sequence_options(options);
  warn_of_rig(read_rig(options.rig));
  const auto [outcomes, refinement, warnings] =
      reconstruct_sequence(options.rig, options.frames, options.out, sequence,
                           stderr_progress("frames that are done are kept, and the same command "
                                           "goes on with the others"));
  nlohmann::ordered_json figures;
  if (refinement) print_refinement(*refinement, figures);
  std::size_t failed = 0;
  for (const std::string& warning : warnings) warn_of(warning);
  for (const FrameOutcome& outcome : outcomes) {
    for (const std::string& warning : outcome.warnings)
      warn_of("frame " + outcome.name + ": " + warning);
    if (!outcome.done) {
      std::cerr << "pencilscan: frame " << outcome.name << ": " << outcome.failure << "\n";
      ++failed;
    }
  }
  figures["frames"] = outcomes.size();
  figures[kFramesFailed] = failed;
  figures["frames_resumed"] =
      std::count_if(outcomes.begin(), outcomes.end(), [](const auto& o) { return o.resumed; });
  std::size_t points = 0;
  for (const FrameOutcome& outcome : outcomes) points += points_of(outcome, options.out);
  figures["points"] = points;
  if (outcomes.size() == 1 && !outcomes[0].resumed) figures["seconds"] = outcomes[0].seconds;
  figures["out"] = options.out;
  print_figures(options.common, figures);
  if (failed > 0) {
    throw StageError(std::to_string(failed) + " of " + std::to_string(outcomes.size()) +
                     " frames could not be reconstructed");
  }
  if (refinement && !refinement->refined) {
    throw StageError("the rig could not be refined and was used as given");
  }
}

}  // namespace

SequenceOptions sequence_options(const ReconstructOptions& options) {
  SequenceOptions sequence;
  const SolutionMethod& method = *find_method(options.method);
  FrameOptions& frame = sequence.output.frame;
  frame.points.method = method.defaults;
  if (!set_multiview_cost(options.cost, frame.points.method))
    throw InputError("--multiview-cost", "", options.cost, "must be published or normalized");
  frame.shape.depth.enabled = !options.no_depth && method.capabilities.allows_dense_depth;
  sequence.plain_frames = options.plain_frames;
  sequence.output.refine_rig = options.refine_rig;
  frame.meshes = !options.no_mesh;
  frame.joined_pixels = options.join_pixels;
  sequence.output.tracks = !options.independent;
  sequence.output.pictures = !options.no_pictures;
  sequence.output.depth_maps = options.depth_maps;
  sequence.output.mesh_formats = options.mesh_formats;
  sequence.overwrite = options.overwrite;
  if (!options.shard.empty())
    sequence.shard = shard_from_text(options.shard, process_environment());
  sequence.program = own_hash();
  return sequence;
}

void add_reconstruct_options(CLI::App& command, ReconstructOptions& options) {
  command.add_option("--rig", options.rig, "rig.json of the calibrated devices")->required();
  command
      .add_option("--frames", options.frames, "folder that holds the frame folders, or a recording")
      ->required();
  command.add_option("--out", options.out, "output folder, one folder per frame")->required();
  command.add_option(
      "--plain-frames", options.plain_frames,
      "folder of frame folders of the same names (or of one) with images of the same "
      "moments in plain light: the colour is theirs");
  command
      .add_option("--method", options.method,
                  "how lines are told apart: joint, the paper's two, or the grid of one projector "
                  "that it compares itself with")
      ->check(one_of(method_names()))
      ->capture_default_str();
  command
      .add_option(
          "--multiview-cost", options.cost,
          "of the sweep: published (a sum over the reprojected points) or normalized (a mean "
          "in which points outside the other images count too)")
      ->check(one_of({"published", "normalized"}))
      ->check(told_where_not(
          "--multiview-cost", [&options] { return options.method == "multiview"; },
          "needs --method multiview"))
      ->capture_default_str();
  CLI::Option* no_depth =
      command.add_flag("--no-depth", options.no_depth,
                       "surface from the labelled curves alone, without depth between them");
  CLI::Option* no_mesh =
      command.add_flag("--no-mesh", options.no_mesh, "labelled points alone, without a surface");
  add_number(command, "--join-pixels", options.join_pixels, 1, 16,
             "N: join N x N pixels to one, for a quicker, coarser look");
  command
      .add_flag("--depth-maps", options.depth_maps,
                "depth and its deviation per camera: float TIFF and 16-bit PNG")
      ->check(only_where(
          [&options] { return find_method(options.method)->capabilities.allows_dense_depth; },
          "needs --method joint"))
      ->excludes(no_depth)
      ->excludes(no_mesh);
  command
      .add_option("--mesh-formats", options.mesh_formats,
                  "the closed mesh also as obj, stl or glb (several with commas)")
      ->delimiter(',')
      ->check(one_of({"obj", "stl", "glb"}))
      ->excludes(no_mesh);
  command.add_flag("--refine-rig", options.refine_rig,
                   "correct the poses of the devices from the lines that cross in the frames");
  command.add_flag(
      "--independent", options.independent,
      "every frame from itself alone: what rests takes no mean over the frames before");
  command.add_flag("--no-pictures", options.no_pictures, "leave overlays and views out");
  command.add_flag("--overwrite", options.overwrite, "replace output of other inputs or options");
}

void add_reconstruct_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "reconstruct", "The shape in every frame: labelled points, closed mesh, report, pictures.");
  auto options = std::make_shared<ReconstructOptions>();
  add_reconstruct_options(*command, *options);
  command->add_option("--shard", options->shard,
                      "i/n: every n-th chunk of 50 frames, from the i-th (from 0); auto: as the "
                      "array of jobs of Slurm, PBS, Grid Engine and others says");
  add_common_options(*command, options->common,
                     "pencilscan reconstruct --rig rig.json --frames frames --out result");
  command->callback([options] { reconstruct(*options); });
}

}  // namespace pencilscan::cli
