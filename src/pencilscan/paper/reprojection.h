#pragma once

#include <optional>
#include <span>
#include <vector>

#include "pencilscan/grid/grid_graph.h"

namespace pencilscan {

/// Detected curves of one camera, for "how far is the nearest curve of this pattern and local ID?"
class CurveIndex {
 public:
  CurveIndex(const GridGraph& graph, cv::Size image_size);

  /// Distance in px to the nearest detected curve with this pattern and ID, if within `radius_px`.
  [[nodiscard]] std::optional<double> distance(const Vec2& pixel, PatternRef pattern, int local_id,
                                               double radius_px) const;

 private:
  struct Entry {
    Eigen::Vector2f position;
    Eigen::Vector2f normal;
    PatternRef pattern;
    int local_id;
  };
  static constexpr int kCell = 8;
  int columns_;
  int rows_;
  std::vector<std::vector<Entry>> cells_;
};

}  // namespace pencilscan
