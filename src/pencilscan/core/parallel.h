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

/// Calls body(i) for i in [0, count), started in that order, at most `at_once` (>= 1) at a time,
/// each with parallel loops of its own: for long tasks that alone do not keep all threads busy.
/// After an exception no other one is started, and that of the smallest index is rethrown when all
/// have ended.
void run_at_once(std::size_t count, std::size_t at_once,
                 const std::function<void(std::size_t)>& body);

}  // namespace pencilscan
