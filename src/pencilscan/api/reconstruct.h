#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "pencilscan/api/images.h"
#include "pencilscan/geometry/mesh.h"
#include "pencilscan/io/curve_file.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Called in the thread of the caller with the name of the stage at work and the share of stages
/// that are done, at every new stage and several times a second. False, or an exception, ends the
/// call: within a few seconds it throws Cancelled, or that exception.
using StageListener = std::function<bool(std::string_view stage, double done)>;

struct ReconstructionOptions {
  std::string method = "joint";               ///< joint, linear, multiview, single-projector
  std::string multiview_cost = "normalized";  ///< or published
  bool mesh = true;                           ///< false: points and curves alone, much faster
  bool depth = true;                          ///< dense depth between the curves; joint only
  bool depth_maps = false;       ///< keep them in the result; InputError without mesh or depth
  Images plain;                  ///< the same moment in plain light, for colour
  std::string frame = "000000";  ///< what the report calls it
  int threads = 0;               ///< of the whole process meanwhile; 0: as it is
  StageListener progress;
};

/// Depth of one camera at its full resolution; NaN: none.
struct CameraDepth {
  std::string camera;
  cv::Mat depth;  ///< CV_32F, camera z, mm
  cv::Mat sigma;  ///< CV_32F, mm of camera z, one standard deviation
};

/// What one frame gives: the contents of the files that the program writes.
struct Reconstruction {
  std::vector<MeasuredPoint> points;  ///< points.ply
  CurveFile curves;                   ///< curves.ply
  TriangleMesh mesh;                  ///< mesh.ply: closed; empty without options.mesh
  TriangleMesh measured;              ///< mesh_measured.ply
  std::vector<CameraDepth> depth;     ///< with options.depth_maps
  std::string report;                 ///< report.json
  bool unit_known = true;             ///< of the rig: lengths are mm
};

/// The shape in one frame. The same values as `pencilscan reconstruct` for any number of threads.
/// InputError for pictures that do not fit the rig or an unknown option, StageError when no curve
/// could be given its line, Cancelled.
[[nodiscard]] Reconstruction reconstruct(const Rig& rig, const Images& images,
                                         const ReconstructionOptions& options = {});

/// points.ply, curves.ply, report.json and, where there is a mesh, mesh.ply and mesh_measured.ply;
/// without a mesh, those of an earlier result in the folder are removed.
void write_reconstruction(const std::filesystem::path& folder, const Reconstruction& result);

}  // namespace pencilscan
