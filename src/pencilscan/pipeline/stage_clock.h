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

/// Runs the stages of a frame: tells that each starts, and appends how long it took.
class StageClock {
 public:
  StageClock(const Progress& progress, std::vector<StageTime>& times)
      : progress_(progress), times_(times) {}

  template <class Work>
  void operator()(const char* stage, Work&& work) const {
    if (progress_) progress_(stage, 0);
    const Stopwatch watch;
    std::forward<Work>(work)();
    times_.push_back({stage, watch.seconds()});
  }

 private:
  const Progress& progress_;
  std::vector<StageTime>& times_;
};

}  // namespace pencilscan
