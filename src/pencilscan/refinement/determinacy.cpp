#include "pencilscan/refinement/determinacy.h"

#include <cmath>

#include "pencilscan/core/parallel.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {

Eigen::MatrixXd gauge_directions(const Rig& rig, const Vec3& center) {
  const std::size_t devices = device_count(rig);
  Eigen::MatrixXd directions = Eigen::MatrixXd::Zero(6 * static_cast<Eigen::Index>(devices), 7);
  for (std::size_t d = 0; d < devices; ++d) {
    const Device& device = device_at(rig, d);
    const Mat3& R = device.device_from_world.rotation;
    const Vec3 center_in_device = device.device_from_world * center;
    const auto row = 6 * static_cast<Eigen::Index>(d);
    for (Eigen::Index k = 0; k < 3; ++k) {
      const Vec3 w = -R.col(k);
      directions.block<3, 1>(row, k) = device.focal_px() * w;
      directions.block<3, 1>(row + 3, k) = -w.cross(center_in_device);
    }
    directions.block<3, 3>(row + 3, 3) = -R;
    directions.block<3, 1>(row + 3, 6) = center_in_device;
  }
  return directions;
}

double line_error_px(const Rig& rig, std::span<const CrossingTrack> tracks,
                     const Eigen::MatrixXd& covariance, const Eigen::VectorXd& prior_precision) {
  const Eigen::MatrixXd gauge = gauge_directions(rig, working_volume(rig).center);
  // Corrections less the motion of the whole rig in them: I - G (G' P G)^-1 G' P.
  const Eigen::MatrixXd weighted = prior_precision.asDiagonal() * gauge;
  const Eigen::MatrixXd inner = gauge.transpose() * weighted;
  const Eigen::MatrixXd projection =
      Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()) -
      gauge * solve_symmetric(inner, weighted.transpose());
  const Eigen::MatrixXd shape = projection * covariance * projection.transpose();
  const RigCorrection none(device_count(rig));
  std::vector<double> sums(tracks.size(), 0);
  std::vector<int> counts(tracks.size(), 0);
  parallel_for(tracks.size(), [&](std::size_t t) {
    for (const CrossingSighting& s : tracks[t].sightings) {
      const auto c = static_cast<std::size_t>(s.camera);
      const Camera& camera = rig.cameras[c];
      const Vec3 x_in_camera = camera.device_from_world * tracks[t].point;
      for (const LineOfProjector& line : tracks[t].lines) {
        const std::size_t p = rig.cameras.size() + static_cast<std::size_t>(line.projector);
        const Device& projector = device_at(rig, p);
        const Vec3 x = projector.device_from_world * tracks[t].point;
        if (!(x.z() > 0)) continue;
        const Eigen::RowVector3d slope =
            projection_jacobian(projector, x).row(static_cast<Eigen::Index>(line.axis));
        // A point at fixed depth on the camera ray moves with the camera.
        const Eigen::Matrix<double, 1, 6> by_camera =
            -slope * projector.device_from_world.rotation *
            camera.device_from_world.rotation.transpose() *
            pose_jacobian(camera, none[c], x_in_camera);
        const Eigen::Matrix<double, 1, 6> by_projector =
            slope * pose_jacobian(projector, none[p], x);
        Eigen::Matrix<double, 1, 12> row;
        row << by_camera, by_projector;
        const auto i = 6 * static_cast<Eigen::Index>(c);
        const auto j = 6 * static_cast<Eigen::Index>(p);
        Eigen::Matrix<double, 12, 12> part;
        part << shape.block<6, 6>(i, i), shape.block<6, 6>(i, j), shape.block<6, 6>(j, i),
            shape.block<6, 6>(j, j);
        sums[t] += row * part * row.transpose();
        ++counts[t];
      }
    }
  });
  double sum = 0;
  int count = 0;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    sum += sums[t];
    count += counts[t];
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

}  // namespace pencilscan
