#include "pencilscan/api/run_stages.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "pencilscan/core/cancellation.h"

namespace pencilscan {
namespace {

constexpr auto kInterval = std::chrono::milliseconds(50);  // Ctrl-C is noticed within it

/// What the working thread and the waiting one share.
class Work {
 public:
  void announce(std::string_view stage) {
    {
      const std::lock_guard lock(mutex_);
      announced_.emplace_back(stage);
    }
    changed_.notify_one();
    if (stop) throw Cancelled();
  }
  void finish() {
    {
      const std::lock_guard lock(mutex_);
      finished_ = true;
    }
    changed_.notify_one();
  }
  /// The next stage that was announced, however short it was, or the same one after a while; false
  /// once all were told and the work is done.
  bool wait(std::string& stage) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kInterval, [&] { return finished_ || !announced_.empty(); });
    if (announced_.empty()) return !finished_;
    stage = std::move(announced_.front());
    announced_.pop_front();
    return true;
  }

  std::atomic<bool> stop{false};

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::string> announced_;
  bool finished_ = false;
};

}  // namespace

void run_stages(const StageListener& listener, std::span<const std::string_view> stages,
                const std::function<void(const Progress&)>& work) {
  if (!listener) {
    work({});
    return;
  }
  Work shared;
  std::exception_ptr failure;
  std::thread worker([&] {
    try {
      const CancelScope scope(shared.stop);
      work([&](std::string_view stage, double) { shared.announce(stage); });
    } catch (...) {
      failure = std::current_exception();
    }
    shared.finish();
  });
  std::exception_ptr refusal;
  std::string stage(stages.front());
  double done = 0;
  while (shared.wait(stage)) {
    if (shared.stop) continue;
    try {
      const auto at = std::find(stages.begin(), stages.end(), stage);
      if (at != stages.end())
        done = static_cast<double>(at - stages.begin()) / static_cast<double>(stages.size());
      if (!listener(stage, done)) shared.stop = true;
    } catch (...) {
      refusal = std::current_exception();
      shared.stop = true;
    }
  }
  worker.join();
  if (refusal) std::rethrow_exception(refusal);
  if (failure) std::rethrow_exception(failure);
  if (shared.stop) throw Cancelled();
}

}  // namespace pencilscan
