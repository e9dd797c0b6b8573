#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace pencilscan {

/// Another program, run without a shell, in a session of its own: Ctrl-C at a terminal does
/// not reach it. It ends with this object, and with this program.
/// Start it from a thread that lives as long: the kernel ends it with the thread that made it.
class ChildProcess {
 public:
  struct Options {
    std::map<std::string, std::string> environment;  ///< added to or replacing this program's
    std::string error_file;  ///< its standard error goes there; empty: to ours
    bool piped = false;      ///< its standard output is ours to read
  };
  /// arguments[0] is the program, found along PATH. StageError when it cannot be started.
  explicit ChildProcess(const std::vector<std::string>& arguments)
      : ChildProcess(arguments, Options()) {}
  ChildProcess(const std::vector<std::string>& arguments, const Options& options);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  using Seconds = std::chrono::duration<double>;
  /// The next line of its output, without its end; nothing when there is none in time, or ever.
  [[nodiscard]] std::optional<std::string> read_line(Seconds patience);
  /// Its exit code (128 + signal when one ended it), once it has ended; nothing when it still runs.
  std::optional<int> wait(Seconds patience);
  [[nodiscard]] bool running() { return !wait(Seconds(0)).has_value(); }
  /// Asks it to end, and after some seconds makes it.
  void stop();
  [[nodiscard]] pid_t id() const { return id_; }

 private:
  pid_t id_ = -1;
  int output_ = -1;  ///< what we read from
  std::string unread_;
  std::optional<int> code_;
};

}  // namespace pencilscan
