#pragma once

namespace pencilscan {

/// Ceres tells standard error through glog where it could not go on, which is a result here and no
/// error. For programs of our own: the setting is that of the whole process.
void silence_solver_messages();

}  // namespace pencilscan
