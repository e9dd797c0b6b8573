#include "pencilscan/display/projector_windows.h"

#include <SDL2/SDL.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <functional>
#include <future>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/display/shown_check.h"

namespace pencilscan {
namespace {

const std::string kTitle = "pencilscan projector ";
constexpr auto kEventPause = std::chrono::milliseconds(20);  ///< between looks at the events

/// One window on one output.
struct Panel {
  std::string projector;
  DisplayOutput output;
  SDL_Window* window = nullptr;
  cv::Mat drawn;
};

void set_hints() {
  SDL_SetHint(SDL_HINT_VIDEODRIVER, "x11");
  SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");
  SDL_SetHint(SDL_HINT_FRAMEBUFFER_ACCELERATION, "0");  // pixels as they are, through no GPU
  SDL_SetHint(SDL_HINT_VIDEO_ALLOW_SCREENSAVER, "0");
  SDL_SetHint(SDL_HINT_VIDEO_MINIMIZE_ON_FOCUS_LOSS, "0");
}

void copy_to_window(SDL_Window* window, const cv::Mat& rgb) {
  SDL_Surface* surface = SDL_GetWindowSurface(window);
  if (surface == nullptr || surface->w != rgb.cols || surface->h != rgb.rows ||
      surface->format->BytesPerPixel != 4)
    throw StageError(std::string("a window cannot be drawn on: ") + SDL_GetError());
  const SDL_PixelFormat& format = *surface->format;
  for (int y = 0; y < rgb.rows; ++y) {
    const auto* from = rgb.ptr<std::uint8_t>(y);
    auto* to = reinterpret_cast<std::uint32_t*>(static_cast<std::uint8_t*>(surface->pixels) +
                                                static_cast<std::ptrdiff_t>(y) * surface->pitch);
    for (int x = 0; x < rgb.cols; ++x, from += 3)
      to[x] = (static_cast<std::uint32_t>(from[0]) << format.Rshift) |
              (static_cast<std::uint32_t>(from[1]) << format.Gshift) |
              (static_cast<std::uint32_t>(from[2]) << format.Bshift) | format.Amask;
  }
}

}  // namespace

/// Everything of SDL happens on `thread`, which takes one call after the other.
struct ProjectorWindows::State {
  std::vector<Panel> panels;
  std::unique_ptr<XScreen> screen;
  std::unique_ptr<PlainOutputs> plain;
  std::mutex screen_mutex;

  std::mutex mutex;
  std::condition_variable work;
  std::deque<std::packaged_task<void()>> calls;
  bool ending = false;
  std::atomic<bool> dismissed = false;
  std::thread thread;

