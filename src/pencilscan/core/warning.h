#pragma once

#include <string>
#include <utility>
#include <vector>

namespace pencilscan {

/// What a warning is about; programs act on this, never on the text.
enum class WarningCode {
  kColorsMix,       ///< colours of projectors cannot be told apart from each other, or of one
  kNoPicture,       ///< of a camera
  kWrongPicture,    ///< it was left out (pipeline/picture_check.h)
  kNoLines,         ///< a camera's picture shows none
  kLittleLight,     ///< figure "signal_to_noise": of the lines that were found
  kLinesTooClose,   ///< figure "line_spacing_px": at the volume's centre
  kOutOfFocus,      ///< of a camera; figure "contrast": energy of its lines, of the others'
  kSaturated,       ///< figure "share": of a camera's pixels
  kColorsFilledIn,  ///< pictures went through a mosaic and an interpolation
  kGamma,           ///< pictures are not coded as the rig says; figure "gamma" of the first camera
  kBlackLevel,   ///< figure "median": of the first camera's values, below the black that is stated
  kRigIsOff,     ///< figures "median_px", "expected_px": how crossing lines miss each other
  kDeviceIsOff,  ///< the same of one device's crossings, the others' meet
  kNamesDoubtful,   ///< most lines of a device have no name, or have the colours of other lines
  kPointsLeftOut,   ///< coordinates are not finite or absurd
  kTooFewPoints,    ///< for a surface
  kUnsupported,     ///< hardly any point has another curve beside it
  kCurvesOnly,      ///< dense depth found too little
  kNotClosed,       ///< figures "boundary", "non_manifold": edges of the surface
  kLittleMeasured,  ///< figure "share": of the closed surface
  kViewsDisagree,   ///< figure "deviations": of depths of different cameras
  kMissingLines,    ///< of a device; figures "share", "usual_share": of its lines, the others'
  kFewNames,        ///< figure "share": of the curve points that got their line
  kMotion,          ///< within the exposure; figures "way_mm", "way_sigma_mm"
  kVolumeCuts,      ///< figure "share": of the named lines, those that leave the volume
  kFloorCuts,       ///< figure "share": of the lines above the stated floor, those that go on below
  kFloorFound,      ///< figures "floor_x" to "normal_z": a plane that the rig does not state
};

/// The word for files: "saturated", "rig-is-off" and so on.
[[nodiscard]] const char* to_string(WarningCode code);

/// Something that a user should know of a result.
struct Warning {
  WarningCode code = WarningCode::kNoLines;
  std::string text = {};    ///< one sentence in plain words
  std::string device = {};  ///< name of the camera or projector it is about; empty: none alone
  std::vector<std::pair<std::string, double>> figures = {};
};

}  // namespace pencilscan
