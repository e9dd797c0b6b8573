#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <memory>

#include "arrays.h"
#include "pencilscan/pencilscan.h"

namespace pencilscan::python {

using MeshPtr = std::shared_ptr<TriangleMesh>;

/// The interpreter's lock given up while this lives. Where the interpreter ends meanwhile, the call
/// is waited for, and its thread does not come back: taking the lock then would end the process.
class Unlocked {
 public:
  Unlocked();
  ~Unlocked();
  Unlocked(const Unlocked&) = delete;
  Unlocked& operator=(const Unlocked&) = delete;

 private:
  py::gil_scoped_release released_;
};

/// Lets Ctrl-C through, and calls `progress(stage, done)` unless it is None: False ends the call,
/// as does the end of the interpreter.
StageListener listener(const py::object& progress);

/// Pictures, results, and a frame stage by stage.
void add_frame(py::module_& module);

}  // namespace pencilscan::python
