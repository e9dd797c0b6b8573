#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <memory>

#include "arrays.h"
#include "pencilscan/pencilscan.h"

namespace pencilscan::python {

using MeshPtr = std::shared_ptr<TriangleMesh>;

/// Lets Ctrl-C through, and calls `progress(stage, done)` unless it is None: False ends the call.
StageListener listener(const py::object& progress);

/// Pictures, results, and a frame stage by stage.
void add_frame(py::module_& module);

}  // namespace pencilscan::python
