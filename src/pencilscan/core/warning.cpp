#include "pencilscan/core/warning.h"

namespace pencilscan {

const char* to_string(WarningCode code) {
  switch (code) {
    case WarningCode::kColorsMix:
      return "colors-mix";
    case WarningCode::kNoPicture:
      return "no-picture";
    case WarningCode::kWrongPicture:
      return "wrong-picture";
    case WarningCode::kNoLines:
      return "no-lines";
    case WarningCode::kLittleLight:
      return "little-light";
    case WarningCode::kLinesTooClose:
      return "lines-too-close";
    case WarningCode::kOutOfFocus:
      return "out-of-focus";
    case WarningCode::kSaturated:
      return "saturated";
    case WarningCode::kColorsFilledIn:
      return "colors-filled-in";
    case WarningCode::kGamma:
      return "gamma";
    case WarningCode::kBlackLevel:
      return "black-level";
    case WarningCode::kRigIsOff:
      return "rig-is-off";
    case WarningCode::kDeviceIsOff:
      return "device-is-off";
    case WarningCode::kNamesDoubtful:
      return "names-doubtful";
    case WarningCode::kPointsLeftOut:
      return "points-left-out";
    case WarningCode::kTooFewPoints:
      return "too-few-points";
    case WarningCode::kUnsupported:
      return "unsupported";
    case WarningCode::kCurvesOnly:
      return "curves-only";
    case WarningCode::kNotClosed:
      return "not-closed";
    case WarningCode::kLittleMeasured:
      return "little-measured";
    case WarningCode::kViewsDisagree:
      return "views-disagree";
    case WarningCode::kMissingLines:
      return "missing-lines";
    case WarningCode::kFewNames:
      return "few-names";
    case WarningCode::kMotion:
      return "motion";
    case WarningCode::kVolumeCuts:
      return "volume-cuts";
    case WarningCode::kFloorCuts:
      return "floor-cuts";
    case WarningCode::kFloorFound:
      return "floor-found";
  }
  return "";
}

}  // namespace pencilscan
