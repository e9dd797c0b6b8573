#include "pencilscan/capture/camera_group.h"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <future>
#include <mutex>
#include <thread>

#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/io/codec.h"

namespace pencilscan {
namespace {

/// How long a camera's thread waits for a picture before it looks for other work: the most by which
/// a software trigger comes late.
constexpr Seconds kTurn{0.002};
/// The same where nothing is triggered by us.
constexpr Seconds kLongTurn{0.05};
/// How long one is waited for that did not answer before.
constexpr double kShortAnswer = 1;

}  // namespace

struct CameraGroup::Member {
  std::string name;
  std::unique_ptr<CameraDevice> device;
  CameraSettings settings;

  std::mutex mutex;
  std::condition_variable changed;
  std::deque<std::packaged_task<void()>> calls;
  bool delivering = false;  ///< touched by the camera's thread alone
  bool ending = false;
  bool ended = false;  ///< the thread touches nothing any more
  std::condition_variable end;
  Sink sink;
  std::string trouble;
  std::string dead;
  std::string silent;  ///< set while it does not answer
  std::thread thread;

  void run(std::size_t index);
  /// Pictures from now on, or what keeps it from them, noted and thrown.
  void start();
  /// Runs on the camera's thread, and waits; what it throws is thrown here. False when it does not
  /// answer in time: `body` may run later, and owns what it uses.
  [[nodiscard]] bool call(std::function<void()> body, double longest_s);
  /// Waits until the thread is at its end; false when it does not come to it.
  [[nodiscard]] bool has_ended(double longest_s);
  /// Runs on the camera's thread, some time soon.
  void post(std::function<void()> body);
  void note(std::string& where, const std::string& text) {
    const std::lock_guard lock(mutex);
    where = text;
  }
};

void CameraGroup::Member::start() {
  try {
    device->start();
    delivering = true;
    note(trouble, "");
  } catch (const std::exception& error) {
    note(trouble, error.what());
    throw;
  }
}

void CameraGroup::Member::post(std::function<void()> body) {
  {
    const std::lock_guard lock(mutex);
    calls.emplace_back(std::move(body));
  }
  changed.notify_one();
}

bool CameraGroup::Member::call(std::function<void()> body, double longest_s) {
  std::packaged_task<void()> task(std::move(body));
  auto done = task.get_future();
  {
    const std::lock_guard lock(mutex);
    if (!silent.empty()) longest_s = std::min(longest_s, kShortAnswer);
    calls.push_back(std::move(task));
  }
  changed.notify_one();
  if (done.wait_for(Seconds(longest_s)) != std::future_status::ready) {
    const std::lock_guard lock(mutex);
    if (silent.empty()) silent = "it did not answer for " + formatted(longest_s) + " s";
    return false;
  }
  done.get();
  return true;
}

bool CameraGroup::Member::has_ended(double longest_s) {
  std::unique_lock lock(mutex);
  if (!silent.empty()) longest_s = std::min(longest_s, kShortAnswer);
  return end.wait_for(lock, Seconds(longest_s), [&] { return ended; });
}

void CameraGroup::Member::run(std::size_t index) {
  std::unique_lock lock(mutex);
  while (!ending) {
    if (!calls.empty()) {
      auto next = std::move(calls.front());
      calls.pop_front();
      lock.unlock();
      next();
      lock.lock();
      silent.clear();
      continue;
    }
    if (!delivering) {
      changed.wait(lock, [&] { return ending || !calls.empty(); });
      continue;
    }
    const Seconds turn = settings.trigger == Trigger::kSoftware ? kTurn : kLongTurn;
    lock.unlock();
    std::optional<CameraFrame> frame;
    std::string lost;
    try {
      frame = device->next(turn);
      lost = device->trouble();
      lock.lock();
      // Whoever gave up waiting for this camera has taken the sink away.
      const Sink deliver = sink;
      lock.unlock();
      if (frame && deliver) deliver(index, std::move(*frame));
    } catch (const std::exception& error) {
      lost = error.what();
    }
    lock.lock();
    dead = lost;
    // A camera that is gone answers at once: no reason to ask all the time.
    if (!lost.empty()) changed.wait_for(lock, kLongTurn, [&] { return ending || !calls.empty(); });
  }
  ended = true;
  end.notify_all();
}

CameraGroup::CameraGroup(std::vector<NamedCamera> cameras, double longest_answer_s)
    : longest_answer_s_(longest_answer_s) {
  for (NamedCamera& camera : cameras) {
    auto member = std::make_shared<Member>();
    member->name = std::move(camera.name);
    member->device = std::move(camera.device);
    members_.push_back(std::move(member));
  }
  for (std::size_t c = 0; c < members_.size(); ++c)
    members_[c]->thread = std::thread([member = members_[c], c] { member->run(c); });
}

CameraGroup::~CameraGroup() {
  for (auto& member : members_) {
    const std::lock_guard lock(member->mutex);
    member->ending = true;
    member->sink = nullptr;
    member->changed.notify_one();
  }
  // Settings are put back by all cameras at once: some take their time.
  std::vector<std::thread> closing;
  for (auto& member : members_) {
    if (member->has_ended(longest_answer_s_)) {
      member->thread.join();
      closing.emplace_back([&member] { member->device.reset(); });
    } else {
      member->thread.detach();
    }
  }
  for (std::thread& thread : closing) thread.join();
}

std::size_t CameraGroup::size() const { return members_.size(); }
const std::string& CameraGroup::name(std::size_t camera) const { return members_[camera]->name; }
const CameraInfo& CameraGroup::info(std::size_t camera) const {
  return members_[camera]->device->info();
}
CameraSettings CameraGroup::settings(std::size_t camera) const {
  const std::lock_guard lock(members_[camera]->mutex);
  return members_[camera]->settings;
}
bool CameraGroup::running() const { return running_; }

void CameraGroup::configure(std::size_t camera, const CameraSettings& settings) {
  Member& member = *members_[camera];
  const auto body = [&member, settings, runs = running_] {
    if (member.delivering) member.device->stop();
    member.delivering = false;
    std::exception_ptr refusal;
    try {
      const CameraSettings made = member.device->configure(settings);
      const std::lock_guard lock(member.mutex);
      member.settings = made;
    } catch (...) {
      refusal = std::current_exception();
    }
    try {
      if (runs) member.start();
    } catch (...) {
      if (!refusal) refusal = std::current_exception();
    }
    if (refusal) std::rethrow_exception(refusal);
  };
  if (!member.call(body, longest_answer_s_))
    throw StageError(member.name + ": the camera does not answer to its settings");
}

void CameraGroup::start(Sink sink) {
  PENCILSCAN_CHECK(!running_);
  load_codecs();  // now: nobody can wait for them once pictures come
  running_ = true;
  for (auto& member : members_) {
    {
      const std::lock_guard lock(member->mutex);
      member->sink = sink;
    }
    member->post([&m = *member] {
      try {
        m.start();
      } catch (const std::exception&) {  // faults() tells
      }
    });
  }
  for (auto& member : members_) static_cast<void>(member->call([] {}, longest_answer_s_));
}

void CameraGroup::stop() {
  if (!running_) return;
  running_ = false;
  for (auto& member : members_) {
    member->post([&m = *member] {
      m.delivering = false;
      try {
        m.device->stop();
      } catch (const std::exception& error) {
        m.note(m.trouble, error.what());
      }
    });
  }
  for (auto& member : members_) static_cast<void>(member->call([] {}, longest_answer_s_));
  for (auto& member : members_) {
    const std::lock_guard lock(member->mutex);
    member->sink = nullptr;
  }
}

void CameraGroup::trigger() {
  for (auto& member : members_) {
    {
      // Triggers that wait for one that is gone would all come at once when it is back.
      const std::lock_guard lock(member->mutex);
      if (!member->dead.empty()) continue;
    }
    member->post([&m = *member] {
      try {
        if (!m.delivering) return;
        m.device->trigger();
        m.note(m.trouble, "");
      } catch (const std::exception& error) {
        m.note(m.trouble, error.what());
      }
    });
  }
}

std::vector<Fault> CameraGroup::faults() const {
  std::vector<Fault> faults;
  for (const auto& member : members_) {
    const std::lock_guard lock(member->mutex);
    const std::string& dead = member->silent.empty() ? member->dead : member->silent;
    if (!dead.empty())
      faults.push_back({"dead", member->name, dead,
                        "check its power and its cable; other programs that hold it"});
    else if (!member->trouble.empty())
      faults.push_back({"trouble", member->name, member->trouble, ""});
  }
  return faults;
}

}  // namespace pencilscan
