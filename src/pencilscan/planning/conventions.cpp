#include "pencilscan/planning/conventions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "pencilscan/core/formatted.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {
namespace {

RigidTransform as_stated(const RigidTransform& pose) { return pose; }

RigidTransform as_camera_to_world(const RigidTransform& pose) {
  const Mat3 rotation = pose.rotation.transpose();
  return {rotation, -rotation * pose.translation};
}

RigidTransform with_center(const RigidTransform& pose) {
  return {pose.rotation, -pose.rotation * pose.translation};
}

/// Of a frame whose y goes up and whose z goes back to the one of rig.json, or the other way round.
RigidTransform with_y_up(const RigidTransform& pose) {
  const Mat3 flip = Vec3(1, -1, -1).asDiagonal();
  return {flip * pose.rotation, flip * pose.translation};
}

RigidTransform as_camera_to_world_with_y_up(const RigidTransform& pose) {
  return with_y_up(as_camera_to_world(pose));
}

template <class Visit>
void for_each_device(Rig& rig, Visit visit) {
  for (Camera& camera : rig.cameras) visit(static_cast<Device&>(camera));
  for (Projector& projector : rig.projectors) visit(static_cast<Device&>(projector));
}

/// Share of the devices that have the place in their picture that all have in common.
double share_that_looks(Rig rig, RigidTransform (*meant)(const RigidTransform&)) {
  for_each_device(
      rig, [&](Device& device) { device.device_from_world = meant(device.device_from_world); });
  const Vec3 center = working_volume(rig).center;
  double count = 0;
  double looking = 0;
  for_each_device(rig, [&](const Device& device) {
    ++count;
    const auto pixel = device.project(center);
    looking += pixel && device.contains(*pixel) ? 1 : 0;
  });
  return count > 0 ? looking / count : 1;
}

/// Whether the lens model shows nearly all of the picture: beyond where it folds back, pixels see
/// nothing. Fits of wide lenses may fold in the very corners.
bool shows_picture(const Device& device) {
  constexpr double kNearPx = 1;
  constexpr double kNearlyAll = 0.85;
  const Vec2 middle(0.5 * device.width, 0.5 * device.height);
  const Mat3 from_pixel = device.K.inverse();
  for (const double across : {-kNearlyAll, 0.0, kNearlyAll}) {
    for (const double down : {-kNearlyAll, 0.0, kNearlyAll}) {
      const Vec2 pixel = middle + Vec2(across, down).cwiseProduct(middle);
      const Vec2 seen = (from_pixel * pixel.homogeneous()).head<2>();
      const Vec2 back = distort(device.distortion, undistort(device.distortion, seen));
      if (!((back - seen).norm() * device.focal_px() < kNearPx)) return false;
    }
  }
  return true;
}

std::string degrees(double radians) { return formatted(radians * 180 / std::numbers::pi, "%.0f"); }

}  // namespace

std::optional<std::string> pose_convention_warning(const Rig& rig) {
  constexpr double kFew = 0.5;
  constexpr double kNearlyAll = 0.9;
  constexpr std::size_t kLeastDevices = 4;  // two or three meet somewhere, whatever is meant
  if (rig.cameras.size() + rig.projectors.size() < kLeastDevices) return std::nullopt;
  const double stated = share_that_looks(rig, as_stated);
  if (stated > kFew) return std::nullopt;
  struct Reading {
    RigidTransform (*meant)(const RigidTransform&);
    const char* words;
    const char* remedy;
  };
  constexpr std::array kReadings = std::to_array<Reading>({
      {as_camera_to_world, "R and t are camera-to-world", "write R' and -R't"},
      {with_center, "t is the devices' centre", "write -R t"},
      {with_y_up, "devices look along -z with y up (OpenGL, Blender)",
       "change the sign of the last two rows of R and t"},
      {as_camera_to_world_with_y_up,
       "R and t are camera-to-world and devices look along -z with y up (OpenGL, Blender)",
       "write R' and -R't, then change the sign of their last two rows"},
  });
  double share = 0;
  const Reading* best = nullptr;
  for (const Reading& reading : kReadings) {
    const double looking = share_that_looks(rig, reading.meant);
    if (looking < kNearlyAll || looking <= share) continue;
    share = looking;
    best = &reading;
  }
  if (best == nullptr) return std::nullopt;
  return "only " + formatted(100 * stated, "%.0f") + " % of the devices look at one place; if " +
         best->words + ", " + formatted(100 * share, "%.0f") +
         " % do. X_device = R X_world + t is what the rig states: " + best->remedy;
}

std::optional<std::string> intrinsics_convention_warning(const Rig& rig) {
  constexpr double kWidest = 150 * std::numbers::pi / 180;
  constexpr double kRim = 0.1;  // of the picture
  std::optional<std::string> warning;
  const auto look = [&](const Device& device, bool is_camera) {
    if (warning) return;
    const double angle = 2 * std::atan(0.5 * device.width / std::abs(device.K(0, 0)));
    if (angle > kWidest) {
      warning = "K of " + device.name + " has a focal length of " + formatted(device.K(0, 0)) +
                " px for " + std::to_string(device.width) + " columns: it sees " + degrees(angle) +
                " degrees. K is in pixels: millimetres over the width of a pixel";
      return;
    }
    // Decentring of lenses is below a hundredth; k3 taken for p1 is not.
    constexpr double kLargestTangential = 0.02;
    const double tangential =
        std::max(std::abs(device.distortion[2]), std::abs(device.distortion[3]));
    if (tangential > kLargestTangential) {
      warning = "distortion of " + device.name + " has p1 = " + formatted(device.distortion[2]) +
                ", p2 = " + formatted(device.distortion[3]) +
                ", as no lens has: the order is k1, k2, p1, p2, k3";
      return;
    }
    if (!shows_picture(device)) {
      warning = "distortion of " + device.name +
                " folds the picture back before its rim: it is of another model (the order is k1, "
                "k2, p1, p2, k3, on coordinates divided by the depth), or of another K";
      return;
    }
    const Vec2 center(device.K(0, 2) / device.width, device.K(1, 2) / device.height);
    // Projectors shift their picture; cameras' lenses hardly do.
    if (is_camera && (center.minCoeff() < kRim || center.maxCoeff() > 1 - kRim)) {
      warning = "K of " + device.name + " has its principal point at " + formatted(device.K(0, 2)) +
                ", " + formatted(device.K(1, 2)) +
                " px, at the rim of its picture: the middle of " +
                size_text(device.width, device.height) + " px is usual";
    }
  };
  for (const Camera& camera : rig.cameras) look(camera, true);
  for (const Projector& projector : rig.projectors) look(projector, false);
  return warning;
}

std::optional<std::string> shared_pose_warning(const Rig& rig) {
  constexpr double kSame = 1e-9;  // of the numbers: copies, as far as files round them
  // The pictures in plain light may be another camera's, named once more.
  const auto measures = [&](std::size_t d) {
    return d >= rig.cameras.size() || !rig.cameras[d].sees_texture_only;
  };
  for (std::size_t a = 0; a < device_count(rig); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      if (!measures(a) || !measures(b)) continue;
      const RigidTransform& one = device_at(rig, a).device_from_world;
      const RigidTransform& other = device_at(rig, b).device_from_world;
      if ((one.rotation - other.rotation).norm() > kSame ||
          (one.translation - other.translation).norm() > kSame * one.translation.norm())
        continue;
      return device_at(rig, b).name + " and " + device_at(rig, a).name +
             " have the same R and t: two devices stand in two places; was the calibration of one "
             "given to both?";
    }
  }
  return std::nullopt;
}

}  // namespace pencilscan
