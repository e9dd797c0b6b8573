#pragma once

#include <atomic>
#include <stdexcept>

namespace pencilscan {

/// A computation ended because its caller asked it to.
struct Cancelled : std::runtime_error {
  Cancelled() : std::runtime_error("cancelled") {}
};

/// While alive, the parallel loops that this thread starts, and those nested in them, look at
/// `stop` before every index and throw Cancelled once it is true. Computations of other threads do
/// not notice.
class CancelScope {
 public:
  explicit CancelScope(const std::atomic<bool>& stop);
  ~CancelScope();
  CancelScope(const CancelScope&) = delete;
  CancelScope& operator=(const CancelScope&) = delete;

  /// What this thread's loops look at; null outside all scopes.
  [[nodiscard]] static const std::atomic<bool>* current();

 private:
  const std::atomic<bool>* outer_;
};

/// Throws Cancelled where this thread is in a scope that was asked to stop.
void stop_if_cancelled();

}  // namespace pencilscan
