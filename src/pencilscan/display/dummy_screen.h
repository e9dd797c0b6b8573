#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace pencilscan {

/// The least number of a display that nobody has: neither its socket nor its lock is in `folder`.
/// The server's own choice looks at sockets of its network alone, and takes the file of a server
/// outside of it.
[[nodiscard]] int free_display_number(const std::filesystem::path& folder = "/tmp");

/// An X server of its own without hardware (Xorg's driver "dummy"), with as many outputs as asked
/// for side by side: for tests, and for the virtual laboratory. Ends with this object.
class DummyScreen {
 public:
  struct Output {
    int width = 1280;   ///< px
    int height = 1024;  ///< px
    double refresh_hz = 60;
  };
  /// `folder`: for its configuration and log; made if missing. At most 16 outputs, named DUMMY0 and
  /// on. StageError when Xorg or its driver is missing, or it does not start.
  DummyScreen(const std::filesystem::path& folder, const std::vector<Output>& outputs);
  ~DummyScreen();
  DummyScreen(const DummyScreen&) = delete;
  DummyScreen& operator=(const DummyScreen&) = delete;

  /// ":7", for DISPLAY.
  [[nodiscard]] const std::string& display() const;
  /// A program must have these in its environment to be let in: DISPLAY, XAUTHORITY.
  void enter() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pencilscan
