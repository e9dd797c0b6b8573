#pragma once

#include <filesystem>

#include "pencilscan/io/image.h"
#include "pencilscan/pipeline/frame_files.h"

namespace pencilscan {

/// The frame in a folder, which gives it its name; cameras without a picture there have none.
inline Frame read_frame(const Rig& rig, const std::filesystem::path& folder) {
  Frame frame;
  frame.name = folder.filename().string();
  FrameFiles files{frame.name, {}, {}};
  for (const Camera& camera : rig.cameras) files.images.push_back(find_image(folder, camera.name));
  frame.images = read_images(rig, files);
  return frame;
}

}  // namespace pencilscan
