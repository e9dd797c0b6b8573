#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// The image files of one frame folder.
struct FrameFiles {
  std::string name;                                          ///< of the folder
  std::vector<std::optional<std::filesystem::path>> images;  ///< one per camera of the rig
  std::vector<std::optional<std::filesystem::path>> plain;   ///< the same, or nothing at all
};

/// Frame folders below `folder`, by name. InputError when the folder is not there, holds no frame
/// folder, or a frame folder has no image of any camera of the rig.
[[nodiscard]] std::vector<FrameFiles> find_frames(const Rig& rig,
                                                  const std::filesystem::path& folder);

/// Gives every frame its images in plain light: those of the folder of its name below `folder`, or
/// of the only one there. InputError when a frame has none.
void add_plain_frames(const Rig& rig, const std::filesystem::path& folder,
                      std::vector<FrameFiles>& frames);

/// Reads a frame's images. InputError for a broken file or one of another size than its camera.
[[nodiscard]] Frame read_frame(const Rig& rig, const FrameFiles& files);

/// FNV-1a hash of the bytes of a frame's files, to tell whether an input is the same.
[[nodiscard]] std::uint64_t frame_hash(const FrameFiles& files);
[[nodiscard]] std::uint64_t hash_bytes(const std::string& bytes,
                                       std::uint64_t hash = 14695981039346656037ULL);

}  // namespace pencilscan
