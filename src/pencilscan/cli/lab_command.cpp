#include <memory>

#include "pencilscan/cli/command.h"
#include "pencilscan/cli/interruption.h"
#include "pencilscan/cli/lab_desk.h"
#include "pencilscan/cli/virtual_lab_run.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"

namespace pencilscan::cli {
namespace {

struct LabCommand {
  VirtualLabCommand virtual_lab;
  bool is_virtual = false;
  bool page = false;
  std::string lab_path;
  std::vector<std::string> known_distance;
  int port = 0;
};

/// What real devices need; what else is for one of the two kinds alone, the parser knows.
void check_kind(const LabCommand& command) {
  const VirtualLabCommand& made = command.virtual_lab;
  if (command.is_virtual) return;
  const auto require = [](bool holds, const char* option) {
    if (!holds) throw InputError("command line", option, "", "is required, but for --virtual");
  };
  require(!made.rig_path.empty(), "--rig");
  require(!command.lab_path.empty(), "--lab");
}

void run_lab(const LabCommand& command) {
  check_kind(command);
  Interruption interruption;  // before any thread
  const VirtualLabCommand& made = command.virtual_lab;
  if (command.is_virtual && !command.page) return run_virtual_lab(made, interruption);
  LabServer server(command.port);
  if (command.is_virtual) return serve_virtual_lab(made, server, interruption);
  const ThreadLimit threads(made.common.threads);
  serve_lab({made.rig_path,
             read_lab(command.lab_path),
             command.lab_path,
             made.out,
             command.known_distance,
             made.common.threads,
             {}},
            server, interruption);
}

}  // namespace

void add_lab_command(CLI::App& app) {
  auto options = std::make_shared<LabCommand>();
  VirtualLabCommand& made = options->virtual_lab;
  CLI::App* command = app.add_subcommand(
      "lab",
      "A page that helps to set up, calibrate and take frames (Ctrl-C stops); with --virtual a "
      "laboratory without devices, from nothing to a mesh");
  command->add_option("--out", made.out, "Folder for poses, rig, frames and logs")->required();
  command->add_option("--rig", made.rig_path,
                      "The devices (rig.json; K, distortion, R and t may be missing); with "
                      "--virtual the rig to build (default: a ring of 6 cameras and 6 projectors)");
  CLI::Option* lab = command->add_option(
      "--lab", options->lab_path, "Which device each camera is, and how it is set (lab.json)");
  CLI::Option* distance =
      command
          ->add_option("--known-distance", options->known_distance,
                       "Two devices and the distance of their centres in mm: cam0 cam1 850")
          ->expected(3);
  CLI::Option* is_virtual =
      command
          ->add_flag("--virtual", options->is_virtual,
                     "An X server without hardware, cameras that are programs, simulated light")
          ->excludes(lab)
          ->excludes(distance);
  CLI::Option* page = command->add_flag("--page", options->page, "The page, instead of all at once")
                          ->needs(is_virtual);
  add_number(*command, "--port", options->port, 0, 65535, "Of the page; 0: any free one")
      ->check(only_where([options] { return options->page || !options->is_virtual; },
                         "needs --page where --virtual is"));
  command
      ->add_option("--mesh", made.mesh_path,
                   "The object (PLY, OBJ, STL or OFF), fitted into the volume")
      ->needs(is_virtual);
  command->add_option("--poses", made.poses, "Captures to calibrate with (default 3, small: 2)")
      ->check(between(1, 20))
      ->needs(is_virtual)
      ->excludes(page);
  command->add_option("--noise", made.noise, "Sensor preset, as of simulate")
      ->check(one_of({"none", "low", "medium", "high"}))
      ->capture_default_str()
      ->needs(is_virtual);
  command->add_option("--fault", made.fault, "Make this go wrong, to see what is said")
      ->check(one_of(virtual_faults()))
      ->needs(is_virtual)
      ->excludes(page);
  command->add_flag("--small", made.small, "Few devices with few pixels, a minute or less")
      ->needs(is_virtual);
  add_common_options(*command, made.common, "pencilscan lab --virtual --small --out trial");
  command->callback([options] { run_lab(*options); });
}

}  // namespace pencilscan::cli
