#include "pencilscan/rig/rig.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "pencilscan/core/error.h"
#include "pencilscan/core/median.h"
#include "pencilscan/geometry/least_squares.h"
#include "pencilscan/rig/view_of_volume.h"

namespace pencilscan {
namespace {

/// Gazes closer to parallel than this (smallest eigenvalue per device) have no meeting point.
constexpr double kParallelGazes = 1e-4;
/// Where the gazes do not meet, the object is guessed at this many baselines in front.
constexpr double kGuessedBaselines = 5;
/// Depth guessed for a single device, mm.
constexpr double kGuessedDepth = 1000;
/// Share of the distance taken as the radius where the devices do not look at the centre.
constexpr double kGuessedRadiusShare = 0.2;

std::vector<const Device*> all_devices(const Rig& rig) {
  std::vector<const Device*> devices;
  for (const Camera& camera : rig.cameras) devices.push_back(&camera);
  for (const Projector& projector : rig.projectors) devices.push_back(&projector);
  return devices;
}

/// Radius of the largest sphere about `center` inside the device's view: the distance to the
/// nearest of the four planes through the image's edges. Negative when the centre itself is
/// outside.
double visible_radius(const Device& device, const Vec3& center) {
  const Vec3 x = device.device_from_world * center;
  const double column = 0.5 * (device.width - 1), row = 0.5 * (device.height - 1);
  const double left = device.normalized_from_pixel({-0.5, row}).x();
  const double right = device.normalized_from_pixel({device.width - 0.5, row}).x();
  const double top = device.normalized_from_pixel({column, -0.5}).y();
  const double bottom = device.normalized_from_pixel({column, device.height - 0.5}).y();
  return std::min({(x.x() - left * x.z()) / std::hypot(1, left),
                   (right * x.z() - x.x()) / std::hypot(1, right),
                   (x.y() - top * x.z()) / std::hypot(1, top),
                   (bottom * x.z() - x.y()) / std::hypot(1, bottom)});
}

/// In front of the devices where their gazes tell nothing.
Vec3 guessed_center(const std::vector<const Device*>& devices) {
  Vec3 mean = Vec3::Zero(), forward = Vec3::Zero();
  double baseline = 0;
  for (const Device* device : devices) {
    mean += device->center() / static_cast<double>(devices.size());
    forward += gaze(*device);
    baseline = std::max(baseline, (device->center() - devices.front()->center()).norm());
  }
  const double depth = baseline > 0 ? kGuessedBaselines * baseline : kGuessedDepth;
  return mean + depth * forward.normalized();
}

/// min_x sum_i |(I - f_i f_i')(x - c_i)|^2 over the rays (c_i, f_i) through the pictures' middles.
Vec3 nearest_to_gazes(const std::vector<const Device*>& devices) {
  Mat3 normal = Mat3::Zero();
  Vec3 right = Vec3::Zero();
  for (const Device* device : devices) {
    const Vec3 forward = gaze(*device);
    const Mat3 across = Mat3::Identity() - forward * forward.transpose();
    normal += across;
    right += across * device->center();
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(normal);
  if (eigen.eigenvalues()(0) < kParallelGazes * static_cast<double>(devices.size())) {
    return guessed_center(devices);
  }
  const Vec3 center = solve_symmetric(normal, right);
  const auto in_front = std::count_if(devices.begin(), devices.end(), [&](const Device* device) {
    return (device->device_from_world * center).z() > 0;
  });
  return 2 * static_cast<std::size_t>(in_front) > devices.size() ? center : guessed_center(devices);
}

}  // namespace

Mat3 Camera::color_matrix_for(const std::string& projector) const {
  const auto at = color_matrix_by_projector.find(projector);
  if (at != color_matrix_by_projector.end()) return at->second;
  return color_matrix.value_or(Mat3::Identity());
}

Sphere working_volume(const Rig& rig) {
  if (rig.volume) return *rig.volume;
  const auto devices = all_devices(rig);
  if (devices.empty()) return {};
  Sphere volume;
  volume.center = nearest_to_gazes(devices);
  std::vector<double> radii, distances;
  for (const Device* device : devices) {
    radii.push_back(visible_radius(*device, volume.center));
    distances.push_back((device->center() - volume.center).norm());
  }
  volume.radius = lower_quantile(radii, 0.5);
  if (!(volume.radius > 0)) volume.radius = kGuessedRadiusShare * lower_quantile(distances, 0.5);
  return volume;
}

std::vector<int> adjacent_cameras(const Rig& rig, int camera, double min_cosine) {
  std::vector<int> result;
  const Vec3 forward = gaze(rig.cameras[static_cast<std::size_t>(camera)]);
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    if (static_cast<int>(c) == camera || rig.cameras[c].sees_texture_only) continue;
    if (gaze(rig.cameras[c]).dot(forward) > min_cosine) result.push_back(static_cast<int>(c));
  }
  return result;
}

void require_patterns(const Rig& rig, const std::string& source, const std::string& why) {
  for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
    if (rig.projectors[p].patterns.empty())
      throw InputError(source, "projectors[" + std::to_string(p) + "].pattern", "",
                       "this key is missing: " + why);
  }
}

std::string unit_name(const Rig& rig) { return rig.unit_known ? "mm" : "units"; }

double footprint(const Rig& rig) {
  const Sphere volume = working_volume(rig);
  std::vector<double> footprints;
  for (const Camera& camera : rig.cameras) {
    if (camera.sees_texture_only) continue;
    footprints.push_back(viewing_distance(camera, volume) / camera.focal_px());
  }
  return footprints.empty() ? 1 : upper_median(std::move(footprints));
}

Rig scaled(Rig rig, double factor) {
  for (Camera& camera : rig.cameras) camera.device_from_world.translation *= factor;
  for (Projector& projector : rig.projectors) projector.device_from_world.translation *= factor;
  if (rig.volume) {
    rig.volume->center *= factor;
    rig.volume->radius *= factor;
  }
  if (rig.floor) rig.floor->point *= factor;
  return rig;
}

}  // namespace pencilscan
