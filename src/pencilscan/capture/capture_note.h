#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// capture.json in a projector's folder of Gray codes (docs/formats.md): how its pictures were
/// taken. Whoever goes on with a capture compares it.
struct CaptureNote {
  std::string projector;
  int width = 0;  ///< of the panel, px
  int height = 0;
  bool inverses = true;
  bool solids = false;
  struct CameraSize {
    std::string name;
    int width = 0;  ///< of its pictures, px
    int height = 0;
  };
  std::vector<CameraSize> cameras;  ///< all that looked, also those that saw nothing
};

/// The note of a capture with all cameras of the rig.
[[nodiscard]] CaptureNote capture_note(const Projector& projector, const std::vector<Camera>& all,
                                       bool inverses, bool solids);
/// `folder`/capture.json; StageError when it cannot be written.
void write_capture_note(const std::filesystem::path& folder, const CaptureNote& note);

/// True where the folder of a projector has a note.
[[nodiscard]] bool has_capture_note(const std::filesystem::path& folder);
/// InputError where the note in `folder` contradicts `wanted`. A folder without a note, taken by
/// another program, contradicts nothing.
void check_capture_note(const std::filesystem::path& folder, const CaptureNote& wanted);

}  // namespace pencilscan
