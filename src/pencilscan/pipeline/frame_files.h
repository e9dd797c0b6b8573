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
  std::vector<std::string> strangers = {};  ///< pictures that are named like no camera of the rig
};

/// Frame folders below `folder`, in the order of frame_folder_names(); some may have no image of
/// any camera of the rig. InputError when the folder is not there, holds no frame folder, when no
/// frame folder has such an image, or one has a name that is not UTF-8, which no report could hold.
[[nodiscard]] std::vector<FrameFiles> find_frames(const Rig& rig,
                                                  const std::filesystem::path& folder);

/// Reads a frame's images. InputError for a broken file or one of another size than its camera.
[[nodiscard]] std::vector<cv::Mat> read_images(const Rig& rig, const FrameFiles& files);

/// The hashes of the bytes of a frame's files, one per camera, 0 where there is none.
[[nodiscard]] std::vector<std::uint64_t> file_hashes(const FrameFiles& files);

/// "cam0, cam1", for messages.
[[nodiscard]] std::string camera_names(const Rig& rig);

}  // namespace pencilscan
