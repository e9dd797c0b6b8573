#pragma once

#include <span>
#include <vector>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/geometry/mesh.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

struct FollowOptions {
  /// Standard deviation of a node's say over the image, nodes, in (0, 1.2]. Slopes and bends that
  /// neighbours share (depth/shared_bends.h) carry farther than those of single windows, of which 1
  /// was best. 1.4 helps smooth objects no more.
  double width_nodes = 1.2;
  double farthest = 2;  ///< footprints; nodes farther off along the normal are another surface
  double robust = 0.6;  ///< footprints off the others at which a prediction counts a quarter
  /// Sum of the nodes' bells below which a vertex has no depth, > 0: a tenth of what all nodes
  /// around sum to, 2 pi width_nodes^2.
  double least_weight = 0.9;
  int rounds = 2;  ///< normals settle as vertices move
};

/// Moves each vertex along its normal to where the nodes of all cameras around its pixels say the
/// surface is. Every node predicts it with a paraboloid over its tangent plane that has the
/// curvature of its quadric of inverse depth: a mean of such predictions keeps the curvature that a
/// fit to the nodes' positions flattens. Predictions weigh by their variance and by a bell over the
/// distance in the image; those of a camera whose nodes lie on one side of the vertex count less
/// where their own normals are off the vertex's. Vertices without depth follow their neighbours,
/// less with every edge, so that no step remains where depth ends. Returns which vertices have
/// depth.
std::vector<char> follow_nodes(const Rig& rig, std::span<const DepthMap> maps,
                               const FollowOptions& options, TriangleMesh& mesh);

}  // namespace pencilscan
