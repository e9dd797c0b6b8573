#pragma once

/// The library's front door: everything that a program outside needs, by
///
///   #include <pencilscan/pencilscan.h>
///   const pencilscan::Rig rig = pencilscan::read_rig("rig.json");
///   const auto result = pencilscan::reconstruct(rig, {{"cam0", image0}, {"cam1", image1}});
///
/// Bad input is an InputError, a stage without a result a StageError, a call that its caller ended
/// a Cancelled. Nothing prints and nothing ends the caller's process. Lengths are millimetres,
/// angles radians, images in RGB order (docs/library.md).

#include "pencilscan/api/calibrate.h"
#include "pencilscan/api/evaluate.h"
#include "pencilscan/api/images.h"
#include "pencilscan/api/reconstruct.h"
#include "pencilscan/api/simulate.h"
#include "pencilscan/api/stages.h"
#include "pencilscan/api/version.h"
#include "pencilscan/core/cancellation.h"
#include "pencilscan/core/error.h"
#include "pencilscan/geometry/mesh.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/io/mesh_unit.h"
#include "pencilscan/labeling/point_file.h"
#include "pencilscan/planning/ring.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/rig/rig_text.h"
