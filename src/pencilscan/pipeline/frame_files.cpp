#include "pencilscan/pipeline/frame_files.h"

#include <algorithm>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"

namespace pencilscan {
namespace {

std::string camera_names(const Rig& rig) {
  std::string names;
  for (const Camera& camera : rig.cameras) names += (names.empty() ? "" : ", ") + camera.name;
  return names;
}

}  // namespace

std::vector<FrameFiles> find_frames(const Rig& rig, const std::filesystem::path& folder) {
  if (!std::filesystem::is_directory(folder)) {
    throw InputError(folder.string(), "", "", "must be a folder that holds frame folders");
  }
  std::vector<FrameFiles> frames;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.is_directory()) frames.push_back({entry.path().filename().string(), {}});
  }
  if (frames.empty()) {
    throw InputError(folder.string(), "frame folders", "none",
                     "must hold at least one frame folder such as 000000");
  }
  std::sort(frames.begin(), frames.end(),
            [](const FrameFiles& a, const FrameFiles& b) { return a.name < b.name; });
  for (FrameFiles& frame : frames) {
    bool any = false;
    for (const Camera& camera : rig.cameras) {
      frame.images.push_back(find_image(folder / frame.name, camera.name));
      any = any || frame.images.back().has_value();
    }
    if (!any) {
      throw InputError((folder / frame.name).string(), "images", "none",
                       "must hold an image of a camera of the rig (" + camera_names(rig) + ")");
    }
  }
  return frames;
}

Frame read_frame(const Rig& rig, const FrameFiles& files) {
  Frame frame;
  frame.name = files.name;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    frame.images.emplace_back();
    if (!files.images[c]) continue;
    const Camera& camera = rig.cameras[c];
    frame.images.back() = read_image(*files.images[c]);
    const cv::Size size = frame.images.back().size();
    if (size.width != camera.width || size.height != camera.height) {
      throw InputError(files.images[c]->string(), "image size",
                       std::to_string(size.width) + "x" + std::to_string(size.height),
                       "must be " + std::to_string(camera.width) + "x" +
                           std::to_string(camera.height) + " as camera " + camera.name +
                           " of the rig");
    }
  }
  return frame;
}

std::uint64_t hash_bytes(const std::string& bytes, std::uint64_t hash) {
  for (const char byte : bytes) {
    hash ^= static_cast<unsigned char>(byte);
    hash *= 1099511628211ULL;
  }
  return hash;
}

std::uint64_t frame_hash(const FrameFiles& files) {
  std::uint64_t hash = hash_bytes(files.name);
  for (const auto& image : files.images) {
    hash = image ? hash_bytes(read_file(*image), hash) : hash_bytes("missing", hash);
  }
  return hash;
}

}  // namespace pencilscan
