#include "pencilscan/pipeline/frame_files.h"

#include <algorithm>

#include "pencilscan/core/error.h"
#include "pencilscan/core/lower_case.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/found_files.h"
#include "pencilscan/io/hash.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/json_text.h"
#include "pencilscan/recording/frame_folders.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {
namespace {

/// A file that would be the camera's but for capitals is not passed over in silence.
void refuse_other_case(const std::filesystem::path& folder, const std::string& camera) {
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string stem = entry.path().stem().string();
    if (stem == camera || lower_case(stem) != lower_case(camera)) continue;
    throw InputError(folder.string(), camera, entry.path().filename().string(),
                     "must be named like the camera, " + camera + ".png");
  }
}

}  // namespace

std::string camera_names(const Rig& rig) {
  std::string names;
  for (const Camera& camera : rig.cameras) add_name(names, camera.name);
  return names;
}

std::vector<FrameFiles> find_frames(const Rig& rig, const std::filesystem::path& folder) {
  std::vector<FrameFiles> frames;
  for (std::string& name : frame_folder_names(folder)) frames.push_back({std::move(name), {}, {}});
  bool any = false;
  for (FrameFiles& frame : frames) {
    if (!is_utf8(frame.name))
      throw InputError(folder.string(), "frame folder", frame.name, "must have a name in UTF-8");
    const FolderImages images(folder / frame.name);
    for (const Camera& camera : rig.cameras) {
      frame.images.push_back(images.find(camera.name));
      any = any || frame.images.back().has_value();
    }
    for (std::string& stem : images.stems()) {
      const bool is_known = std::any_of(rig.cameras.begin(), rig.cameras.end(),
                                        [&](const Camera& camera) { return camera.name == stem; });
      if (!is_known) frame.strangers.push_back(std::move(stem));
    }
    for (std::size_t c = 0; c < rig.cameras.size(); ++c)
      if (!frame.images[c]) refuse_other_case(folder / frame.name, rig.cameras[c].name);
  }
  if (!any) {
    const std::filesystem::path first = folder / frames.front().name;
    throw InputError(first.string(), "images", "none",
                     "must hold an image of a camera of the rig (" + camera_names(rig) +
                         "), named like it, as " + rig.cameras.front().name + ".png; " +
                         holdings(first));
  }
  return frames;
}

std::vector<cv::Mat> read_images(const Rig& rig, const FrameFiles& files) {
  std::vector<cv::Mat> images(files.images.size());
  run_at_once(images.size(), static_cast<std::size_t>(thread_count()), [&](std::size_t c) {
    if (files.images[c]) images[c] = read_camera_image(rig.cameras[c], *files.images[c]);
  });
  return images;
}

std::vector<std::uint64_t> file_hashes(const FrameFiles& files) {
  std::vector<std::uint64_t> hashes;
  for (const auto& image : files.images)
    hashes.push_back(image ? hash_bytes(read_file(*image)) : 0);
  return hashes;
}

}  // namespace pencilscan
