#pragma once

#include <cerrno>
#include <cmath>
#include <csignal>
#include <ctime>

namespace pencilscan::cli {

/// Ctrl-C (SIGINT) and SIGTERM as something to ask for, so that a command can end in order. Made
/// before any other thread: those that come later leave the signals to it.
class Interruption {
 public:
  Interruption() {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGINT);
    sigaddset(&signals_, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  }

  /// True when a signal came, now or before; waits for one so long.
  bool within(double seconds) {
    if (came_) return true;
    timespec patience{};
    patience.tv_sec = static_cast<std::time_t>(std::floor(seconds));
    patience.tv_nsec = static_cast<long>((seconds - std::floor(seconds)) * 1e9);
    came_ = sigtimedwait(&signals_, nullptr, &patience) > 0;
    return came_;
  }

 private:
  sigset_t signals_{};
  bool came_ = false;
};

}  // namespace pencilscan::cli
