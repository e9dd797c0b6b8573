#pragma once

#include <string>
#include <vector>

#include "pencilscan/cli/command.h"
#include "pencilscan/pipeline/sequence.h"

namespace pencilscan::cli {

/// What `reconstruct` was asked for.
struct ReconstructOptions {
  CommonOptions common;
  std::string rig;
  std::string frames;
  std::string plain_frames;
  std::string out;
  std::string method = "joint";
  std::string cost = "normalized";
  bool no_pictures = false;
  bool no_depth = false;
  bool no_mesh = false;
  int join_pixels = 1;
  bool independent = false;
  bool depth_maps = false;
  std::vector<std::string> mesh_formats;
  bool refine_rig = false;
  std::string shard;
  bool overwrite = false;
};

/// The same for the library. InputError when they do not go together.
[[nodiscard]] SequenceOptions sequence_options(const ReconstructOptions& options);

/// Adds the options of `reconstruct` to a command: all but --shard and the common ones.
void add_reconstruct_options(CLI::App& command, ReconstructOptions& options);

}  // namespace pencilscan::cli
