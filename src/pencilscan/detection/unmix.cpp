#include "pencilscan/detection/unmix.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace pencilscan {
namespace {

constexpr double kRidgeSigmaPx = 1.3;
/// A channel that shows less than this share of the strongest one is taken for crosstalk.
constexpr float kCrosstalkLimit = 0.3F;
constexpr std::size_t kMinimumSamples = 200;

/// -Laplacian of Gaussian of one channel: positive on lines of any direction.
cv::Mat ridge_strength(const cv::Mat& channel) {
  cv::Mat smooth;
  cv::GaussianBlur(channel, smooth, {}, kRidgeSigmaPx);
  cv::Mat laplacian;
  cv::Laplacian(smooth, laplacian, CV_32F, 1);
  return -laplacian;
}

/// True when some family has a colour without channel c, that is where c can be seen to be zero.
bool can_be_dark(const std::vector<ColorFamily>& families, std::size_t c) {
  for (const ColorFamily& family : families) {
    for (const std::string& color : family.colors) {
      if (color_from_name(color).value_or(Rgb{1, 1, 1})[c] == 0) return true;
    }
  }
  return false;
}

/// Coefficients of channel c on the two others, from samples where c ought to be zero.
/// Three rounds of least squares, each keeping what lies near the last fit.
Eigen::Vector2d leak_coefficients(const std::vector<Eigen::Vector3f>& samples, int c) {
  const int a = (c + 1) % 3;
  const int b = (c + 2) % 3;
  Eigen::Vector2d leak(0, 0);
  float tolerance = kCrosstalkLimit;
  for (int round = 0; round < 4; ++round) {
    Eigen::Matrix2d N = 1e-12 * Eigen::Matrix2d::Identity();
    Eigen::Vector2d r(0, 0);
    std::size_t used = 0;
    for (const Eigen::Vector3f& s : samples) {
      const float strongest = std::max(s[a], s[b]);
      const Eigen::Vector2d others(std::max(0.F, s[a]), std::max(0.F, s[b]));
      const double residual = s[c] - leak.dot(others);
      if (std::abs(residual) > tolerance * strongest) continue;
      N += others * others.transpose() / (strongest * strongest);
      r += others * s[c] / (strongest * strongest);
      ++used;
    }
    if (used < kMinimumSamples) return {0, 0};
    leak = N.inverse() * r;
    leak = leak.cwiseMax(0).cwiseMin(0.4);
    tolerance *= 0.6F;
  }
  return leak;
}

Mat3 stated_matrix(const Camera& camera, const Rig& rig) {
  Mat3 sum = Mat3::Zero();
  for (const Projector& projector : rig.projectors) sum += camera.color_matrix_for(projector.name);
  return sum / static_cast<double>(rig.projectors.size());
}

}  // namespace

Unmixing estimate_unmixing(const Camera& camera, const Rig& rig,
                           const std::vector<ColorFamily>& families, const cv::Mat& image) {
  Unmixing result;
  if (camera.states_color_matrix()) {
    result.projector_from_camera = stated_matrix(camera, rig).inverse();
    return result;
  }
  std::vector<cv::Mat> channels;
  cv::split(image, channels);
  std::array<cv::Mat, 3> ridge;
  for (std::size_t c = 0; c < 3; ++c) ridge[c] = ridge_strength(channels[c]);
  cv::Mat strongest = cv::max(ridge[0], cv::max(ridge[1], ridge[2]));
  double peak = 0;
  cv::minMaxLoc(strongest, nullptr, &peak);
  const auto threshold = static_cast<float>(0.1 * peak);

  Mat3 camera_from_projector = Mat3::Identity();
  for (int c = 0; c < 3; ++c) {
    if (!can_be_dark(families, static_cast<std::size_t>(c))) continue;
    std::vector<Eigen::Vector3f> samples;
    for (int y = 0; y < image.rows; y += 2) {
      for (int x = 0; x < image.cols; x += 2) {
        if (strongest.at<float>(y, x) < threshold) continue;
        const Eigen::Vector3f s(ridge[0].at<float>(y, x), ridge[1].at<float>(y, x),
                                ridge[2].at<float>(y, x));
        const float others = std::max(s[(c + 1) % 3], s[(c + 2) % 3]);
        if (others < threshold || std::abs(s[c]) > kCrosstalkLimit * others) continue;
        samples.push_back(s);
      }
    }
    if (samples.size() < kMinimumSamples) continue;
    const Eigen::Vector2d leak = leak_coefficients(samples, c);
    camera_from_projector(c, (c + 1) % 3) = leak[0];
    camera_from_projector(c, (c + 2) % 3) = leak[1];
    result.estimated = true;
  }
  result.projector_from_camera = camera_from_projector.inverse();
  return result;
}

cv::Mat linearized(const cv::Mat& image, double gamma) {
  if (gamma == 1) return image;
  cv::Mat linear;
  cv::pow(cv::max(image, 0.0), gamma, linear);
  return linear;
}

cv::Mat unmixed(const cv::Mat& image, const Unmixing& unmixing) {
  cv::Matx33f matrix;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      matrix(i, j) = static_cast<float>(unmixing.projector_from_camera(i, j));
  }
  cv::Mat result;
  cv::transform(image, result, matrix);
  return result;
}

cv::Mat presence_image(const cv::Mat& unmixed_image, const ColorFamily& family) {
  const cv::Matx13f weights(static_cast<float>(family.presence[0]),
                            static_cast<float>(family.presence[1]),
                            static_cast<float>(family.presence[2]));
  cv::Mat result;
  cv::transform(unmixed_image, result, weights);
  return result;
}

}  // namespace pencilscan
