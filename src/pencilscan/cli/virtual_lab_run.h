#pragma once

#include <string>

#include "pencilscan/cli/command.h"

namespace pencilscan {
class LabServer;
}

namespace pencilscan::cli {

class Interruption;

/// What `pencilscan lab --virtual` is asked for.
struct VirtualLabCommand {
  CommonOptions common;
  std::string out;
  std::string rig_path;   ///< the true rig; empty: a ring
  std::string mesh_path;  ///< the object; empty: a pebble
  std::string noise = "low";
  std::string fault;  ///< one of virtual_faults(); empty: none
  int poses = 0;      ///< 0: two in the small setting, else three
  bool small = false;
};

/// What can be made to go wrong.
[[nodiscard]] const std::vector<std::string>& virtual_faults();

/// Builds a virtual laboratory and goes all the way in it with this program's own commands, each a
/// process of its own: flashes (not in the small setting), captures, calibration, a frame, its
/// reconstruction and evaluation; then the same frame simulated without devices. Prints every
/// command line and the figures. To be called before any other thread is there. InputError for an
/// --out that is not empty; StageError when a command fails, with what it said.
void run_virtual_lab(const VirtualLabCommand& command, Interruption& interruption);

/// The same laboratory for somebody who works in it with its page, until interrupted. Other things
/// lie there for every pose. `server` listens outside of the laboratory's network.
void serve_virtual_lab(const VirtualLabCommand& command, LabServer& server,
                       Interruption& interruption);

}  // namespace pencilscan::cli
