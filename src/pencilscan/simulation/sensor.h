#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <string_view>

#include "pencilscan/geometry/types.h"
#include "pencilscan/io/mosaic.h"

namespace pencilscan {

/// From linear light to stored numbers, in this order: crosstalk, blur, mosaic, shot noise, read
/// noise, gain, interpolation of the mosaic, clipping, gamma, black level, rounding to bit_depth.
struct SensorOptions {
  double crosstalk = 0;  ///< share of a channel's light that the others take, in [0, 0.5)

  double blur_px = 0;            ///< standard deviation of a Gaussian, px, >= 0
  double full_well = 0;          ///< electrons at value 1; 0: no shot noise
  double read_noise = 0;         ///< standard deviation in 1/255 of the range, >= 0
  double gain = 1;               ///< factor after the noise, > 0
  double gamma = 1;              ///< stored = linear^(1 / gamma), > 0
  double black_level = 0;        ///< stored value of no light, in [0, 1); noise reaches below it
  std::optional<Mosaic> mosaic;  ///< of RGB light, one colour a pixel is kept
  bool interpolated = false;     ///< the colours that the mosaic leaves out are filled in
  int bit_depth = 8;             ///< 8 or 16
};

/// A sensor with the room it works in.
struct SensorPreset {
  SensorOptions sensor;
  double ambient = 0;  ///< RenderOptions::ambient
};
/// Typical ones: none, low, medium, high; nothing for another name.
[[nodiscard]] std::optional<SensorPreset> sensor_preset(std::string_view name);

/// Camera RGB = matrix * light RGB. Rows add up to 1: grey stays grey. Neighbouring filters leak
/// more than red and blue: of the share c, green takes 3/4 c from red and blue, they 1/4 c of each
/// other; green loses c/2 to each.
[[nodiscard]] Mat3 crosstalk_matrix(double crosstalk);

/// `linear`: CV_32FC1 or CV_32FC3 (RGB). Result: 8U or 16U with the same channels, or
/// with one where a mosaic is not interpolated. Noise comes from
/// `seed` and `image` (a number of its own for every image of a run), one random stream per row.
[[nodiscard]] cv::Mat apply_sensor(const cv::Mat& linear, const SensorOptions& options,
                                   std::uint64_t seed = 1, std::uint32_t image = 0);

}  // namespace pencilscan
