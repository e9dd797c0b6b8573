#include "pencilscan/api/reconstruct.h"

#include <optional>

#include "pencilscan/api/frame_input.h"
#include "pencilscan/api/run_stages.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/labeling/point_file.h"

namespace pencilscan {

Reconstruction reconstruct(const Rig& rig, const Images& images,
                           const ReconstructionOptions& options) {
  const FrameOptions how = frame_options(rig, options);
  const Frame frame = frame_of(rig, images, options);
  std::optional<ThreadLimit> limit;
  if (options.threads > 0) limit.emplace(options.threads);
  Reconstruction result;
  run_stages(options.progress, told_stages(), [&](const Progress& progress) {
    FrameLinks links;
    links.progress = progress;
    result = reconstruction_of(rig, frame, reconstruct_frame(rig, frame, how, links),
                               options.depth_maps);
  });
  return result;
}

void write_reconstruction(const std::filesystem::path& folder, const Reconstruction& result) {
  if (result.mesh.faces.empty()) {
    for (const char* name : {"mesh.ply", "mesh_measured.ply"}) remove_older_mesh(folder / name);
  }
  write_points(folder / "points.ply", result.points, result.unit_known);
  write_curves(folder / "curves.ply", result.curves);
  if (!result.mesh.faces.empty()) {
    write_mesh(folder / "mesh.ply", result.mesh, result.unit_known);
    write_mesh(folder / "mesh_measured.ply", result.measured, result.unit_known);
  }
  write_text(folder / "report.json", result.report);
}

}  // namespace pencilscan
