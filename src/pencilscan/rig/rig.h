#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/geometry/device.h"
#include "pencilscan/io/mosaic.h"
#include "pencilscan/pattern/line_pattern.h"
#include "pencilscan/rig/color_registration.h"

namespace pencilscan {

struct Camera : Device {
  /// camera RGB = matrix * projector RGB, for every projector or by projector name.
  std::optional<Mat3> color_matrix;
  std::map<std::string, Mat3> color_matrix_by_projector;
  double gamma = 1;                ///< > 0; with the black level: io/linear_light.h
  double black_level = 0;          ///< stored value of no light, in [0, 1)
  std::optional<Mosaic> mosaic;    ///< its images have one channel, one colour a pixel
  bool sees_texture_only = false;  ///< "role": "texture"
  ColorRegistration color_registration;

  /// The matrix for one projector; identity where the rig states none.
  [[nodiscard]] Mat3 color_matrix_for(const std::string& projector) const;
  [[nodiscard]] bool states_color_matrix() const {
    return color_matrix.has_value() || !color_matrix_by_projector.empty();
  }
};

struct Projector : Device {
  std::vector<LinePattern> patterns;  ///< empty where nothing needs it (calibration)
  ColorRegistration color_registration;
  std::string output;  ///< the computer's video output that feeds it ("HDMI-1"); empty: not stated

  /// Panel size across the lines of a pattern, px.
  [[nodiscard]] int size_across(const LinePattern& pattern) const {
    return pattern.axis == Axis::kColumn ? width : height;
  }
  [[nodiscard]] int line_count(const LinePattern& pattern) const {
    return pattern.line_count(size_across(pattern));
  }
};

/// What the object stands on.
struct Floor {
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();  ///< unit, towards the object

  /// Height of a point above it, mm.
  [[nodiscard]] double height(const Vec3& x) const { return normal.dot(x - point); }
};

/// All devices and what they show, as one value (rig.json).
struct Rig {
  std::vector<Camera> cameras;
  std::vector<Projector> projectors;
  std::optional<Sphere> volume;  ///< as stated by the file
  std::optional<Floor> floor;    ///< what lies below it, or within a line spacing, is no object
  bool unit_known = true;        ///< "unit": "mm"; false: "unknown"
};

/// Reads rig.json; InputError names file, field, value and rule.
[[nodiscard]] Rig read_rig(const std::filesystem::path& path);
/// Which parts of a device's calibration a file states; each may be rough.
struct GivenCalibration {
  bool K = false;
  bool distortion = false;
  bool pose = false;  ///< R and t
};
/// Devices that are still to be calibrated.
struct UncalibratedRig {
  Rig rig;                              ///< what is missing: K = I, no distortion, pose = I
  std::vector<GivenCalibration> given;  ///< cameras, then projectors
};
/// Reads a rig.json in which K, distortion, and R with t may be missing.
[[nodiscard]] UncalibratedRig read_devices(const std::filesystem::path& path);

/// Writes rig.json whole or not at all; read_rig() of it gives the same doubles.
void write_rig(const Rig& rig, const std::filesystem::path& path);

/// The sphere that holds the object: the stated one, or else derived from the devices: the point
/// nearest to all optical axes (least squares), with the radius that the median device sees whole.
[[nodiscard]] Sphere working_volume(const Rig& rig);

}  // namespace pencilscan
