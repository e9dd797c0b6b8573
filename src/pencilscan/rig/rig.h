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

/// A camera: where it stands, and what its pictures' values mean.
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

/// A projector: where it stands, and what it shows.
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

/// A pattern of a projector, by index.
struct PatternRef {
  int projector = 0;
  int pattern = 0;
  friend bool operator==(const PatternRef&, const PatternRef&) = default;
};

/// A rig shows at most so many patterns in all; the reader refuses more.
inline constexpr std::size_t kMostPatterns = 256;

/// All devices and what they show, as one value (rig.json).
struct Rig {
  std::vector<Camera> cameras;
  std::vector<Projector> projectors;
  std::optional<Sphere> volume;  ///< as stated by the file
  std::optional<Floor> floor;    ///< what lies below it, or within a line spacing, is no object
  bool unit_known = true;        ///< "unit": "mm"; false: "unknown"

  [[nodiscard]] const Camera& camera(int index) const {
    return cameras[static_cast<std::size_t>(index)];
  }
  [[nodiscard]] const Projector& projector(int index) const {
    return projectors[static_cast<std::size_t>(index)];
  }
  [[nodiscard]] const LinePattern& pattern(PatternRef ref) const {
    return projector(ref.projector).patterns[static_cast<std::size_t>(ref.pattern)];
  }
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

/// InputError of `source` where a projector has no pattern; `why`: what that means there.
void require_patterns(const Rig& rig, const std::string& source, const std::string& why);

/// The sphere that holds the object: the stated one, or else derived from the devices: the point
/// nearest to the rays through all pictures' middles (least squares), with the radius that the
/// median device sees whole.
[[nodiscard]] Sphere working_volume(const Rig& rig);

/// Name of its unit of length for people: "mm", or "units" where it is not known.
[[nodiscard]] std::string unit_name(const Rig& rig);

/// What one pixel covers at the volume's centre, square to the line of sight, in the rig's unit:
/// the median over the cameras that see patterns.
[[nodiscard]] double footprint(const Rig& rig);

/// The same rig with all lengths times `factor`, > 0: pictures and angles stay.
[[nodiscard]] Rig scaled(Rig rig, double factor);

/// Cameras that see much of what this one sees: the cosine of the angle between their axes is
/// larger than this; as it stands, they lie within about 75 degrees.
[[nodiscard]] std::vector<int> adjacent_cameras(const Rig& rig, int camera,
                                                double min_cosine = 0.25);

}  // namespace pencilscan
