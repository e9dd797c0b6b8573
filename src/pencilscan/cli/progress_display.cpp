#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstring>
#include <iostream>
#include <memory>
#include <mutex>

#include "pencilscan/cli/command.h"

namespace pencilscan::cli {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kBarInterval = std::chrono::milliseconds(100);
constexpr auto kLineInterval = std::chrono::seconds(5);
constexpr int kBarWidth = 30;
/// Steps that take less were there already (frames that are resumed): no measure of those to come.
constexpr auto kNoStep = std::chrono::milliseconds(50);
/// Seconds of a stage before its rest is foretold.
constexpr double kEnoughToForetell = 1;

double seconds_between(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

/// "about 3 min left".
std::string time_left(double seconds) {
  const auto text = [](double value, const char* unit) {
    return "about " + std::to_string(std::lround(std::max(1.0, value))) + unit + " left";
  };
  if (seconds < 90) return text(seconds, " s");
  return seconds < 5400 ? text(seconds / 60, " min") : text(seconds / 3600, " h");
}

// ---- the last line, when Ctrl-C ends the program
// --------------------------------------------------

std::array<std::array<char, 400>, 2> last_lines{};
std::atomic<const char*> last_line{nullptr};

std::atomic_flag is_ending = ATOMIC_FLAG_INIT;

/// Prints the line that the display has ready, and lets the signal end the program as ever. A
/// second signal, which another thread may take meanwhile (timeout sends two), waits for that.
extern "C" void end_with_last_line(int signal) {
  if (is_ending.test_and_set()) return;
  if (const char* line = last_line.load()) {
    const ssize_t written = ::write(STDERR_FILENO, line, std::strlen(line));
    static_cast<void>(written);
  }
  ::signal(signal, SIG_DFL);
  ::raise(signal);  // taken once this handler has ended
}

void catch_interruptions() {
  struct sigaction action {};
  action.sa_handler = end_with_last_line;
  for (const int signal : {SIGINT, SIGTERM}) {
    struct sigaction earlier {};
    ::sigaction(signal, nullptr, &earlier);
    if (earlier.sa_handler == SIG_DFL) ::sigaction(signal, &action, nullptr);
  }
}

/// Makes the line while the other one stays readable.
void prepare_last_line(const std::string& text) {
  static std::size_t next = 0;
  auto& line = last_lines[next++ % last_lines.size()];
  const std::size_t length = std::min(text.size(), line.size() - 1);
  std::memcpy(line.data(), text.data(), length);
  line[length] = '\0';
  last_line.store(line.data());
}

// ---- the display --------------------------------------------------------------------------------

/// A stage without what counts its steps: "frame 000003, 3 of 30: depth" is "frame".
std::string_view stage_of(std::string_view what) {
  return what.substr(0, what.find_first_of("0123456789,:"));
}

class ProgressDisplay {
 public:
  explicit ProgressDisplay(std::string if_interrupted)
      : if_interrupted_(std::move(if_interrupted)) {
    catch_interruptions();
  }
  ~ProgressDisplay() { last_line.store(nullptr); }
  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  void tell(std::string_view what, double fraction) {
    const std::lock_guard lock(mutex_);
    const auto now = Clock::now();
    const double share = std::clamp(fraction, 0.0, 1.0);
    const bool is_new = stage_of(what) != stage_;
    follow(what, share, now);
    std::string line(what);
    if (const std::string left = foretold(share, now); !left.empty()) line += ", " + left;
    prepare_last_line((terminal_ ? "\r\033[K" : "") + std::string("pencilscan: interrupted at ") +
                      std::string(what) + if_interrupted_ + "\n");
    const Clock::duration interval = terminal_ ? Clock::duration(kBarInterval) : kLineInterval;
    const bool is_end = share >= 1 && (terminal_ || shown_share_ < 1);
    if (!is_new && now - shown_ < interval && !is_end) return;
    shown_ = now;
    shown_share_ = share;
    show(line, share);
  }

 private:
  /// Keeps from when, and from which share on, the stage's speed is measured.
  void follow(std::string_view what, double share, Clock::time_point now) {
    if (stage_of(what) != stage_ || share < share_) {
      stage_ = stage_of(what);
      begin_ = told_ = now;
      begin_share_ = share;
    } else if (share > share_ && now - told_ < kNoStep && share_ == begin_share_) {
      begin_ = now;
      begin_share_ = share;
    }
    if (share != share_) told_ = now;
    share_ = share;
  }

  [[nodiscard]] std::string foretold(double share, Clock::time_point now) const {
    const double seconds = seconds_between(begin_, now);
    if (share >= 1 || share <= begin_share_ || seconds < kEnoughToForetell) return "";
    // Between two steps the last one's end is what is known.
    const double known = seconds_between(begin_, told_);
    const double rest = known * (1 - share) / (share - begin_share_) - (seconds - known);
    return time_left(std::max(0.0, rest));
  }

  void show(const std::string& line, double share) const {
    if (!terminal_) {
      std::cerr << line << ", " << static_cast<int>(100 * share) << " %" << std::endl;
      return;
    }
    const auto full = static_cast<std::size_t>(share * kBarWidth);
    std::cerr << "\r\033[K[" << std::string(full, '#') << std::string(kBarWidth - full, '.') << "] "
              << line << (share >= 1 ? "\n" : "") << std::flush;
  }

  std::mutex mutex_;
  std::string if_interrupted_;
  bool terminal_ = ::isatty(STDERR_FILENO) == 1;
  Clock::time_point shown_ = Clock::now();
  double shown_share_ = 0;
  std::string stage_;
  Clock::time_point begin_ = Clock::now();
  Clock::time_point told_ = Clock::now();
  double begin_share_ = 0;
  double share_ = 0;
};

}  // namespace

Progress stderr_progress(const std::string& if_interrupted) {
  auto display = std::make_shared<ProgressDisplay>(if_interrupted.empty() ? if_interrupted
                                                                          : "; " + if_interrupted);
  return [display](std::string_view what, double fraction) { display->tell(what, fraction); };
}

}  // namespace pencilscan::cli
