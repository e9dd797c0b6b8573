#include "pencilscan/view/unmix.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

/// Of a colour's lines; directions of fewer, each known to some hundredths, are not known to .002.
constexpr std::size_t kMinimumSamples = 200;

/// What the lines of one colour look like in the camera.
struct LineColor {
  Rgb projected{};
  Eigen::Vector3f direction;  ///< unit
  std::vector<Eigen::Vector3f> samples;
};

std::vector<LineColor> line_colors(const std::vector<ColorFamily>& families) {
  std::vector<LineColor> colors;
  for (const ColorFamily& family : families) {
    for (const PatternColor& color : family.colors) {
      const Rgb& rgb = color.light();
      const Eigen::Vector3f direction(static_cast<float>(rgb[0]), static_cast<float>(rgb[1]),
                                      static_cast<float>(rgb[2]));
      if (std::none_of(colors.begin(), colors.end(),
                       [&](const LineColor& c) { return c.projected == rgb; }))
        colors.push_back({rgb, direction.normalized(), {}});
    }
  }
  return colors;
}

/// Light of the image above the dark between the lines, all channels, where some channel is strong.
std::vector<Eigen::Vector3f> lit_samples(const cv::Mat& image) {
  constexpr float kStrong = 0.15F;  // of the brightest
  constexpr int kAround = 11;       // px of the halved image: holds a gap between two lines
  cv::Mat half_size;
  cv::pyrDown(image, half_size);
  cv::Mat dark;
  cv::erode(half_size, dark, cv::Mat::ones(kAround, kAround, CV_8U));
  const cv::Mat light = half_size - dark;
  const cv::Mat values = light.reshape(1);
  double peak = 0;
  cv::minMaxLoc(values, nullptr, &peak);
  std::vector<Eigen::Vector3f> samples;
  for (int y = 0; y < light.rows; ++y) {
    for (int x = 0; x < light.cols; ++x) {
      const auto& v = light.at<cv::Vec3f>(y, x);
      const float strongest = std::max({v[0], v[1], v[2]});
      if (strongest > kStrong * static_cast<float>(peak))
        samples.emplace_back(v[0] / strongest, v[1] / strongest, v[2] / strongest);
    }
  }
  return samples;
}

/// Mean of the densest quarter of the values (after Robertson and Cryer 1974).
float densest(std::vector<float> values) {
  std::sort(values.begin(), values.end());
  const std::size_t quarter = values.size() / 4;
  std::size_t best = 0;
  for (std::size_t i = 0; i + quarter < values.size(); ++i) {
    if (values[i + quarter] - values[i] < values[best + quarter] - values[best]) best = i;
  }
  const auto first = values.begin() + static_cast<std::ptrdiff_t>(best);
  return std::accumulate(first, first + static_cast<std::ptrdiff_t>(quarter), 0.F) /
         static_cast<float>(quarter);
}

/// Gives every sample to the colour it looks most like and turns the colours to what their samples
/// look like, starting from what was projected. Samples between two colours (crossings) belong to
/// none; with more rounds, a colour could slide to where the crossings are.
void find_line_colors(const std::vector<Eigen::Vector3f>& samples, std::vector<LineColor>& colors) {
  constexpr int kRounds = 2;
  constexpr float kFarthest = 0.1F;  // squared distance of unit vectors
  constexpr float kClearer = 1.5F;   // squared distance of the next colour
  for (int round = 0; round < kRounds; ++round) {
    for (LineColor& color : colors) color.samples.clear();
    for (const Eigen::Vector3f& sample : samples) {
      const Eigen::Vector3f unit = sample.normalized();
      float best = std::numeric_limits<float>::max();
      float second = best;
      LineColor* nearest = nullptr;
      for (LineColor& color : colors) {
        const float d = (unit - color.direction).squaredNorm();
        if (d < best) {
          second = best;
          best = d;
          nearest = &color;
        } else {
          second = std::min(second, d);
        }
      }
      if (best < kFarthest && second > kClearer * best) nearest->samples.push_back(sample);
    }
    for (LineColor& color : colors) {
      if (color.samples.size() < kMinimumSamples) continue;
      // Light of other lines only adds to a channel: the densest values are those without.
      Eigen::Vector3f middle;
      for (Eigen::Index c = 0; c < 3; ++c) {
        std::vector<float> values;
        for (const Eigen::Vector3f& s : color.samples) values.push_back(s.normalized()[c]);
        middle[c] = densest(std::move(values));
      }
      color.direction = middle.normalized();
    }
  }
}

