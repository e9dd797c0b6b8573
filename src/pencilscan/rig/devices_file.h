#pragma once

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Writes a rig.json that lacks what is not given, whole or not at all; read_devices() reads it,
/// and read_rig() where everything is given.
void write_devices(const UncalibratedRig& devices, const std::filesystem::path& path);

}  // namespace pencilscan
