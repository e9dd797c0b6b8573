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

/// The image of a camera; empty where there is no file.
cv::Mat read_camera_image(const Camera& camera, const std::optional<std::filesystem::path>& file) {
  if (!file) return {};
  cv::Mat image = read_image(*file);
  if (image.cols != camera.width || image.rows != camera.height) {
    throw InputError(
        file->string(), "image size", std::to_string(image.cols) + "x" + std::to_string(image.rows),
        "must be " + std::to_string(camera.width) + "x" + std::to_string(camera.height) +
            " as camera " + camera.name + " of the rig");
  }
  return image;
}

}  // namespace

std::vector<FrameFiles> find_frames(const Rig& rig, const std::filesystem::path& folder) {
  if (!std::filesystem::is_directory(folder)) {
    throw InputError(folder.string(), "", "", "must be a folder that holds frame folders");
  }
  std::vector<FrameFiles> frames;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.is_directory()) frames.push_back({entry.path().filename().string(), {}, {}});
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

void add_plain_frames(const Rig& rig, const std::filesystem::path& folder,
                      std::vector<FrameFiles>& frames) {
  const std::vector<FrameFiles> plain = find_frames(rig, folder);
  for (FrameFiles& frame : frames) {
    const auto own = std::find_if(plain.begin(), plain.end(),
                                  [&](const FrameFiles& p) { return p.name == frame.name; });
    if (own == plain.end() && plain.size() > 1) {
      throw InputError(folder.string(), "frame folders", std::to_string(plain.size()),
                       "must hold one named " + frame.name + ", or one in all");
    }
    frame.plain = (own == plain.end() ? plain.front() : *own).images;
  }
}

Frame read_frame(const Rig& rig, const FrameFiles& files) {
  Frame frame;
  frame.name = files.name;
  for (std::size_t c = 0; c < files.images.size(); ++c)
    frame.images.push_back(read_camera_image(rig.cameras[c], files.images[c]));
  for (std::size_t c = 0; c < files.plain.size(); ++c)
    frame.plain.push_back(read_camera_image(rig.cameras[c], files.plain[c]));
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
  for (const auto* images : {&files.images, &files.plain}) {
    for (const auto& image : *images)
      hash = image ? hash_bytes(read_file(*image), hash) : hash_bytes("missing", hash);
  }
  return hash;
}

}  // namespace pencilscan
