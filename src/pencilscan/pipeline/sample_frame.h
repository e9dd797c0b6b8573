#pragma once

// Frames for tests.

#include <cstdint>
#include <opencv2/core.hpp>

#include "pencilscan/pipeline/frame.h"
#include "pencilscan/simulation/photography.h"

namespace pencilscan::sample {

/// What the cameras take of an object, or of its moments (whatever photograph() takes), with values
/// from 0 to 1.
template <class Object>
Frame photographed_frame(const Rig& rig, const Object& object, const PhotographyOptions& options) {
  Frame frame;
  frame.name = "000000";
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    cv::Mat values;
    photograph(rig, c, object, options, static_cast<std::uint32_t>(c))
        .convertTo(values, CV_32F, 1 / 255.0);
    frame.images.push_back(values);
  }
  return frame;
}

}  // namespace pencilscan::sample
