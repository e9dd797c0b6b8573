#include "pencilscan/pipeline/sensor_frame.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/detection/mosaic_trace.h"
#include "pencilscan/io/image.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {
namespace {

/// The samples of a picture alone; a missing one stays missing.
void keep_samples(const Mosaic& mosaic, std::vector<cv::Mat>& images, std::size_t c) {
  if (c < images.size() && !images[c].empty()) images[c] = sampled(images[c], mosaic);
}

bool is_of_16_bits(const cv::Mat& image) { return !image.empty() && image.depth() == CV_16U; }

/// Of all cameras alike, so that their light compares.
double range_of(const std::vector<cv::Mat>& images) {
  double range = 0;
  for (const cv::Mat& image : images)
    if (is_of_16_bits(image)) range = std::max(range, sensor_range(image));
  return range == 0 ? 1 : range;
}

/// Values of a sensor with fewer bits than 16 fill the range, and its black is 0.
void fill_range(double range, double black, cv::Mat& image) {
  const double gain = 1 / (range - black);
  cv::Mat filled;
  image.convertTo(filled, CV_16U, gain, -gain * 65535 * black);
  image = filled;
}

/// `range`: of the frame's images.
void fill_range(double range, Rig& rig, Frame& frame) {
  const double plain_range = range_of(frame.plain);
  if (range == 1 && plain_range == 1) return;
  frame.gains.assign(rig.cameras.size(), 1);
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    Camera& camera = rig.cameras[c];
    const bool has_plain = c < frame.plain.size() && !frame.plain[c].empty();
    const bool are_of_16_bits = (frame.images[c].empty() || is_of_16_bits(frame.images[c])) &&
                                (!has_plain || is_of_16_bits(frame.plain[c]));
    if (!are_of_16_bits || camera.black_level >= std::min(range, plain_range)) continue;
    const double gain = (1 - camera.black_level) / (range - camera.black_level);
    frame.gains[c] = static_cast<float>(std::pow(gain, camera.gamma));
    if (!frame.images[c].empty()) fill_range(range, camera.black_level, frame.images[c]);
    if (has_plain) fill_range(plain_range, camera.black_level, frame.plain[c]);
    camera.black_level = 0;
  }
}

/// The median of a picture's values, from 0 to 1, where most of them lie below the black that the
/// rig states. Noise is as often above the right black as below it, however strong it is.
std::optional<double> median_below_black(const Camera& camera, const cv::Mat& stored,
                                         double range) {
  // Chosen: 2.5 steps of 8 bits, more than black is rounded or drifts by.
  constexpr double kMargin = 0.01;
  if (stored.empty() || camera.black_level == 0) return std::nullopt;
  constexpr int kRows = 8;  // every eighth row tells as much
  std::vector<float> values;
  for (int y = 0; y < stored.rows; y += kRows) {
    const cv::Mat row = unit_values(stored.row(y)).reshape(1);
    values.insert(values.end(), row.begin<float>(), row.end<float>());
  }
  const double median = static_cast<double>(upper_median(std::move(values)));
  if (median >= camera.black_level - kMargin * range) return std::nullopt;
  return median;
}

/// `frame` as it was read, `range`: of its images.
std::optional<Warning> black_level_warning(double range, const Rig& rig, const Frame& frame) {
  std::string names;
  double first = 0;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const auto median = median_below_black(rig.cameras[c], frame.images[c], range);
    if (!median) continue;
    if (names.empty()) first = *median;
    add_name(names,
             rig.cameras[c].name + formatted(*median, " (median %.4f") +
                 formatted(rig.cameras[c].black_level, ", stated %.4f)"),
             ", ");
  }
  if (names.empty()) return std::nullopt;
  return Warning{WarningCode::kBlackLevel,
                 "most of the picture lies below the black level that the rig states, and light "
                 "below it is lost: " +
                     names +
                     "; state the value that is stored where there is no light, over 255 of 8 bits "
                     "and over 65535 of 16, also where the sensor has fewer",
                 {},
                 {{"median", first}}};
}

}  // namespace

SensorFrame sensor_frame(Rig rig, Frame frame) {
  SensorFrame result{std::move(rig), std::move(frame)};
  const double range = range_of(result.frame.images);
  if (std::optional<Warning> warning = black_level_warning(range, result.rig, result.frame))
    result.frame.notes.push_back(std::move(*warning));
  fill_range(range, result.rig, result.frame);
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
    add_name(names, cameras[c].name + " (" + mosaics[c]->name() + ")");
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

PointResult detect_stored_frame(const Rig& rig, Frame frame, const PointOptions& options) {
  const SensorFrame sensor = sensor_frame(rig, std::move(frame));
  return detect_frame(sensor.rig, sensor.frame, options);
}

}  // namespace pencilscan
