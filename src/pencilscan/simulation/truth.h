#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/rig/rig.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {

/// What a camera sees of one projector's light, at pixel centres.
struct ProjectorTruth {
  std::vector<cv::Mat>
      line;        ///< per pattern, CV_64F: line coordinate (line i has its centre at i);
                   ///< NaN off the object, behind the projector and outside its panel
  cv::Mat lit;     ///< CV_8U: 1 where the projector's light arrives, 0 elsewhere
  cv::Mat cosine;  ///< CV_32F: face normal with the light's direction; NaN off the object
};

/// Truth maps of one camera, at pixel centres.
struct CameraTruth {
  cv::Mat depth;   ///< CV_64F: camera z in mm, NaN off the object
  cv::Mat cosine;  ///< CV_32F: face normal with the viewing direction; NaN off the object
  std::vector<ProjectorTruth> projectors;
};

/// Exact maps by one ray per pixel: no filter, no sensor.
[[nodiscard]] CameraTruth camera_truth(const Rig& rig, std::size_t camera,
                                       const SimulatedObject& object);

}  // namespace pencilscan
