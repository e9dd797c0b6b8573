#include "pencilscan/core/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#ifndef PENCILSCAN_STD_THREADS
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#endif

namespace pencilscan {
namespace {

int hardware_threads() {
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

#ifdef PENCILSCAN_STD_THREADS
std::atomic<int> limit{0};
#endif

}  // namespace

#ifdef PENCILSCAN_STD_THREADS

// Debian's oneTBB is not instrumented: under TSan the loops run on plain threads, so that races in
// our own code stay visible without suppressions.
ThreadLimit::ThreadLimit(int threads) { limit = threads; }
ThreadLimit::~ThreadLimit() { limit = 0; }

int thread_count() { return limit > 0 ? limit.load() : hardware_threads(); }

void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) {
  const std::size_t threads =
      std::min<std::size_t>(count, static_cast<std::size_t>(thread_count()));
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        body(i);
      } catch (...) {
        const std::lock_guard lock(failure_mutex);
        if (!failure) failure = std::current_exception();
      }
    }
  };
  std::vector<std::thread> pool;
  for (std::size_t t = 1; t < threads; ++t) pool.emplace_back(work);
  work();
  for (std::thread& thread : pool) thread.join();
  if (failure) std::rethrow_exception(failure);
}

#else

ThreadLimit::ThreadLimit(int threads)
    : control_(new tbb::global_control(
          tbb::global_control::max_allowed_parallelism,
          static_cast<std::size_t>(threads > 0 ? threads : hardware_threads()))) {}

ThreadLimit::~ThreadLimit() { delete static_cast<tbb::global_control*>(control_); }

int thread_count() {
  return static_cast<int>(
      tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
}

void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) {
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) { body(i); });
}

#endif

}  // namespace pencilscan
