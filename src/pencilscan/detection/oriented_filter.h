#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/core/lanes.h"

namespace pencilscan {

/// Second derivatives of a smoothed image, CV_32FC1.
struct Hessian {
  cv::Mat xx, xy, yy;
};

/// One direction of the filter bank: unit normal (nx, ny) and the taps of the smoothing along the
/// line.
struct FilterDirection {
  float nx = 1;
  float ny = 0;
  struct Tap {
    int dx = 0;
    int dy = 0;
    float weight = 0;
  };
  std::vector<Tap> taps;
};

/// `count` directions over half a turn, each smoothing along its line by a Gaussian on a sheared
/// grid.
[[nodiscard]] std::vector<FilterDirection> filter_directions(int count, double sigma_px);

/// Farthest tap, px.
[[nodiscard]] int filter_reach(const std::vector<FilterDirection>& directions);

/// A maximum across one direction of the filter bank and over the directions.
struct FilterMaximum {
  int x = 0;  ///< pixel in the tile
  int y = 0;
  int direction = 0;
  float before = 0;  ///< response of the direction before it,
  float at = 0;      ///< of its own
  float after = 0;   ///< and of the next
  float low = 0;     ///< response of its own direction 1 px against the normal
  float high = 0;    ///< and 1 px along it
};

/// The filter bank's responses over one tile of an image.
class FilterTile {
 public:
  static constexpr int kTile = 38;  ///< px; with its border, a row is whole registers

  explicit FilterTile(const std::vector<FilterDirection>& directions);

  /// Responses around the tile whose first pixel is (x0, y0); h must extend filter_reach() + 1 px
  /// beyond it on all sides, and kLanes px more to the right.
  void compute(const Hessian& h, int x0, int y0);
  /// Maxima of at least `threshold`, row by row.
  void find_maxima(float threshold, int width, int height,
                   std::vector<FilterMaximum>& maxima) const;

 private:
  static constexpr int kSize = kTile + 2;                              ///< with a border
  static constexpr int kRow = (kSize + kLanes - 1) / kLanes * kLanes;  ///< floats in a row
  static constexpr std::size_t kPlane = static_cast<std::size_t>(kSize + 1) * kRow;

  const std::vector<FilterDirection>& directions_;
  int reach_;
  int steered_row_;
  std::vector<float> responses_;  ///< a plane of kSize rows per direction
  std::vector<float> steered_;    ///< of one direction, before smoothing
};

/// Smallest value of a CV_32FC1 image in an area.
[[nodiscard]] float lowest_value(const cv::Mat& image, const cv::Rect& area);

}  // namespace pencilscan
