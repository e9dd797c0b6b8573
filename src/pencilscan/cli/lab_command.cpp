#include <memory>

#include "pencilscan/cli/command.h"
#include "pencilscan/cli/interruption.h"
#include "pencilscan/cli/virtual_lab_run.h"
#include "pencilscan/core/error.h"

namespace pencilscan::cli {

void add_lab_command(CLI::App& app) {
  auto options = std::make_shared<VirtualLabCommand>();
  auto is_virtual = std::make_shared<bool>(false);
  CLI::App* command = app.add_subcommand(
      "lab", "From nothing to a mesh in a laboratory without devices (--virtual)");
  command->add_flag("--virtual", *is_virtual,
                    "An X server without hardware, cameras that are programs, simulated light");
  command->add_option("--out", options->out, "New folder for all of it")->required();
  command->add_option("--rig", options->rig_path,
                      "The rig to build (rig.json; default: a ring of 6 cameras and 6 projectors)");
  command->add_option("--mesh", options->mesh_path,
                      "The object (PLY, OBJ, STL or OFF), fitted into the rig's volume");
  command->add_option("--poses", options->poses, "Captures to calibrate with (default 3, small: 2)")
      ->check(between(1, 20));
  command->add_option("--noise", options->noise, "Sensor preset, as of simulate")
      ->check(one_of({"none", "low", "medium", "high"}))
      ->capture_default_str();
  command->add_flag("--small", options->small, "Few devices with few pixels: half a minute");
  add_common_options(*command, options->common, "pencilscan lab --virtual --small --out trial");
  command->callback([options, is_virtual] {
    if (!*is_virtual) throw InputError("command line", "--virtual", "", "is required");
    Interruption interruption;  // before any thread
    run_virtual_lab(*options, interruption);
  });
}

}  // namespace pencilscan::cli
