#include "pencilscan/cli/rendered_light.h"

#include <optional>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/io/image.h"
#include "pencilscan/recording/frame_folders.h"

namespace pencilscan::cli {

namespace fs = std::filesystem;

RenderedLight::RenderedLight(fs::path folder, const Rig& rig, int frame_count)
    : folder_(std::move(folder)) {
  for (int frame = 0; frame < frame_count; ++frame) {
    for (const Camera& camera : rig.cameras)
      (void)file(six_digits(static_cast<std::size_t>(frame)), camera);
  }
}

cv::Mat RenderedLight::read(const std::string& frame, const Camera& camera) const {
  const fs::path path = file(frame, camera);
  cv::Mat light = read_image(path);
  if (light.cols != camera.width || light.rows != camera.height) {
    throw InputError(path.string(), "size", size_text(light.cols, light.rows),
                     "must be that of " + camera.name + " in the rig, " +
                         size_text(camera.width, camera.height));
  }
  return light;
}

fs::path RenderedLight::file(const std::string& frame, const Camera& camera) const {
  const std::optional<fs::path> found = find_image(folder_ / frame, camera.name);
  if (!found) {
    throw InputError("--light", "", (folder_ / frame / (camera.name + ".png")).string(),
                     "must be there: one picture of linear light per frame and camera");
  }
  return *found;
}

}  // namespace pencilscan::cli
