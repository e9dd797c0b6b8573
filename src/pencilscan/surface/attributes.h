#pragma once

#include <array>
#include <span>
#include <vector>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/surface/sample.h"
#include "pencilscan/uncertainty/error_model.h"

namespace pencilscan {

/// Sets sigma and confidence of every vertex from the samples near it. A vertex is measured if a
/// sample of its own side lies within the reach, if samples surround it, and if it faces a camera
/// that took one of them. The reach grows where the light sheets graze the surface. Beyond the last
/// line only a part of it counts. Returns what each sigma rests on. `middles`: the ends of edges
/// whose middles are the last vertices of the mesh. A middle between two vertices that are measured
/// and surrounded takes the mean of what is known of both.
std::vector<SurfaceEvidence> attribute_vertices(std::span<const SurfaceSample> samples,
                                                double reach_spacings, double spacing,
                                                TriangleMesh& mesh,
                                                std::span<const std::array<int, 2>> middles = {});

/// Per face: 1 when all its vertices were measured.
[[nodiscard]] std::vector<char> measured_faces(const TriangleMesh& mesh);

/// The measured faces without islands smaller than min_area_mm2.
[[nodiscard]] TriangleMesh measured_part(const TriangleMesh& mesh, double min_area_mm2);

}  // namespace pencilscan
