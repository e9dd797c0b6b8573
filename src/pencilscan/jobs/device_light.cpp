#include "pencilscan/jobs/device_light.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

/// Of the known ones; of two middle ones that nearer to 0.
double modest_median(std::vector<double> values) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return kUnknownFigure;
  std::sort(values.begin(), values.end());
  const double upper = values[values.size() / 2];
  const double lower = values[(values.size() - 1) / 2];
  return std::abs(lower) < std::abs(upper) ? lower : upper;
}

/// log of the height of a projector's lines in a camera, in one frame.
double log_height(const FrameRow& row, std::size_t camera, std::size_t projector) {
  const std::vector<double>& heights = row.cameras[camera].height_of_projector;
  const double height = projector < heights.size() ? heights[projector] : kUnknownFigure;
  return height > 0 ? std::log(height) : kUnknownFigure;
}

}  // namespace

void find_device_light(std::span<FrameRow> rows, const SequenceDevices& devices) {
  const std::size_t cameras = devices.cameras.size();
  const std::size_t projectors = devices.projectors.size();
  std::vector<std::vector<double>> usual(cameras, std::vector<double>(projectors));
  for (std::size_t c = 0; c < cameras; ++c) {
    for (std::size_t p = 0; p < projectors; ++p) {
      std::vector<double> known;
      for (const FrameRow& row : rows) {
        const double height = log_height(row, c, p);
        if (std::isfinite(height)) known.push_back(height);
      }
      usual[c][p] = upper_median(std::move(known));
    }
  }
  for (FrameRow& row : rows) {
    std::vector<double> of_projectors;
    for (std::size_t p = 0; p < projectors; ++p) {
      std::vector<double> changes;
      for (std::size_t c = 0; c < cameras; ++c)
        changes.push_back(log_height(row, c, p) - usual[c][p]);
      of_projectors.push_back(modest_median(std::move(changes)));
    }
    row.device_light.clear();
    for (std::size_t c = 0; c < cameras; ++c) {
      std::vector<double> left;
      for (std::size_t p = 0; p < projectors; ++p)
        left.push_back(log_height(row, c, p) - usual[c][p] - of_projectors[p]);
      row.device_light.push_back(std::exp(modest_median(std::move(left))));
    }
    for (const double change : of_projectors) row.device_light.push_back(std::exp(change));
  }
}

}  // namespace pencilscan
