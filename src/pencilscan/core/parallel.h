#pragma once

#include <cstddef>
#include <functional>

namespace pencilscan {

/// While alive, parallel loops use at most `threads` threads (0: all cores). One at a time.
class ThreadLimit {
 public:
  explicit ThreadLimit(int threads);
  ~ThreadLimit();
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;

 private:
  void* control_ = nullptr;
};

/// Number of threads that parallel loops use now, >= 1.
[[nodiscard]] int thread_count();

/// Calls body(i) for i in [0, count), each exactly once, in any order, on several threads.
/// Deterministic as long as body(i) writes only to places of its own; reduce in index order after.
/// The first exception by index of detection is rethrown.
void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body);

}  // namespace pencilscan
