#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "pencilscan/cli/command.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/image.h"
#include "pencilscan/pattern/line_pattern.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan::cli {
namespace {

struct PatternOptions {
  CommonOptions common;
  std::string rig_path;
  std::string out;
};

void run_pattern(const PatternOptions& options) {
  const ThreadLimit threads(options.common.threads);
  const Rig rig = read_rig(options.rig_path);
  for (std::size_t i = 0; i < rig.projectors.size(); ++i) {
    if (rig.projectors[i].patterns.empty()) {
      throw InputError(options.rig_path, "projectors[" + std::to_string(i) + "].pattern", "",
                       "this key is missing: there is nothing to show");
    }
  }
  nlohmann::ordered_json figures;
  for (const Projector& projector : rig.projectors) {
    const auto path = std::filesystem::path(options.out) / (projector.name + ".png");
    write_image(path, render_patterns(projector.patterns, projector.width, projector.height));
    nlohmann::ordered_json lines = nlohmann::ordered_json::array();
    for (const LinePattern& pattern : projector.patterns) {
      lines.push_back(projector.line_count(pattern));
    }
    figures[projector.name] = {{"file", path.string()}, {"lines", lines}};
  }
  print_figures(options.common, figures);
}

}  // namespace

void add_pattern_command(CLI::App& app) {
  auto options = std::make_shared<PatternOptions>();
  CLI::App* command = app.add_subcommand("pattern", "Write what each projector shows");
  command->add_option("--rig", options->rig_path, "The rig (rig.json)")->required();
  command->add_option("--out", options->out, "Folder for <projector>.png, 8 bit, linear light")
      ->required();
  add_common_options(*command, options->common, "pencilscan pattern --rig rig.json --out patterns");
  command->callback([options] { run_pattern(*options); });
}

}  // namespace pencilscan::cli
