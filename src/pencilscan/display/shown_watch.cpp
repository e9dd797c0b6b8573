#include "pencilscan/display/shown_watch.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "pencilscan/core/error.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/display/x_screen.h"

// Last: their macros are names elsewhere.
#include <X11/Xlib.h>
#include <X11/extensions/Xdamage.h>

namespace pencilscan {
namespace {

/// A part of the desktop that changed, and when.
struct Change {
  XRectangle area{};
  std::int64_t time_ns = 0;
};

bool meet(const XRectangle& area, const DisplayOutput& output) {
  return area.x < output.x + output.width && output.x < area.x + area.width &&
         area.y < output.y + output.height && output.y < area.y + area.height;
}

/// Xorg counts milliseconds of the clock that never steps, modulo 2^32.
std::int64_t host_from_server(Time time) {
  const std::int64_t now = host_now_ns();
  const auto ago_ms =
      static_cast<std::uint32_t>(now / 1'000'000) - static_cast<std::uint32_t>(time);
  constexpr std::uint32_t kLongAgo = 10'000;  // another clock: take the time of the news
  return ago_ms < kLongAgo ? now - 1'000'000LL * ago_ms : now;
}

}  // namespace

struct ShownWatch::State {
  std::vector<std::string> names;
  Sink sink;
  std::unique_ptr<XScreen> screen;
  Display* display = nullptr;
  int damage_event = 0;
  int wake = -1;  ///< an eventfd: somebody waits, or it is over
  std::mutex mutex;
  std::condition_variable settled;
  std::uint64_t asked = 0;     ///< calls of settle()
  std::uint64_t answered = 0;  ///< those that all news before was told to
  bool ending = false;
  std::thread thread;

  ~State() {
    if (display != nullptr) XCloseDisplay(display);
    if (wake >= 0) ::close(wake);
  }
  void open(const std::string& name);
  void wake_up() const {
    const std::uint64_t one = 1;
    static_cast<void>(!::write(wake, &one, sizeof one));
  }
  [[nodiscard]] std::vector<Change> changes();
  /// Reads back those outputs that changed.
  void look(const std::vector<Change>& changed);
  void run();
};

void ShownWatch::State::open(const std::string& name) {
  wake = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  screen = std::make_unique<XScreen>(name);
  display = XOpenDisplay(name.empty() ? nullptr : name.c_str());
  int error = 0;
  if (wake < 0 || display == nullptr || XDamageQueryExtension(display, &damage_event, &error) == 0)
    throw StageError("this X server cannot tell what changes on it: it lacks Damage");
  XDamageCreate(display, DefaultRootWindow(display), XDamageReportRawRectangles);
  XSync(display, False);
}

std::vector<Change> ShownWatch::State::changes() {
  std::vector<Change> changed;
  XSync(display, False);  // the server has told everything until now
  while (XPending(display) > 0) {
    XEvent event;
    XNextEvent(display, &event);
    if (event.type != damage_event + XDamageNotify) continue;
    const auto& damage = reinterpret_cast<const XDamageNotifyEvent&>(event);
    changed.push_back({damage.area, host_from_server(damage.timestamp)});
  }
  return changed;
}

void ShownWatch::State::look(const std::vector<Change>& changed) {
  const auto outputs = screen->outputs();
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto output = std::find_if(outputs.begin(), outputs.end(), [&](const DisplayOutput& o) {
      return o.name == names[i] && o.lit;
    });
    if (output == outputs.end()) {
      sink(i, host_now_ns(), {});
      continue;
    }
    const auto last = std::find_if(changed.rbegin(), changed.rend(), [&](const Change& change) {
      return meet(change.area, *output);
    });
    if (last != changed.rend()) sink(i, last->time_ns, screen->read(*output));
  }
}

void ShownWatch::State::run() {
  std::unique_lock lock(mutex);
  while (!ending) {
    const std::uint64_t asking = asked;
    lock.unlock();
    try {
      const auto changed = changes();
      if (!changed.empty()) look(changed);
    } catch (const StageError&) {  // the layout changes this moment: the next event tells more
    }
    lock.lock();
    answered = asking;
    settled.notify_all();
    if (ending || asked > answered) continue;
    lock.unlock();
    std::array<pollfd, 2> waiting{{{ConnectionNumber(display), POLLIN, 0}, {wake, POLLIN, 0}}};
    ::poll(waiting.data(), waiting.size(), -1);
    std::uint64_t count = 0;
    static_cast<void>(!::read(wake, &count, sizeof count));
    lock.lock();
  }
}

ShownWatch::ShownWatch(const std::string& display, std::vector<std::string> outputs, Sink sink)
    : state_(std::make_unique<State>()) {
  State& state = *state_;
  state.names = std::move(outputs);
  state.sink = std::move(sink);
  state.open(display);
  constexpr XRectangle kAll{-32768, -32768, 65535, 65535};
  state.look({{kAll, host_now_ns()}});
  state.thread = std::thread([&state] { state.run(); });
}

void ShownWatch::settle() {
  std::unique_lock lock(state_->mutex);
  const std::uint64_t call = ++state_->asked;
  state_->wake_up();
  state_->settled.wait(lock, [&] { return state_->answered >= call; });
}

ShownWatch::~ShownWatch() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->ending = true;
  }
  state_->wake_up();
  if (state_->thread.joinable()) state_->thread.join();
}

}  // namespace pencilscan
