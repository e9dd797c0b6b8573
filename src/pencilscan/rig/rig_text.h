#pragma once

#include <string>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// The text of a rig.json as a value; `name` stands for the file in an InputError.
[[nodiscard]] Rig rig_from_text(const std::string& text, const std::string& name = "rig");
/// As read_devices() of such a file.
[[nodiscard]] UncalibratedRig devices_from_text(const std::string& text,
                                                const std::string& name = "devices");
/// What write_rig() writes.
[[nodiscard]] std::string rig_text(const Rig& rig);

}  // namespace pencilscan
