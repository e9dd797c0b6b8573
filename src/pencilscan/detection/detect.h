#pragma once

#include <span>
#include <string>
#include <vector>

#include "pencilscan/detection/code_evidence.h"
#include "pencilscan/detection/curve.h"
#include "pencilscan/detection/refine.h"
#include "pencilscan/detection/ridge.h"
#include "pencilscan/detection/trace.h"
#include "pencilscan/view/color_family.h"
#include "pencilscan/view/unmix.h"

namespace pencilscan {

struct DetectionOptions {
  RidgeOptions ridge;
  TraceOptions trace;
  RefineOptions refine;
  CodeEvidenceOptions code;
};

/// What one camera sees.
struct CameraDetection {
  std::vector<Curve> curves;  ///< of all families
  Unmixing unmixing;
  std::vector<cv::Mat> presence;  ///< per family: how bright its lines are, CV_32FC1
  std::size_t saturated_pixels = 0;
  int joined_pixels = 1;      ///< along a row, to one that the stages saw (pipeline/coarse_view.h)
  bool is_filled_in = false;  ///< its colours, behind a mosaic (mosaic_trace.h)
};

/// Curves of all colour families of one camera image (linear or gamma-coded RGB as read, CV_32FC3).
[[nodiscard]] CameraDetection detect_curves(const Camera& camera, const Rig& rig,
                                            const std::vector<ColorFamily>& families,
                                            const cv::Mat& image,
                                            const DetectionOptions& options = {});

/// Of all cameras; they share their pixels with the detections.
[[nodiscard]] std::vector<std::vector<cv::Mat>> presence_images(
    std::span<const CameraDetection> detections);

}  // namespace pencilscan
