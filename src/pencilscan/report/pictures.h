#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A picture and the name of its file, without folder and ending.
struct Picture {
  std::string name;
  cv::Mat image;  ///< CV_8UC3 RGB
};

/// What there is of one frame; everything but the rig may be missing.
struct FrameResults {
  const Rig& rig;
  std::span<const cv::Mat> images = {};  ///< per camera, linear RGB float; an empty one is skipped
  std::span<const MeasuredPoint> points = {};
  std::span<const char> used = {};  ///< per point: the surface rests on it; may be empty
  const TriangleMesh* mesh = nullptr;
  const TriangleMesh* truth = nullptr;
};

struct PictureOptions {
  int width = 480;  ///< of one view of a sheet, px
  int height = 480;
  double high_distance_mm = 1;  ///< end of the distance-to-truth scale, > 0
};

/// `<camera>_local_id` and `<camera>_projector` (overlays, like Fig. 5b and 8c-d of the paper),
/// `points` and `shape` (six sides), `scene` (the shape among the devices, like Fig. 5c-g),
/// `distance` (six sides, distance to the truth).
[[nodiscard]] std::vector<Picture> make_pictures(const FrameResults& results,
                                                 const PictureOptions& options = {});

/// Writes <folder>/<name>.png each. StageError when that fails.
void write_pictures(const std::filesystem::path& folder, std::span<const Picture> pictures);

}  // namespace pencilscan
