#include "pencilscan/capture/live_figures.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "pencilscan/capture/camera_picture.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/median.h"
#include "pencilscan/io/codec.h"

namespace pencilscan {
namespace {

constexpr int kFar = 8;      ///< px: wider than any edge that can be used
constexpr int kWindow = 16;  ///< px: a line and its gap where they are as far apart as they may be
constexpr double kFull = 254.5 / 255;
constexpr double kLitShare = 0.2;    ///< of the brightest
constexpr double kEdgeShare = 0.1;   ///< of the brightest
constexpr double kLeastEdge = 0.05;  ///< of the range: noise is less
/// Of the range above black: a fifth of it, where "lit" begins, is 2.5 steps of 8 bits, which is
/// what noise of one step reaches in one pixel of a hundred.
constexpr double kLeastLight = 2.5 / 255 / kLitShare;
constexpr int kLeastEdges = 50;  ///< pixels, for a width

// What advice begins at. Light: docs/lab.md asks for 80 % under one projector; half of it still has
// seven bits. A line of 4 px that is blurred by 3 has lost half of its height.
constexpr double kMostSaturated = 0.001;
constexpr double kDim = 0.4;
constexpr double kWideEdge = 3;
constexpr double kLowContrast = 0.5;

/// The brightest colour of every pixel, or of every cell of a mosaic, CV_32F in [0, 1].
cv::Mat light_of(const CameraFrame& frame) {
  cv::Mat picture;
  frame.image.convertTo(picture, CV_32F, frame.image.depth() == CV_16U ? 1.0 / 65535 : 1.0 / 255);
  if (picture.channels() == 3) {
    std::vector<cv::Mat> colors;
    cv::split(picture, colors);
    return cv::max(colors[0], cv::max(colors[1], colors[2]));
  }
  if (frame.mosaic.empty()) return picture;
  cv::Mat cells(picture.rows / 2, picture.cols / 2, CV_32F);
  for (int y = 0; y < cells.rows; ++y)
    for (int x = 0; x < cells.cols; ++x)
      cells.at<float>(y, x) =
          std::max({picture.at<float>(2 * y, 2 * x), picture.at<float>(2 * y, 2 * x + 1),
                    picture.at<float>(2 * y + 1, 2 * x), picture.at<float>(2 * y + 1, 2 * x + 1)});
  return cells;
}

/// So many rows that 300,000 pixels are looked at.
int row_step(const cv::Mat& light) { return 1 + static_cast<int>(light.total() / 300'000); }

/// Sums over rows and columns of squared changes over 1 and over kFar px, where there is an edge.
double edge_width(const cv::Mat& light, double least) {
  double near = 0;
  double far = 0;
  int count = 0;
  const auto add = [&](float before, float here, float after, float end) {
    const double over = end - before;
    if (std::abs(over) < least) return;
    ++count;
    far += over * over;
    near += (after - here) * (after - here);
  };
  const int step = row_step(light);
  for (int y = 0; y + kFar < light.rows; y += step) {
    for (int x = 0; x + kFar < light.cols; ++x) {
      const auto at = [&](int right, int down) { return light.at<float>(y + down, x + right); };
      add(at(0, 0), at(kFar / 2, 0), at(kFar / 2 + 1, 0), at(kFar, 0));
      add(at(0, 0), at(0, kFar / 2), at(0, kFar / 2 + 1), at(0, kFar));
    }
  }
  if (count < kLeastEdges || near <= 0) return 0;
  // far / near = w (8 - w / 3), solved for w.
  const double ratio = far / near;
  const double root = 1 - ratio / (3.0 * kFar * kFar / 4);
  return 1.5 * kFar * (1 - std::sqrt(std::max(0.0, root)));
}

double contrast(const cv::Mat& light, double least) {
  std::vector<double> contrasts;
  for (int y = 0; y + kWindow <= light.rows; y += kWindow * row_step(light)) {
    for (int x = 0; x + kWindow <= light.cols; x += kWindow) {
      std::vector<float> values;
      for (int row = 0; row < kWindow; ++row)
        values.insert(values.end(), light.ptr<float>(y + row) + x,
                      light.ptr<float>(y + row) + x + kWindow);
      const double bright = lower_quantile(values, 0.95);
      const double dark = lower_quantile(values, 0.05);
      if (bright >= least) contrasts.push_back((bright - dark) / (bright + dark));
    }
  }
  return contrasts.empty() ? 0 : upper_median(contrasts);
}

}  // namespace

LiveFigures live_figures(const CameraFrame& frame, double black_level) {
  LiveFigures figures;
  if (frame.image.empty()) return figures;
  const cv::Mat light = light_of(frame);
  std::vector<float> values;
  for (int y = 0; y < light.rows; y += row_step(light))
    values.insert(values.end(), light.ptr<float>(y), light.ptr<float>(y) + light.cols);
  const auto share = [&](double least) {
    return static_cast<double>(
               std::count_if(values.begin(), values.end(), [&](float v) { return v >= least; })) /
           static_cast<double>(values.size());
  };
  figures.saturated = share(kFull);
  figures.brightest = lower_quantile(values, 0.999);
  if (figures.brightest - black_level < kLeastLight) return figures;
  figures.lit = share(kLitShare * figures.brightest);
  figures.edge_px = edge_width(light, std::max(kLeastEdge, kEdgeShare * figures.brightest)) *
                    (frame.mosaic.empty() ? 1 : 2);
  figures.line_contrast = contrast(light, kLitShare * figures.brightest);
  return figures;
}

std::vector<std::string> advice_for(const LiveFigures& figures, bool lines) {
  std::vector<std::string> advice;
  if (figures.saturated > kMostSaturated)
    advice.push_back(
        percent_text(figures.saturated) +
        " is at the end of the range: half the exposure, close the iris, or less gain");
  else if (figures.brightest < kDim)
    advice.push_back("the brightest is " + formatted(100 * figures.brightest, "%.0f %%") +
                     " of the range: open the iris, expose twice as long, or more gain");
  if (figures.edge_px > kWideEdge)
    advice.push_back("edges are " + formatted(figures.edge_px, "%.1f px") +
                     " wide: turn the focus until that is smallest");
  if (lines && figures.line_contrast > 0 && figures.line_contrast < kLowContrast)
    advice.push_back("lines stand out by " + formatted(100 * figures.line_contrast, "%.0f %%") +
                     " only: other light in the room, or out of focus");
  return advice;
}

cv::Mat preview_of(const CameraFrame& frame, int width) {
  cv::Mat picture = picture_to_see(frame);
  if (picture.depth() == CV_16U) picture.convertTo(picture, CV_8U, 1.0 / 257);
  if (picture.cols <= width) return picture;
  cv::Mat small;
  const double scale = static_cast<double>(width) / picture.cols;
  cv::resize(picture, small, {}, scale, scale, cv::INTER_AREA);
  return small;
}

std::string preview_jpeg(const CameraFrame& frame, int width) {
  constexpr int kQuality = 85;
  return encoded_picture(preview_of(frame, width), ".jpg", {cv::IMWRITE_JPEG_QUALITY, kQuality});
}

}  // namespace pencilscan
