#pragma once

#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <string>

#include "pencilscan/api/images.h"
#include "pencilscan/api/reconstruct.h"
#include "pencilscan/geometry/mesh.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

struct SimulationOptions {
  std::string noise = "medium";      ///< sensor and room: none, low, medium, high
  std::uint64_t seed = 1;            ///< of the noise
  bool fit = false;                  ///< centre and scale the mesh into the rig's volume
  std::string up = "z";              ///< axis of the mesh that points up: x, y, z
  int bits = 8;                      ///< of the pictures: 8 or 16
  double albedo = 0.8;               ///< in [0, 1]
  bool smooth = true;                ///< interpolated normals; false: one normal per face (cubes)
  int frame = 0;                     ///< of a moving object, >= 0
  double rotate_rad = 0;             ///< its turn about the vertical per frame
  Vec3 translate_mm = Vec3::Zero();  ///< its shift per frame
  StageListener progress;
};

/// What the cameras of a rig would see of a mesh.
struct SimulatedFrame {
  std::map<std::string, cv::Mat> images;  ///< by camera: CV_8UC3 or CV_16UC3, RGB
  TriangleMesh truth;                     ///< the mesh where this frame has it
};

/// The same pictures as `pencilscan simulate` writes. InputError when no camera sees the mesh.
[[nodiscard]] SimulatedFrame simulate(const Rig& rig, const TriangleMesh& mesh,
                                      const SimulationOptions& options = {});

}  // namespace pencilscan
