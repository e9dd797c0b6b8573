#pragma once

#include <string>
#include <vector>

#include "pencilscan/core/progress.h"
#include "pencilscan/detection/detect.h"
#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/io/point_file.h"
#include "pencilscan/solution/labeling.h"
#include "pencilscan/solution/triangulate.h"

namespace pencilscan {

/// One moment seen by all cameras.
struct Frame {
  std::string name;
  std::vector<cv::Mat> images;  ///< one per camera of the rig, CV_32FC3 RGB as read; empty: missing
};

struct PointOptions {
  DetectionOptions detection;
  GridOptions grid;
  SolutionOptions solution;
  TriangulationOptions triangulation;
};

/// Seconds of one stage, wall clock.
struct StageTime {
  std::string stage;
  double seconds = 0;
};

/// Labelled points of one frame and everything that led to them.
struct PointResult {
  std::vector<ColorFamily> families;
  std::vector<CameraDetection> detections;  ///< per camera; curves have moved into the graphs
  std::vector<GridGraph> graphs;            ///< per camera
  Labeling labeling;
  std::vector<MeasuredPoint> points;
  std::vector<StageTime> times;
  std::vector<std::string> warnings;
};

/// The paper's Fig. 3 for one frame: detection and grid per camera, one solution over all cameras,
/// triangulation.
[[nodiscard]] PointResult measure_points(const Rig& rig, const Frame& frame,
                                         const PointOptions& options = {});

}  // namespace pencilscan
