#include "pencilscan/core/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "pencilscan/core/cancellation.h"

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

thread_local const std::atomic<bool>* current_stop = nullptr;

}  // namespace

CancelScope::CancelScope(const std::atomic<bool>& stop) : outer_(current_stop) {
  current_stop = &stop;
}
CancelScope::~CancelScope() { current_stop = outer_; }
const std::atomic<bool>* CancelScope::current() { return current_stop; }

void stop_if_cancelled() {
  if (current_stop != nullptr && current_stop->load(std::memory_order_relaxed)) throw Cancelled();
}

namespace {

void run_loop(std::size_t count, const std::function<void(std::size_t)>& body);

/// Does `work` here and on so many other threads; on fewer where the system gives no more.
template <class Work>
void work_with(std::size_t others, const Work& work) {
  std::vector<std::thread> threads;
  threads.reserve(others);
  try {
    while (threads.size() < others) threads.emplace_back(work);
  } catch (const std::exception&) {
    // What the missing ones would do, the others do.
  }
  work();
  for (std::thread& thread : threads) thread.join();
}

}  // namespace

void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) {
  const std::atomic<bool>* stop = current_stop;
  if (stop == nullptr) {
    run_loop(count, body);
    return;
  }
  stop_if_cancelled();
  run_loop(count, [&](std::size_t i) {
    const CancelScope scope(*stop);  // the loop's threads are not its caller's
    stop_if_cancelled();
    body(i);
  });
  // An exception elsewhere ends oneTBB's nested loops early and silently.
  stop_if_cancelled();
}

void run_at_once(std::size_t count, std::size_t at_once,
                 const std::function<void(std::size_t)>& body) {
  const std::atomic<bool>* stop = current_stop;
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::size_t failed = count;
  std::exception_ptr failure;
  const auto work = [&] {
    std::optional<CancelScope> scope;
    if (stop != nullptr) scope.emplace(*stop);
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        stop_if_cancelled();
        body(i);
      } catch (...) {
        const std::lock_guard lock(mutex);
        next = count;
        if (i >= failed) return;
        failed = i;
        failure = std::current_exception();
      }
    }
  };
  work_with(std::max<std::size_t>(1, std::min(at_once, count)) - 1, work);
  if (failure) std::rethrow_exception(failure);
}

#ifdef PENCILSCAN_STD_THREADS

// Debian's oneTBB is not instrumented: under TSan the loops run on plain threads, so that races in
// our own code stay visible without suppressions.
ThreadLimit::ThreadLimit(int threads) { limit = threads; }
ThreadLimit::~ThreadLimit() { limit = 0; }

int thread_count() { return limit > 0 ? limit.load() : hardware_threads(); }

namespace {

void run_loop(std::size_t count, const std::function<void(std::size_t)>& body) {
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
  work_with(std::max<std::size_t>(1, threads) - 1, work);
  if (failure) std::rethrow_exception(failure);
}

}  // namespace

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

namespace {

void run_loop(std::size_t count, const std::function<void(std::size_t)>& body) {
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) { body(i); });
}

}  // namespace

#endif

}  // namespace pencilscan
