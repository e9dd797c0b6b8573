#include "pencilscan/simulation/sensor.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/check.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

/// Number of photo-electrons for a mean: exact Poisson (product of uniforms, Knuth, TAOCP 2, 3.4.1)
/// where it is small, its normal limit elsewhere (at a mean of 30 the skewness left out is 0.18).
double photo_electrons(Random& random, double mean) {
  constexpr double kExactBelow = 30;
  if (mean >= kExactBelow) return mean + std::sqrt(mean) * random.normal();
  if (mean <= 0) return 0;
  const double limit = std::exp(-mean);
  double product = random.uniform();
  int count = 0;
  while (product > limit) {
    product *= random.uniform();
    ++count;
  }
  return count;
}

cv::Mat blurred(const cv::Mat& image, double sigma_px) {
  if (sigma_px <= 0) return image;
  const int size = 2 * static_cast<int>(std::ceil(4 * sigma_px)) + 1;
  cv::Mat result;
  cv::GaussianBlur(image, result, cv::Size(size, size), sigma_px, sigma_px, cv::BORDER_REPLICATE);
  return result;
}

/// Colour filters leak into each other, in place.
void mix_channels(cv::Mat& image, const SensorOptions& options) {
  if (image.channels() != 3 || options.crosstalk == 0) return;
  const Eigen::Matrix3f mix = crosstalk_matrix(options.crosstalk).cast<float>();
  parallel_for(static_cast<std::size_t>(image.rows), [&](std::size_t row) {
    float* values = image.ptr<float>(static_cast<int>(row));
    for (int x = 0; x < image.cols; ++x, values += 3) {
      const Eigen::Vector3f mixed = mix * Eigen::Vector3f(values[0], values[1], values[2]);
      std::copy_n(mixed.data(), 3, values);
    }
  });
}

/// What the sensor reads of one linear value.
double expose(double linear, const SensorOptions& options, Random& random) {
  double value = std::max(0.0, linear);
  if (options.full_well > 0) {
    value = photo_electrons(random, value * options.full_well) / options.full_well;
  }
  if (options.read_noise > 0) value += options.read_noise / 255 * random.normal();
  return value * options.gain;
}

/// Stored value in [0, 1] of what was read.
double encode(double value, const SensorOptions& options) {
  const double black = options.black_level;
  value = std::clamp(value, options.gamma == 1 ? -black / (1 - black) : 0.0, 1.0);
  if (options.gamma != 1) value = std::pow(value, 1 / options.gamma);
  return black + (1 - black) * value;
}

/// Integers of an image like `light`: read(y, encode_next) hands on the values of row y in order.
template <class Read>
cv::Mat stored_rows(const cv::Mat& light, const SensorOptions& options, Read read) {
  const bool wide = options.bit_depth == 16;
  const double top = wide ? 65535 : 255;
  cv::Mat stored(light.size(), CV_MAKETYPE(wide ? CV_16U : CV_8U, light.channels()));
  parallel_for(static_cast<std::size_t>(light.rows), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    int i = 0;
    read(y, [&](double value) {
      const long number = std::lround(top * encode(value, options));
      if (wide) {
        stored.ptr<std::uint16_t>(y)[i++] = static_cast<std::uint16_t>(number);
      } else {
        stored.ptr<std::uint8_t>(y)[i++] = static_cast<std::uint8_t>(number);
      }
    });
  });
  return stored;
}

}  // namespace

std::optional<SensorPreset> sensor_preset(std::string_view name) {
  const auto preset = [](double crosstalk, double ambient, double blur_px, double full_well,
                         double read_noise) {
    SensorPreset result;
    result.ambient = ambient;
    result.sensor.crosstalk = crosstalk;
    result.sensor.blur_px = blur_px;
    result.sensor.full_well = full_well;
    result.sensor.read_noise = read_noise;
    return result;
  };
  if (name == "none") return SensorPreset{};
  if (name == "low") return preset(0.03, 0.005, 0.5, 20000, 0.5);
  if (name == "medium") return preset(0.08, 0.01, 0.7, 6000, 1.5);
  if (name == "high") return preset(0.12, 0.03, 1.0, 2500, 3);
  return std::nullopt;
}

Mat3 crosstalk_matrix(double c) {
  Mat3 matrix;
  matrix << 1 - c, 0.75 * c, 0.25 * c,  //
      0.5 * c, 1 - c, 0.5 * c,          //
      0.25 * c, 0.75 * c, 1 - c;
  return matrix;
}

cv::Mat apply_sensor(const cv::Mat& linear, const SensorOptions& options, std::uint64_t seed,
                     std::uint32_t image) {
  PENCILSCAN_CHECK(linear.type() == CV_32FC1 || linear.type() == CV_32FC3);
  PENCILSCAN_CHECK(options.bit_depth == 8 || options.bit_depth == 16);
  cv::Mat light = linear.clone();
  mix_channels(light, options);
  light = blurred(light, options.blur_px);
  const bool has_mosaic = options.mosaic && light.channels() == 3;
  if (has_mosaic) light = sampled(light, *options.mosaic);
  const auto noise_of_row = [&](int y) {
    return Random(seed, (static_cast<std::uint64_t>(image) << 32U) | static_cast<std::uint64_t>(y));
  };
  if (!has_mosaic || !options.interpolated) {
    return stored_rows(light, options, [&](int y, auto encode_next) {
      Random random = noise_of_row(y);
      const float* in = light.ptr<float>(y);
      for (int i = 0; i < light.cols * light.channels(); ++i)
        encode_next(expose(in[i], options, random));
    });
  }
  parallel_for(static_cast<std::size_t>(light.rows), [&](std::size_t row) {
    Random random = noise_of_row(static_cast<int>(row));
    float* values = light.ptr<float>(static_cast<int>(row));
    for (int i = 0; i < light.cols; ++i)
      values[i] = static_cast<float>(expose(values[i], options, random));
  });
  light = demosaiced(light, *options.mosaic);
  return stored_rows(light, options, [&](int y, auto encode_next) {
    const float* in = light.ptr<float>(y);
    for (int i = 0; i < light.cols * light.channels(); ++i) encode_next(in[i]);
  });
}

}  // namespace pencilscan