  void open();
  void close();
  void handle_events();
  void run(std::promise<void> ready);
  /// Runs on the thread of the windows and waits; what it throws is thrown here.
  void call(std::function<void()> body);
};

void ProjectorWindows::State::open() {
  set_hints();
  if (SDL_Init(SDL_INIT_VIDEO) != 0)
    throw StageError(std::string("no screen to show pictures on: ") + SDL_GetError());
  SDL_ShowCursor(SDL_DISABLE);
  for (Panel& panel : panels) {
    const DisplayOutput& output = panel.output;
    panel.window = SDL_CreateWindow(
        (kTitle + panel.projector).c_str(), output.x, output.y, output.width, output.height,
        SDL_WINDOW_BORDERLESS | SDL_WINDOW_ALWAYS_ON_TOP | SDL_WINDOW_SKIP_TASKBAR);
    if (panel.window == nullptr)
      throw StageError("no window on output " + output.name + ": " + SDL_GetError());
    panel.drawn = cv::Mat(output.height, output.width, CV_8UC3, cv::Scalar::all(0));
    copy_to_window(panel.window, panel.drawn);
    SDL_UpdateWindowSurface(panel.window);
  }
}

void ProjectorWindows::State::close() {
  for (Panel& panel : panels)
    if (panel.window != nullptr) SDL_DestroyWindow(panel.window);
  SDL_Quit();
}

void ProjectorWindows::State::handle_events() {
  SDL_Event event;
  while (SDL_PollEvent(&event) != 0) {
    if (event.type == SDL_QUIT) dismissed = true;
    if (event.type == SDL_KEYDOWN &&
        (event.key.keysym.sym == SDLK_ESCAPE || event.key.keysym.sym == SDLK_q))
      dismissed = true;
    if (event.type != SDL_WINDOWEVENT || event.window.event != SDL_WINDOWEVENT_EXPOSED) continue;
    for (const Panel& panel : panels)
      if (SDL_GetWindowID(panel.window) == event.window.windowID)
        SDL_UpdateWindowSurface(panel.window);
  }
}

void ProjectorWindows::State::run(std::promise<void> ready) {
  try {
    open();
    ready.set_value();
  } catch (...) {
    close();
    ready.set_exception(std::current_exception());
    return;
  }
  std::unique_lock lock(mutex);
  while (!ending) {
    work.wait_for(lock, kEventPause, [&] { return ending || !calls.empty(); });
    while (!calls.empty()) {
      auto next = std::move(calls.front());
      calls.pop_front();
      lock.unlock();
      next();
      lock.lock();
    }
    lock.unlock();
    handle_events();
    lock.lock();
  }
  lock.unlock();
  close();
}

void ProjectorWindows::State::call(std::function<void()> body) {
  std::packaged_task<void()> task(std::move(body));
  std::future<void> done = task.get_future();
  {
    const std::lock_guard lock(mutex);
    PENCILSCAN_CHECK(!ending);
    calls.push_back(std::move(task));
  }
  work.notify_one();
  done.get();
}

ProjectorWindows::ProjectorWindows(const std::vector<OutputUse>& uses, const std::string& display)
    : state_(std::make_unique<State>()) {
  State& state = *state_;
  state.screen = std::make_unique<XScreen>(display);
  const auto outputs = state.screen->outputs();
  const auto faults = output_faults(uses, outputs);
  if (!faults.empty())
    throw InputError(
        "projector " + faults.front().device, "", "",
        faults.front().what + " (" + faults.front().advice + ")" +
            (faults.size() > 1 ? "; and " + std::to_string(faults.size() - 1) + " more" : ""));
  std::vector<DisplayOutput> used;
  for (const OutputUse& use : uses) {
    used.push_back(*use.output);
    state.panels.push_back({use.projector->name, *use.output, nullptr, {}});
  }
  if (!display.empty()) ::setenv("DISPLAY", display.c_str(), 1);  // SDL knows no other way
  state.plain = std::make_unique<PlainOutputs>(*state.screen, used);
  std::promise<void> promise;
  std::future<void> ready = promise.get_future();
  state.thread =
      std::thread([&state, p = std::move(promise)]() mutable { state.run(std::move(p)); });
  try {
    ready.get();
  } catch (...) {
    state.thread.join();
    throw;
  }
}

ProjectorWindows::~ProjectorWindows() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->ending = true;
  }
  state_->work.notify_one();
  if (state_->thread.joinable()) state_->thread.join();
}

std::size_t ProjectorWindows::size() const { return state_->panels.size(); }

std::int64_t ProjectorWindows::show(std::size_t window, const cv::Mat& picture) {
  Panel& panel = state_->panels.at(window);
  PENCILSCAN_CHECK(picture.type() == CV_8UC3 && picture.cols == panel.output.width &&
                   picture.rows == panel.output.height);
  std::int64_t when = 0;
  state_->call([&] {
    copy_to_window(panel.window, picture);
    if (SDL_UpdateWindowSurface(panel.window) != 0)  // returns when the server has done it
      throw StageError(std::string("a window cannot be drawn on: ") + SDL_GetError());
    panel.drawn = picture.clone();
    when = host_now_ns();
  });
  return when;
}

cv::Mat ProjectorWindows::read_back(std::size_t window) {
  const std::lock_guard lock(state_->screen_mutex);
  return state_->screen->read(state_->panels.at(window).output);
}

std::vector<Fault> ProjectorWindows::check() {
  const std::lock_guard lock(state_->screen_mutex);
  const auto outputs = state_->screen->outputs();
  std::vector<Fault> faults;
  for (Panel& panel : state_->panels) {
    const auto now = std::find_if(outputs.begin(), outputs.end(), [&](const DisplayOutput& o) {
      return o.name == panel.output.name;
    });
    if (now == outputs.end() || !(*now == panel.output)) {
      faults.push_back(
          {"layout", panel.projector,
           "output " + panel.output.name + " was moved, switched off or set to another mode",
           "set it back, or start again"});
      continue;
    }
    if (state_->screen->alters_colors(panel.output))
      faults.push_back({"colors", panel.projector,
                        "output " + panel.output.name + " has its colours changed on their way",
                        "switch off night light and colour profiles of this output"});
    cv::Mat drawn;
    state_->call([&] { drawn = panel.drawn; });
    const auto difference = compare_shown(state_->screen->read(panel.output), drawn);
    if (!difference) continue;
    Fault fault{difference->kind, panel.projector,
                "output " + panel.output.name + ": " + difference->sentence, ""};
    const auto over = state_->screen->windows_over(panel.output, kTitle);
    if (!over.empty()) {
      fault.kind = "covered";
      fault.what += "; on top lies \"" + over.front() + "\"";
      fault.advice = "close it or move it to another screen";
    }
    faults.push_back(std::move(fault));
  }
  return faults;
}

bool ProjectorWindows::dismissed() const { return state_->dismissed; }

}  // namespace pencilscan
