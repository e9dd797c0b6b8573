#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/capture/camera_group.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// How the address of a camera begins that is a folder which another program puts pictures into.
inline constexpr const char* kFolderDevice = "folder:";

/// How one camera of the rig is reached and set (lab.json).
struct LabCamera {
  std::string device;                ///< "aravis:Basler-2345", "v4l2:/dev/video0", "folder:shots"
  std::vector<std::string> command;  ///< of a command camera, instead of `device`
  std::optional<double> exposure_ms;
  std::optional<double> gain;
  std::optional<std::string> pixel_format;
  bool of_command_line = false;  ///< named there, and not in lab.json

  friend bool operator==(const LabCamera&, const LabCamera&) = default;
};

/// lab.json: the devices of a laboratory, beside rig.json, which says what they are.
struct Lab {
  Trigger trigger = Trigger::kFree;
  double rate_hz = 10;         ///< of frames, > 0
  std::string line = "Line0";  ///< that the trigger's wire is on
  double patience_s = 3;       ///< for a picture that was asked for, > 0
  double max_spread_ms = 0;    ///< of the pictures of a frame; 0: a quarter of the exposure
  std::map<std::string, LabCamera> cameras;    ///< by name in the rig
  std::map<std::string, std::string> outputs;  ///< by name of the projector, before the rig's own
  std::map<std::string, double> delay_ms;      ///< measured, by name of the projector

  friend bool operator==(const Lab&, const Lab&) = default;
};

/// Reads lab.json; InputError names file, field, value and rule. Paths in it are relative to its
/// folder.
[[nodiscard]] Lab read_lab(const std::filesystem::path& path);
/// The folders of cameras are written relative to it.
void write_lab(const Lab& lab, const std::filesystem::path& path);

/// Cameras of all back ends that can be found: those of the network, of USB and of the kernel.
[[nodiscard]] std::vector<CameraInfo> list_cameras();

/// "cam0=aravis:Basler-2345" as a name and a camera; InputError of `option`.
[[nodiscard]] std::pair<std::string, LabCamera> lab_camera_from_text(const std::string& text,
                                                                     const std::string& option);

/// Opens one by its address. InputError for an address of no back end, StageError when it does not
/// answer.
[[nodiscard]] std::unique_ptr<CameraDevice> open_camera(const LabCamera& camera);

/// The settings of a camera of the rig in this laboratory.
[[nodiscard]] CameraSettings settings_for(const Lab& lab, const Camera& camera);

/// Opens every camera of the rig. InputError, with its place in `source` (lab.json) or on the
/// command line, when one is not in the laboratory, is the device of another, or is none;
/// StageError with its name when it cannot be opened.
[[nodiscard]] std::vector<NamedCamera> open_lab_cameras(const Lab& lab, const Rig& rig,
                                                        const std::string& source);

/// The limit of the spread that holds: as stated, or a quarter of the longest exposure (what moves
/// is then displaced between views by a quarter of what it is blurred by).
[[nodiscard]] double spread_limit_ms(const Lab& lab);

}  // namespace pencilscan
