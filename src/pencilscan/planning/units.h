#pragma once

#include <optional>
#include <string>

#include "pencilscan/geometry/mesh.h"
#include "pencilscan/rig/rig.h"

// Lengths in the wrong unit: a mesh in metres before a rig in millimetres is a speck that no line
// crosses, and nothing later on can say why.

namespace pencilscan {

/// Why the size of an object does not fit the rig's volume, with the unit that its file is probably
/// in and what to do (`--scale F` multiplies the file's lengths, `--fit` fits them into the
/// volume); nothing where it does. An object fits that reaches from a tenth of the volume's radius
/// to twice of it, around the middle of its bounding box. `scale`: by what its file was multiplied
/// already. The advice is the same for any.
[[nodiscard]] std::optional<std::string> object_unit_warning(const TriangleMesh& object,
                                                             const Rig& rig, double scale = 1);

/// Why the volume that a rig states cannot be what its devices stand around: no camera sees its
/// middle, or its radius is out of proportion to their distance; with the factor that would put it
/// right, where the factor is one between units. Nothing where it is plausible, or derived.
[[nodiscard]] std::optional<std::string> volume_unit_warning(const Rig& rig);

/// Why the devices of a rig in millimetres cannot stand where it says: all lenses lie within a
/// centimetre, or two lie a kilometre apart; with the unit that t is probably in.
[[nodiscard]] std::optional<std::string> pose_unit_warning(const Rig& rig);

}  // namespace pencilscan
