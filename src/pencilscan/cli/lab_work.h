#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "pencilscan/core/fault.h"

namespace pencilscan::cli {

/// One piece of work at a time, on a thread of its own, with what it says. Called from several
/// threads at once.
class LabWork {
 public:
  LabWork() = default;
  ~LabWork() { end(); }
  LabWork(const LabWork&) = delete;
  LabWork& operator=(const LabWork&) = delete;

  /// Begins what is called `what`; an exception that leaves `work` is said as a fault. Empty, or
  /// why it cannot begin: something is running.
  [[nodiscard]] std::string begin(const std::string& what, std::function<void()> work);
  /// How far the work is; false: it has to stop.
  bool progress(const std::string& what, double share);
  void say(const std::string& text, bool fault = false);
  void say(const std::vector<Fault>& faults);
  void stop() { stopping_ = true; }
  /// Stops what runs, and waits for it.
  void end();

  [[nodiscard]] bool running() const;
  [[nodiscard]] bool stopping() const { return stopping_; }
  /// {"running", "what", "share"}.
  [[nodiscard]] nlohmann::ordered_json json() const;
  /// [{"text", "fault"}], newest first.
  [[nodiscard]] nlohmann::ordered_json said() const;

 private:
  mutable std::mutex mutex_;  ///< of what follows
  std::string what_;
  double share_ = 0;
  bool running_ = false;
  std::deque<std::pair<std::string, bool>> said_;  ///< newest first; true: a fault

  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace pencilscan::cli
