#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/core/progress.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/frame_source.h"
#include "pencilscan/pipeline/refinement_output.h"
#include "pencilscan/pipeline/shard.h"

namespace pencilscan {

/// All that decides the bytes of a sequence's output, beside rig and pictures. Output of other
/// values is not resumed. Plain values, which core/fields.h lists one by one.
struct OutputOptions {
  FrameOptions frame;       ///< without meshes: points.ply and curves.ply alone, much faster
  bool refine_rig = false;  ///< correct the poses of the devices from the frames first
  bool tracks = false;      ///< where a surface rests, it takes the mean over the frames before
  bool pictures = true;
  bool depth_maps = false;                ///< depth/ and sigma/ of every camera
  std::vector<std::string> mesh_formats;  ///< of obj, stl, glb: the closed mesh once more
};

struct SequenceOptions {
  OutputOptions output;
  std::filesystem::path plain_frames;  ///< the same moments without patterns, for colour; or empty
  bool overwrite = false;              ///< replace the results of other inputs or options
  std::optional<Shard> shard;          ///< of several programs that share the frames; nothing: all
  /// Which program this is: output of another is not resumed. Programs with functions of their own
  /// in the options (JointOptions::inference) name those here too: nothing else tells them apart.
  std::string program;
};

struct FrameOutcome {
  std::string name;
  bool done = false;
  bool resumed = false;  ///< was there already, from the same inputs
  std::string failure;   ///< why not done
  std::size_t points = 0;
  double seconds = 0;
  std::vector<std::string> warnings;
};

struct SequenceOutcome {
  std::vector<FrameOutcome> frames;
  std::optional<RefinementOutcome> refinement;  ///< with refine_rig
  std::vector<std::string> warnings;            ///< of cameras over several frames
};

/// How many frames of a sequence are made at once. Half of a frame's time one thread works alone:
/// so as many again as the threads alone would fill, and no more than memory holds.
[[nodiscard]] std::size_t frames_at_once(const Rig& rig);

/// The frames that reconstruct_sequence would take; InputError where it would refuse rig, frames,
/// options or what `out` holds. Looks at no picture and writes nothing: for those who hand the
/// frames to several programs.
[[nodiscard]] FrameSource check_sequence(const std::filesystem::path& rig_path,
                                         const std::filesystem::path& frames,
                                         const std::filesystem::path& out,
                                         const SequenceOptions& options);

/// Reconstructs every frame of `frames` (image folders or a recording) into `out`/<frame>:
/// points.ply, mesh.ply, mesh_measured.ply, pictures/, timing.json, report.json; or failure.json
/// with the reason. A frame's folder appears whole or not at all. All input but the pictures
/// is checked before the first byte is written (InputError), and so is that some frame's pictures
/// can be read, but for a shard; a broken picture is a failure of its frame. A frame that fails
/// does not stop the others. A frame that is there already from the same rig, images and options is
/// kept; output of anything else is an InputError unless `overwrite`. With refine_rig the rig is
/// refined from all frames together (of a long sequence, from frames evenly picked) and written to
/// `out`/rig.json with refinement.json; where the frames do not determine it, that is the rig as
/// given. Several shards may run at once on one folder. A frame whose pictures change while it is
/// made is a failed one.
[[nodiscard]] SequenceOutcome reconstruct_sequence(const std::filesystem::path& rig_path,
                                                   const std::filesystem::path& frames,
                                                   const std::filesystem::path& out,
                                                   const SequenceOptions& options,
                                                   const Progress& progress = {});

}  // namespace pencilscan