/// What channel c shows of the two others, where it was not projected itself: least squares over
/// the colours without c.
Eigen::Vector2d leak_coefficients(const std::vector<LineColor>& colors, std::size_t c) {
  constexpr double kPrior = 1e-3;       // towards no leak, where one colour alone says little
  constexpr double kLargestLeak = 0.6;  // filters of cameras overlap by less; chosen
  Eigen::Matrix2d N = Eigen::Matrix2d::Zero();
  Eigen::Vector2d r(0, 0);
  for (const LineColor& color : colors) {
    if (color.projected[c] != 0 || color.samples.size() < kMinimumSamples) continue;
    const Eigen::Vector3d d = color.direction.cast<double>();
    const Eigen::Vector2d others(d[static_cast<Eigen::Index>((c + 1) % 3)],
                                 d[static_cast<Eigen::Index>((c + 2) % 3)]);
    N += others * others.transpose();
    r += others * d[static_cast<Eigen::Index>(c)];
  }
  N.diagonal().array() += kPrior * N.trace() + 1e-12;
  return (N.inverse() * r).cwiseMax(0).cwiseMin(kLargestLeak);
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
  std::vector<LineColor> colors = line_colors(families);
  find_line_colors(lit_samples(image), colors);
  Mat3 camera_from_projector = Mat3::Identity();
  for (std::size_t c = 0; c < 3; ++c) {
    const bool is_dark_somewhere =
        std::any_of(colors.begin(), colors.end(), [&](const auto& color) {
          return color.projected[c] == 0 && color.samples.size() >= kMinimumSamples;
        });
    if (!is_dark_somewhere) continue;
    const Eigen::Vector2d leak = leak_coefficients(colors, c);
    const auto row = static_cast<Eigen::Index>(c);
    camera_from_projector(row, (row + 1) % 3) = leak[0];
    camera_from_projector(row, (row + 2) % 3) = leak[1];
    result.estimated = true;
  }
  result.projector_from_camera = camera_from_projector.inverse();
  return result;
}

cv::Mat mixed(const cv::Mat& colors, const Mat3& matrix) {
  cv::Matx33f m;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) m(i, j) = static_cast<float>(matrix(i, j));
  }
  cv::Mat result;
  cv::transform(colors, result, m);
  return result;
}

cv::Mat projector_light(const Camera& camera, const cv::Mat& linear, const Unmixing& unmixing,
                        cv::Point corner) {
  return registered(camera, mixed(linear, unmixing.projector_from_camera), corner);
}

cv::Mat presence_samples(const Camera& camera, const Unmixing& unmixing,
                         const ColorFamily& family) {
  if (!camera.mosaic || !camera.color_registration.none()) return {};
  const Eigen::RowVector3d share =
      (family.presence.transpose() * unmixing.projector_from_camera).cwiseAbs();
  Eigen::Index color = 0;
  if (2 * share.maxCoeff(&color) <= share.sum()) return {};
  cv::Mat samples(camera.height, camera.width, CV_8U);
  for (int y = 0; y < samples.rows; ++y) {
    auto* row = samples.ptr<std::uint8_t>(y);
    for (int x = 0; x < samples.cols; ++x) row[x] = camera.mosaic->color(x, y) == color ? 255 : 0;
  }
  return samples;
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
