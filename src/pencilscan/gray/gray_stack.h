#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "pencilscan/geometry/device.h"
#include "pencilscan/pattern/gray_code.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// What one camera saw of one projector's Gray-code sequence, reduced to what decoding needs: grey
/// (CV_32FC1), or one stack of all three channels (CV_32FC3, not to be decoded as it is).
struct GrayStack {
  cv::Mat white;  ///< [0, 1]
  cv::Mat black;
  bool inverses = true;  ///< each bit was shown with its inverse
  int panel_width = 0;   ///< px of the projector
  int panel_height = 0;  ///< px
  /// [axis][bit], bit 0 the least significant: pattern - inverse, or
  /// 2 pattern - white - black without inverses. About +-(white - black).
  std::array<std::vector<cv::Mat>, 2> difference;
};

/// The stack of images in the order of gray_code_sequence(panel_width, panel_height, inverses),
/// each of one size and type; the images are those that `image(i)` returns.
[[nodiscard]] GrayStack make_gray_stack(int panel_width, int panel_height, bool inverses,
                                        const std::function<cv::Mat(std::size_t)>& image);

/// One folder <captures>/<projector>/<camera> with its files in order.
struct CapturePair {
  std::size_t projector = 0;  ///< index in the rig
  std::size_t camera = 0;     ///< index in the rig
  bool inverses = true;
  double range = 1;  ///< of its values in [0, 1]: sensor_range() (rig/camera_light.h)
  std::filesystem::path folder;
  std::vector<std::filesystem::path> files;
  /// Those of solid_images() that are there, by name.
  std::map<std::string, std::filesystem::path> solids;
};

/// All pairs of a captures folder, projectors first. A camera that lacks a folder is left out.
/// InputError when the folder is missing or empty of captures, when a folder carries a name that
/// the rig does not know, or the images are not as many as the projector's size asks for.
[[nodiscard]] std::vector<CapturePair> list_captures(const std::filesystem::path& captures,
                                                     const Rig& rig);

/// One image of a pair, in its range without its black level, gamma as stored, CV_32FC3 RGB; the
/// colours that a mosaic leaves out are interpolated. InputError when its size is not the camera's.
[[nodiscard]] cv::Mat read_color_image(const CapturePair& pair, const std::filesystem::path& path,
                                       const Camera& camera);
/// One image of a pair as grey. InputError when its size is not the camera's.
[[nodiscard]] cv::Mat read_gray_image(const CapturePair& pair, const Rig& rig, std::size_t image);
/// Reads one pair's images; colour becomes grey. InputError when an image's size is not the
/// camera's.
[[nodiscard]] GrayStack read_gray_stack(const CapturePair& pair, const Rig& rig);

}  // namespace pencilscan
