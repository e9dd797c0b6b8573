#pragma once

#include <string>
#include <utility>
#include <vector>

#include "pencilscan/core/progress.h"
#include "pencilscan/core/stopwatch.h"

namespace pencilscan {

/// Seconds of one stage, wall clock.
struct StageTime {
  std::string stage;
  double seconds = 0;
};

/// Runs the stages of a frame: tells that each starts, and appends how long it took to `times`. One
/// without `times` tells nobody and measures nothing.
class StageClock {
 public:
  StageClock() = default;
  /// `times` must outlive the clock.
  StageClock(Progress progress, std::vector<StageTime>& times)
      : progress_(std::move(progress)), times_(&times) {}

  template <class Work>
  void operator()(const char* stage, Work&& work) const {
    if (progress_) progress_(stage, 0);
    const Stopwatch watch;
    std::forward<Work>(work)();
    if (times_ != nullptr) times_->push_back({stage, watch.seconds()});
  }

 private:
  Progress progress_;
  std::vector<StageTime>* times_ = nullptr;
};

}  // namespace pencilscan
