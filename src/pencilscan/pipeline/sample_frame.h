#pragma once

// Rigs, scenes and frames for tests.

#include <cstdint>
#include <opencv2/core.hpp>
#include <utility>

#include "pencilscan/pipeline/frame.h"
#include "pencilscan/planning/ring.h"
#include "pencilscan/simulation/photography.h"

namespace pencilscan::sample {

/// The default ring with cameras of a quarter of the pixels, which see as much.
inline RingOptions small_ring() {
  RingOptions ring;
  ring.camera_width /= 2;
  ring.camera_height /= 2;
  ring.camera_focal_px /= 2;
  return ring;
}

/// Adds a square, or a parallelogram, about its centre: `x` and `y` lead to the middles of two
/// sides.
inline void add_square(const Vec3& center, const Vec3& x, const Vec3& y, TriangleMesh& mesh) {
  const auto first = static_cast<int>(mesh.vertices.size());
  for (const auto& [a, b] :
       {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)})
    mesh.vertices.push_back(center + a * x + b * y);
  mesh.faces.push_back({first, first + 1, first + 2});
  mesh.faces.push_back({first, first + 2, first + 3});
}

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

/// The labelled points of a frame as a user gets them without a surface, in the rig's unit.
inline PointResult labelled_points(const Rig& rig, const Frame& frame,
                                   const PointOptions& options = {}) {
  FrameOptions points_alone;
  points_alone.points = options;
  points_alone.meshes = false;
  return reconstruct_frame(rig, frame, points_alone).points;
}

/// What the stages of a surface take: points of a rig in footprints (in_footprints()).
inline PointResult points_in_footprints(const Rig& rig, const Frame& frame) {
  PointResult lines = solve_frame(rig, frame, check_pictures(rig, frame, detect_frame(rig, frame)));
  return place_points(rig, std::move(lines));
}

}  // namespace pencilscan::sample
