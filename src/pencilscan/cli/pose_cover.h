#pragma once

#include <nlohmann/json_fwd.hpp>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "pencilscan/capture/picture_check.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan::cli {

/// Where in each camera's picture the poses of a calibration had something that projectors lit.
class PoseCover {
 public:
  explicit PoseCover(const std::vector<Camera>& cameras);

  /// views[projector][camera] of one more pose.
  void add(const std::vector<std::vector<LitView>>& views);
  /// [{"camera", "share" of its picture, "rows" of shares by cell}] of cameras that saw something.
  [[nodiscard]] nlohmann::ordered_json json() const;
  /// Where the next pose should have something: the emptiest cell of all, in words; empty: every
  /// camera has seen something everywhere.
  [[nodiscard]] std::string emptiest_cell() const;

 private:
  [[nodiscard]] cv::Mat cells(std::size_t camera) const;  ///< CV_32F, share lit

  std::vector<std::string> cameras_;
  std::vector<cv::Mat> lit_;  ///< per camera a coarse picture: lit in a pose
};

}  // namespace pencilscan::cli
