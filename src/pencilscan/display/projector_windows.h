#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "pencilscan/core/fault.h"
#include "pencilscan/display/output.h"
#include "pencilscan/display/x_screen.h"

namespace pencilscan {

/// Pictures on projectors: one borderless window per output, covering it pixel by pixel. Windows
/// live on a thread of their own; the functions may be called from any thread.
class ProjectorWindows {
 public:
  /// Opens a black window per use, in its order; colours and power saving of the outputs are plain
  /// while it lives. `display` as of XScreen. InputError when outputs do not fit (output_faults());
  /// StageError when there is no screen.
  explicit ProjectorWindows(const std::vector<OutputUse>& uses, const std::string& display = "");
  ~ProjectorWindows();
  ProjectorWindows(const ProjectorWindows&) = delete;
  ProjectorWindows& operator=(const ProjectorWindows&) = delete;

  [[nodiscard]] std::size_t size() const;
  /// Draws a picture (CV_8UC3 RGB of the panel's size) and waits until the X server has it. The
  /// time (host_now_ns()) when it had: light follows after the projector's own delay.
  std::int64_t show(std::size_t window, const cv::Mat& picture);
  /// What the output really shows.
  [[nodiscard]] cv::Mat read_back(std::size_t window);
  /// Reads back all outputs and compares with what was drawn last.
  ///   black, covered, other (shown_check.h), colors: something changes gamma; layout: outputs
  ///   changed since the windows were opened
  [[nodiscard]] std::vector<Fault> check();
  /// True once somebody pressed Escape or q, or closed a window.
  [[nodiscard]] bool dismissed() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pencilscan
