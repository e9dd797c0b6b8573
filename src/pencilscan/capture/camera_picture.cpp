#include "pencilscan/capture/camera_picture.h"

#include <opencv2/imgproc.hpp>

#include "pencilscan/capture/sensor_pixels.h"
#include "pencilscan/core/error.h"

namespace pencilscan {

cv::Mat picture_to_see(const CameraFrame& frame) {
  if (frame.mosaic.empty()) return frame.image;
  const int code = frame.mosaic == "RGGB"   ? cv::COLOR_BayerRGGB2RGB
                   : frame.mosaic == "BGGR" ? cv::COLOR_BayerBGGR2RGB
                   : frame.mosaic == "GRBG" ? cv::COLOR_BayerGRBG2RGB
                                            : cv::COLOR_BayerGBRG2RGB;
  cv::Mat color;
  cv::demosaicing(frame.image, color, code);
  return color;
}

cv::Mat picture_for_files(const Camera& camera, const CameraFrame& frame) {
  if (!camera.mosaic) return picture_to_see(frame);
  if (!frame.mosaic.empty() && frame.mosaic != camera.mosaic->name())
    throw StageError(camera.name + " delivers " + frame.mosaic + "; the rig states the mosaic " +
                     camera.mosaic->name());
  return frame.image;
}

int channels_for_files(const Camera& camera, const CameraSettings& made) {
  const auto layout = layout_from_genicam(made.pixel_format.value_or(""));
  if (!layout) return camera.mosaic ? 1 : 3;
  return layout->mosaic.empty() || camera.mosaic ? layout->channels : 3;
}

void check_mosaic(const Camera& camera, const CameraSettings& made, const std::string& source) {
  if (!camera.mosaic || !made.pixel_format) return;
  const auto layout = layout_from_genicam(*made.pixel_format);
  if (!layout || layout->mosaic == camera.mosaic->name()) return;
  throw InputError(source, "cameras." + camera.name + ".pixel_format", *made.pixel_format,
                   "must have the mosaic that the rig states for " + camera.name + ", " +
                       camera.mosaic->name() + "; the camera delivers " +
                       (layout->mosaic.empty() ? "none" : layout->mosaic));
}

}  // namespace pencilscan
