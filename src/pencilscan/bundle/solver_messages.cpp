#include "pencilscan/bundle/solver_messages.h"

#include <glog/logging.h>

namespace pencilscan {

void silence_solver_messages() { FLAGS_minloglevel = google::GLOG_FATAL; }

}  // namespace pencilscan
