#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "pencilscan/cli/arguments.h"
#include "pencilscan/cli/command.h"
#include "pencilscan/cli/sequence_jobs.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/lower_case.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/jobs/film.h"

namespace pencilscan::cli {
namespace {

struct FilmCommand {
  CommonOptions common;
  std::string result;
  std::string zarr;
  std::string usd;
  double frames_per_second = 25;
  bool measured_only = false;
  bool overwrite = false;
};

void run_film_export(const FilmCommand& command) {
  const ThreadLimit threads(command.common.threads);
  if (command.zarr.empty() && command.usd.empty())
    throw InputError("command line", "--zarr, --usd", "", "at least one must be given");
  std::error_code ignored;
  if (!command.zarr.empty() && !std::filesystem::is_empty(command.zarr, ignored))
    refuse_existing("--zarr", command.zarr, command.overwrite);
  if (!command.usd.empty()) {
    // Programs take .usdc for binary, .usdz for an archive, and refuse this text under such a name.
    const std::string ending = lower_case(std::filesystem::path(command.usd).extension().string());
    if (ending != ".usda" && ending != ".usd")
      throw InputError("--usd", "", command.usd, "must end with .usda or .usd: it becomes text");
    refuse_existing("--usd", command.usd, command.overwrite);
  }
  const Film film = find_film(command.result, command.measured_only);
  nlohmann::ordered_json figures;
  figures["frames"] = film.frames.size();
  figures["frames_with_mesh"] = std::count(film.has_mesh.begin(), film.has_mesh.end(), 1);
  if (!command.zarr.empty()) {
    write_film_zarr(film, command.zarr, stderr_progress());
    figures["zarr"] = command.zarr;
  }
  if (!command.usd.empty()) {
    write_film_usd(film, command.frames_per_second, command.usd, stderr_progress());
    figures["usd"] = command.usd;
  }
  print_figures(command.common, figures);
}

}  // namespace

void add_sequence_export(CLI::App& group) {
  auto options = std::make_shared<FilmCommand>();
  CLI::App* command =
      group.add_subcommand("export", "The shapes of all frames as one file for other programs");
  command->add_option("--result", options->result, "The output folder of reconstruct")->required();
  command->add_option("--zarr", options->zarr, "A Zarr group for Python (surface.zarr)");
  command->add_option("--usd", options->usd,
                      "USD text with time samples for Blender and Houdini (film.usda)");
  add_number(*command, "--frames-per-second", options->frames_per_second, 0.001, 1e6, "Of the film")
      ->check(told_where_not(
          "--frames-per-second", [options] { return !options->usd.empty(); }, "needs --usd"));
  command->add_flag("--measured", options->measured_only,
                    "What was measured, without what closes the surface");
  add_overwrite(*command, options->overwrite, "Replace files that are there");
  add_common_options(*command, options->common,
                     "pencilscan sequence export --result film --zarr surface.zarr");
  command->callback([options] { run_film_export(*options); });
}

}  // namespace pencilscan::cli
