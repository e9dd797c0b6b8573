#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "pencilscan/display/x_screen.h"

namespace pencilscan {

// What goes wrong on desktops, made on purpose: for tests and the virtual laboratory.

/// While alive, a window of somebody else lies on top of a part of an output.
class ForeignWindow {
 public:
  /// `where` in pixels of the output.
  ForeignWindow(const XScreen& screen, const DisplayOutput& output, const cv::Rect& where,
                const std::string& title);
  ~ForeignWindow();
  ForeignWindow(const ForeignWindow&) = delete;
  ForeignWindow& operator=(const ForeignWindow&) = delete;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// While alive, the output's blue is halved on its way, as night light does.
class NightLight {
 public:
  NightLight(const XScreen& screen, const DisplayOutput& output);
  ~NightLight();
  NightLight(const NightLight&) = delete;
  NightLight& operator=(const NightLight&) = delete;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pencilscan
