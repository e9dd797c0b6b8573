#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// Where a point of ours comes from, so that a bad one can be looked at.
struct PointOrigin {
  float u = 0, v = 0;  ///< camera pixel
  int camera = 0;
  int projector = 0;
  int line = 0;
  float confidence = 0;
};

/// What was measured of an artefact in one position: the vertices of a PLY file. The lists beside
/// `points` are empty or as long.
struct ArtefactPoints {
  std::string source;  ///< the file
  std::vector<Vec3> points;
  std::vector<float> sigma;          ///< mm; along the camera ray of points, the normal of a mesh
  std::vector<PointOrigin> origins;  ///< of our points.ply
  bool is_mesh = false;              ///< the file has faces
  bool unit_known = true;            ///< false: of a rig whose unit is unknown
  std::size_t not_finite = 0;        ///< vertices without a position, as organised clouds have
  std::size_t without_face = 0;    ///< vertices of a mesh that no face has: no part of its surface
  std::size_t outside_region = 0;  ///< left out: outside of what was asked for

  [[nodiscard]] ArtefactPoints subset(const std::vector<std::size_t>& indices) const;
};

/// Which file of a frame's results to measure.
enum class FrameSurface { kPoints, kMesh };  ///< points.ply, mesh_measured.ply

/// A position that was to be measured and has no result: a frame that failed.
struct LackingPosition {
  std::filesystem::path folder;
  std::string why;
};

/// The positions that an argument names.
struct ArtefactFiles {
  std::vector<std::filesystem::path> files;
  std::vector<LackingPosition> lacking;
};

/// A PLY file; the results of a frame; or an output folder, one position per frame. A frame's
/// folder with failure.json, or with input.json and no result, is a position that lacks. InputError
/// where there is neither a result nor a failure.
[[nodiscard]] ArtefactFiles artefact_files(const std::filesystem::path& path, FrameSurface surface);

/// Vertices of any PLY file, of points or a mesh. InputError when it is none or has no vertex with
/// a finite position.
[[nodiscard]] ArtefactPoints read_artefact_points(const std::filesystem::path& path);

/// Leaves out what lies outside of a sphere.
[[nodiscard]] ArtefactPoints within(const ArtefactPoints& points, const Sphere& region);

}  // namespace pencilscan
