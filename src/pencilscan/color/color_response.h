#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// A number with one standard deviation.
struct MeasuredNumber {
  double value = 0;
  double sigma = 0;
};

/// Gamma of a camera, linear = value^gamma, from images of a pattern and of its inverse. Where an
/// edge of the pattern passes through a pixel, both show part of the light, and light adds up:
///   pattern^gamma + inverse^gamma = white^gamma + black^gamma,
/// whatever the surface, the projector and indirect light do. One root per such pixel, and their
/// median; the lamp's flicker between images is taken out by the pixels that one image lights for
/// the most part, by the same sum.
/// Images CV_32FC1, [0, 1]. Nothing with less than a few hundred such pixels.
[[nodiscard]] std::optional<MeasuredNumber> camera_gamma(
    const cv::Mat& white, const cv::Mat& black,
    std::span<const std::pair<cv::Mat, cv::Mat>> pattern_and_inverse);

/// How one camera shows the colours of one projector.
struct ColorResponse {
  /// camera RGB = matrix * projector RGB. Every row adds up to 1: the object's colour and the white
  /// balance are not told apart.
  Mat3 matrix = Mat3::Identity();
  Mat3 matrix_sigma = Mat3::Zero();
  std::optional<MeasuredNumber> projector_gamma;  ///< light = value^gamma of the projected image
};

/// From even images, linear light (CV_32FC3 RGB), named as solid_images(): red, green and blue for
/// the matrix; the greys for the projector. The light of each colour above black, over that of all
/// three, pixel by pixel: neither albedo nor shading counts. Nothing where a colour is missing or
/// too few pixels are lit.
[[nodiscard]] std::optional<ColorResponse> color_response(
    const cv::Mat& white, const cv::Mat& black, const std::map<std::string, cv::Mat>& solids);

}  // namespace pencilscan
