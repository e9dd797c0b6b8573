#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace pencilscan {

/// Watches what outputs really show, as a cable to each of them would see it: for the virtual
/// laboratory. The X server tells of every change (Damage), the output is then read back.
class ShownWatch {
 public:
  /// From the watch's own thread: output number `output` of the list shows `picture` (CV_8UC3, RGB)
  /// since host_now_ns() = time_ns, by the clock of the X server (some milliseconds coarse).
  /// Empty: it sends nothing.
  using Sink =
      std::function<void(std::size_t output, std::int64_t time_ns, const cv::Mat& picture)>;
  /// `display` as of XScreen; `outputs`: their names. Calls `sink` for each of them before it
  /// returns. StageError when the X server does not answer or cannot tell changes.
  ShownWatch(const std::string& display, std::vector<std::string> outputs, Sink sink);
  ~ShownWatch();
  /// Returns when everything that was shown until now has been told.
  void settle();
  ShownWatch(const ShownWatch&) = delete;
  ShownWatch& operator=(const ShownWatch&) = delete;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pencilscan
