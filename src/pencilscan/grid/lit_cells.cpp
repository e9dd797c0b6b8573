#include "pencilscan/grid/lit_cells.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/median.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {
namespace {

constexpr double kCellSpacings = 2;
constexpr float kFaintLight = 1.F / 50;  ///< of a line's amplitude, in a cell's mean
constexpr float kLight = 1.F / 10;
constexpr double kDarkestShare = 0.1;  ///< so many cells are dark, if any are

/// The median amplitude of a family's lines; 0: it has none.
float line_amplitude(std::span<const Curve> curves, int family) {
  std::vector<float> amplitudes;
  for (const Curve& curve : curves)
    if (curve.family == family)
      for (const CurvePoint& point : curve.points) amplitudes.push_back(point.amplitude);
  return upper_median(std::move(amplitudes));
}

cv::Point cell_of(const LitCells& cells, cv::Size size, const Eigen::Vector2f& pixel) {
  return {std::clamp(static_cast<int>(pixel.x() / cells.cell_px.width), 0, size.width - 1),
          std::clamp(static_cast<int>(pixel.y() / cells.cell_px.height), 0, size.height - 1)};
}

}  // namespace

Sight LitCells::at(const Vec2& pixel) const {
  const cv::Point cell = cell_of(*this, seen.size(), pixel.cast<float>());
  return static_cast<Sight>(seen.at<std::uint8_t>(cell));
}

LitCells lit_cells(const Rig& rig, int camera, std::span<const Curve> curves,
                   std::span<const cv::Mat> presence) {
  LitCells cells;
  if (curves.empty() || presence.empty()) return cells;
  const double cell_px =
      std::max(1.0, pixels_at_center(rig, rig.camera(camera), kCellSpacings * line_spacing(rig)));
  const cv::Size image = presence.front().size();
  const cv::Size size(std::max(1, static_cast<int>(std::lround(image.width / cell_px))),
                      std::max(1, static_cast<int>(std::lround(image.height / cell_px))));
  cells.cell_px = cv::Size2f(static_cast<float>(image.width) / static_cast<float>(size.width),
                             static_cast<float>(image.height) / static_cast<float>(size.height));
  cv::Mat own = cv::Mat::zeros(size, CV_8UC1);
  cv::Mat mean;
  for (std::size_t f = 0; f < presence.size(); ++f) {
    const float amplitude = line_amplitude(curves, static_cast<int>(f));
    if (amplitude <= 0) continue;
    cv::resize(presence[f], mean, size, 0, 0, cv::INTER_AREA);
    const float dark =
        lower_quantile<float>({mean.begin<float>(), mean.end<float>()}, kDarkestShare);
    own = cv::max(own,
                  (mean > dark + kFaintLight * amplitude) / 255 * static_cast<int>(Sight::kFaint));
    own.setTo(static_cast<int>(Sight::kLit), mean > dark + kLight * amplitude);
  }
  for (const Curve& curve : curves)
    for (const CurvePoint& point : curve.points)
      own.at<std::uint8_t>(cell_of(cells, size, point.position)) =
          static_cast<std::uint8_t>(Sight::kLit);
  cv::dilate(own, cells.seen, cv::Mat::ones(3, 3, CV_8UC1));
  return cells;
}

}  // namespace pencilscan
