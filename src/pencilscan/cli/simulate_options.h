#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pencilscan/cli/command.h"
#include "pencilscan/geometry/mesh.h"
#include "pencilscan/simulation/photography.h"

namespace pencilscan::cli {

/// What `simulate` was asked for.
struct SimulateOptions {
  CommonOptions common;
  std::string rig_path;
  std::string mesh_path;
  std::string out;
  bool overwrite = false;

  bool fit = false;
  double scale = 1;
  UpAxis up = UpAxis::kZ;
  int frame_count = 1;
  double rotate_deg = 0;
  std::vector<double> translate_mm = {0, 0, 0};
  std::vector<double> speed_mm_s = {0, 0, 0};
  std::vector<double> spin_deg_s = {0, 0, 0};
  double exposure_ms = 1;

  bool gray_code = false;
  bool color_captures = false;
  bool truth_maps = false;
  bool export_povray = false;
  bool export_blender = false;
  std::string light;         ///< folder of another renderer's pictures; empty: our own
  std::string interpolated;  ///< name of a mosaic; empty: three channels
  std::optional<int> jpeg;   ///< quality

  Reflectance surface;
  bool flat = false;
  bool no_falloff = false;
  PhotographyOptions photo;
};

/// The object: its place, its motion and its surface.
void add_scene_options(CLI::App& command, SimulateOptions& options);
/// Cameras and projectors: optics, light and noise.
void add_device_options(CLI::App& command, SimulateOptions& options);

}  // namespace pencilscan::cli
