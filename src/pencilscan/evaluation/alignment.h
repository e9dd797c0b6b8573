#pragma once

#include <optional>
#include <span>

#include "pencilscan/geometry/ray_scene.h"

namespace pencilscan {

enum class AlignmentKind { kNone, kRigid, kSimilarity };

/// x_in_truth = scale * (rotation * x_in_result) + translation.
struct Similarity {
  double scale = 1;  ///< > 0
  Mat3 rotation = Mat3::Identity();
  Vec3 translation = Vec3::Zero();  ///< mm

  [[nodiscard]] Vec3 operator*(const Vec3& x) const { return scale * (rotation * x) + translation; }
  [[nodiscard]] Similarity inverse() const {
    const double s = 1 / scale;
    return {s, rotation.transpose(), -s * (rotation.transpose() * translation)};
  }
};

struct AlignmentOptions {
  std::size_t max_points = 20000;  ///< an even subset of the points is used
  int max_iterations = 60;
};
/// Another pose at which the points fit about as well.
struct AlignmentRival {
  double turn_rad = 0;   ///< from the pose found, 0..pi
  double median_mm = 0;  ///< distance of the points to the truth there
};
struct AlignmentReport {
  Similarity truth_from_result;
  double median_mm = 0;  ///< distance of the aligned points to the truth
  int iterations = 0;
  std::optional<AlignmentRival> rival;  ///< the best one, where there are any
};

/// Moves measured points onto the true surface: iterative closest points with the exact closest
/// point of the mesh and the distance along its normal. For p moved by a small rotation w,
/// translation t and growth l about the centroid c, the residual is n . (p + w x (p - c) + l (p -
/// c) + t - q) (Chen and Medioni 1992; l only for a similarity), weighted by Tukey's biweight with
/// a scale of kDeviationPerMedian times the median residual, so that wrong points count nothing.
/// Starts: where the points are, and poses that match centroid and size, unturned, turned about z,
/// by the principal axes, and in a thousand ways (about 25 degrees apart), a few point-to-point
/// steps (Umeyama 1991) first. They are tried on a few points by a lattice of closest points; the
/// best dozen on more points by the exact ones. The pose of the least mean distance wins, none
/// counted farther than a twentieth of the points' root mean square extent; of poses within a tenth
/// of it, the one that moves least.
///
/// A rival is a pose whose mean distance is at most twice the winner's, and from which the truth
/// looks otherwise: what its shape differs by is less than what the points deviate by. Points: at
/// least 10.
[[nodiscard]] AlignmentReport align_to_surface(std::span<const Vec3> points, const RayScene& truth,
                                               AlignmentKind kind,
                                               const AlignmentOptions& options = {});

/// The mesh moved by a similarity.
[[nodiscard]] TriangleMesh transformed(TriangleMesh mesh, const Similarity& b_from_a);

}  // namespace pencilscan
