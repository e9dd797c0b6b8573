#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/io/folder_lock.h"

namespace pencilscan {

/// What decides the output of a sequence beside the pictures of each frame: `<out>/inputs.json`.
struct RunInputs {
  std::string program;       ///< hash of the program
  std::string rig;           ///< hash of the rig's file
  std::string options;       ///< in words
  std::string refined_from;  ///< hash of the frames that the rig was refined from; empty: as given
  std::vector<std::string> frames;  ///< names of all frames, in order, whichever shard does them

  /// Hash of all but `frames`: output of other settings is not this output.
  [[nodiscard]] std::string settings() const;
};

/// True where `out` has an inputs.json, readable or not.
[[nodiscard]] bool has_run_inputs(const std::filesystem::path& out);
/// True for a folder that is not there or holds nothing but an inputs.json that another program is
/// writing, or was writing when it was killed.
[[nodiscard]] bool is_new_run(const std::filesystem::path& out);
/// InputError when the file is missing or none of this version.
[[nodiscard]] RunInputs read_run_inputs(const std::filesystem::path& out);
/// Writes it unless it is there with the same bytes.
void write_run_inputs(const std::filesystem::path& out, const RunInputs& inputs);

/// Why a frame could not be done: `<frame>/failure.json`.
struct FrameFailure {
  std::string reason;
  /// True where the same inputs may do better another time (full disk, too little memory); false
  /// where they are at fault.
  bool is_passing = false;
};

enum class FrameState {
  kMissing,  ///< nothing is there
  kDone,
  kFailed,
  kOther,  ///< made from other settings or pictures, or by something else
};

/// What is in a frame's folder.
struct FrameStatus {
  FrameState state = FrameState::kMissing;
  std::optional<FrameFailure> failure;
};

/// `images`: hash of the frame's pictures; nothing: whatever they are.
[[nodiscard]] FrameStatus frame_status(const std::filesystem::path& out, const std::string& frame,
                                       const std::string& settings,
                                       const std::optional<std::string>& images);

/// A frame's folder while it is made. It is filled under another name, and publish() gives it its
/// own: a frame is there whole or not at all, whatever ends the program, and when two programs make
/// the same one, the first is kept.
class FrameFolder {
 public:
  FrameFolder(const std::filesystem::path& out, std::string frame, const std::string& settings,
              const std::string& images);
  ~FrameFolder();  ///< removes what was not published
  FrameFolder(const FrameFolder&) = delete;
  FrameFolder& operator=(const FrameFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  void publish();

 private:
  void leave();

  std::filesystem::path out_;
  std::string frame_;
  std::filesystem::path path_;
  FolderLock lock_;
};

/// Publishes why a frame could not be done.
void write_failure(const std::filesystem::path& out, const std::string& frame,
                   const std::string& settings, const std::string& images,
                   const FrameFailure& failure);

/// InputError where something else than a result is in the place of a frame's: the frames
/// themselves, when `out` is their folder.
void check_replaceable(const std::filesystem::path& out, const std::string& frame);

/// Warns of results in `out` of frames that are none of `frames`: an earlier input had more.
[[nodiscard]] std::optional<std::string> strays_warning(const std::filesystem::path& out,
                                                        const std::vector<std::string>& frames);

/// Removes what programs left behind that were killed while making a frame; not what one is making
/// now.
void remove_abandoned(const std::filesystem::path& out);

}  // namespace pencilscan
