#include "pencilscan/cli/page_arguments.h"

namespace pencilscan::cli {

void add_page_arguments(CLI::App& command, std::string& folder, PageOptions& page) {
  command
      .add_option("folder", folder,
                  "output folder of reconstruct, calibrate, scan or an experiment, or a folder of "
                  "several runs")
      ->required();
  command.add_option("--title", page.title, "default: the folder's name");
  command.add_option("--truth", page.sources.truth,
                     "true mesh, or a folder with <frame>/mesh.ply: shows distances to it");
  command.add_option("--rig", page.sources.rig, "the rig, where the folder does not hold it");
  command.add_option("--frames", page.sources.frames,
                     "the captured frames, where the folder has no pictures");
}

}  // namespace pencilscan::cli
