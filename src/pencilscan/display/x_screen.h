#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/display/output.h"

namespace pencilscan {

/// True when this program was built with SDL2 and the X libraries.
[[nodiscard]] bool can_display();

/// A connection to an X server: its outputs, what they really show, and what lies on top. One
/// thread at a time.
class XScreen {
 public:
  /// `display`: as the environment's DISPLAY; empty: that one. StageError when no server answers,
  /// or it cannot tell its outputs (RandR 1.3).
  explicit XScreen(const std::string& display = "");
  ~XScreen();
  XScreen(const XScreen&) = delete;
  XScreen& operator=(const XScreen&) = delete;

  [[nodiscard]] std::vector<DisplayOutput> outputs() const;
  /// The part of the desktop that the output shows, CV_8UC3 RGB: windows as they lie on each other,
  /// without the pointer. StageError when the output lies outside of the desktop.
  [[nodiscard]] cv::Mat read(const DisplayOutput& output) const;
  /// Titles of the windows of others that cover a part of the output, topmost first. `ours`: the
  /// beginning of the titles of our own windows.
  [[nodiscard]] std::vector<std::string> windows_over(const DisplayOutput& output,
                                                      const std::string& ours) const;
  /// Black where no window is. Newly lit outputs show nothing else until then.
  void paint_desktop_black();
  /// True when the output's colours are changed on their way (gamma table), as colour management
  /// and night light do.
  [[nodiscard]] bool alters_colors(const DisplayOutput& output) const;

 private:
  friend class PlainOutputs;
  friend class ForeignWindow;
  friend class NightLight;
  struct State;
  std::unique_ptr<State> state_;
};

/// While alive, these outputs have no gamma and the screen neither saves power nor blanks; puts
/// back what was there. Keeps a reference to `screen`.
class PlainOutputs {
 public:
  PlainOutputs(XScreen& screen, std::span<const DisplayOutput> outputs);
  ~PlainOutputs();
  PlainOutputs(const PlainOutputs&) = delete;
  PlainOutputs& operator=(const PlainOutputs&) = delete;

 private:
  struct Before;
  std::unique_ptr<Before> before_;
};

}  // namespace pencilscan
