#include "pencilscan/pipeline/sensor_frame.h"

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pencilscan/core/parallel.h"
#include "pencilscan/detection/mosaic_trace.h"

namespace pencilscan {
namespace {

/// The samples of a picture alone; a missing one stays missing.
void keep_samples(const Mosaic& mosaic, std::vector<cv::Mat>& images, std::size_t c) {
  if (c < images.size() && !images[c].empty()) images[c] = sampled(images[c], mosaic);
}

}  // namespace

SensorFrame sensor_frame(Rig rig, Frame frame) {
  SensorFrame result{std::move(rig), std::move(frame)};
  std::vector<Camera>& cameras = result.rig.cameras;
  std::vector<std::optional<Mosaic>> mosaics(cameras.size());
  parallel_for(cameras.size(), [&](std::size_t c) {
    const cv::Mat& image = result.frame.images[c];
    const bool has_colors = image.channels() == 3 && !cameras[c].mosaic;
    if (image.empty() || !has_colors || cameras[c].sees_texture_only) return;
    mosaics[c] = mosaic_behind(cameras[c], image);
    if (!mosaics[c]) return;
    keep_samples(*mosaics[c], result.frame.images, c);
    keep_samples(*mosaics[c], result.frame.plain, c);
  });
  std::string names;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (!mosaics[c]) continue;
    cameras[c].mosaic = mosaics[c];
    names += (names.empty() ? "" : ", ") + cameras[c].name + " (" + mosaics[c]->name() + ")";
  }
  if (!names.empty()) {
    result.frame.notes.push_back(
        {WarningCode::kColorsFilledIn,
         "the colours of " + names +
             " were filled in behind a mosaic, whose samples stand in the pictures and "
             "are used instead: raw pictures, with \"mosaic\" in the rig, hold them in "
             "a third of the bytes"});
  }
  return result;
}

}  // namespace pencilscan
