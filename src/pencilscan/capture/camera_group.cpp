#include "pencilscan/capture/camera_group.h"

#include <condition_variable>
#include <deque>
#include <future>
#include <mutex>
#include <thread>

#include "pencilscan/core/check.h"

namespace pencilscan {
namespace {

/// How long a camera's thread waits for a picture before it looks for other work: the most by which
/// a software trigger comes late.
constexpr Seconds kTurn{0.002};
/// The same where nothing is triggered by us.
constexpr Seconds kLongTurn{0.05};

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
  std::string trouble;
  std::string dead;
  std::thread thread;

  void run(const Sink& sink, std::size_t index);
  /// Runs on the camera's thread, and waits; what it throws is thrown here.
  void call(std::function<void()> body);
  /// Runs on the camera's thread, some time soon.
  void post(std::function<void()> body);
  void note(std::string& where, const std::string& text) {
    const std::lock_guard lock(mutex);
    where = text;
  }
};

void CameraGroup::Member::post(std::function<void()> body) {
  {
    const std::lock_guard lock(mutex);
    calls.emplace_back(std::move(body));
  }
  changed.notify_one();
}

void CameraGroup::Member::call(std::function<void()> body) {
  std::packaged_task<void()> task(std::move(body));
  auto done = task.get_future();
  {
    const std::lock_guard lock(mutex);
    calls.push_back(std::move(task));
  }
  changed.notify_one();
  done.get();
}

void CameraGroup::Member::run(const Sink& sink, std::size_t index) {
  std::unique_lock lock(mutex);
  while (!ending) {
    if (!calls.empty()) {
      auto next = std::move(calls.front());
      calls.pop_front();
      lock.unlock();
      next();
      lock.lock();
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
      if (frame && sink) sink(index, std::move(*frame));
    } catch (const std::exception& error) {
      lost = error.what();
    }
    lock.lock();
    dead = lost;
    // A camera that is gone answers at once: no reason to ask all the time.
    if (!lost.empty()) changed.wait_for(lock, kLongTurn, [&] { return ending || !calls.empty(); });
  }
}

CameraGroup::CameraGroup(std::vector<NamedCamera> cameras) {
  for (NamedCamera& camera : cameras) {
    auto member = std::make_unique<Member>();
    member->name = std::move(camera.name);
    member->device = std::move(camera.device);
    members_.push_back(std::move(member));
  }
  for (std::size_t c = 0; c < members_.size(); ++c)
    members_[c]->thread = std::thread([this, c] { members_[c]->run(sink_, c); });
}

CameraGroup::~CameraGroup() {
  for (auto& member : members_) {
    const std::lock_guard lock(member->mutex);
    member->ending = true;
    member->changed.notify_one();
  }
  for (auto& member : members_) member->thread.join();
  // Settings are put back by all cameras at once: some take their time.
  std::vector<std::thread> closing;
  for (auto& member : members_) closing.emplace_back([&member] { member->device.reset(); });
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
  member.call([&] {
    if (member.delivering) member.device->stop();
    const CameraSettings made = member.device->configure(settings);
    {
      const std::lock_guard lock(member.mutex);
      member.settings = made;
    }
    if (member.delivering) member.device->start();
  });
}

void CameraGroup::start(Sink sink) {
  PENCILSCAN_CHECK(!running_);
  running_ = true;
  sink_ = std::move(sink);
  for (auto& member : members_) {
    member->post([&m = *member] {
      try {
        m.device->start();
        m.delivering = true;
        m.note(m.trouble, "");
      } catch (const std::exception& error) {
        m.note(m.trouble, error.what());
      }
    });
  }
  for (auto& member : members_) member->call([] {});
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
  for (auto& member : members_) member->call([] {});
  sink_ = nullptr;
}

void CameraGroup::trigger() {
  for (auto& member : members_) {
    member->post([&m = *member] {
      try {
        if (m.delivering) m.device->trigger();
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
    if (!member->dead.empty())
      faults.push_back({"dead", member->name, member->dead,
                        "check its power and its cable; other programs that hold it"});
    else if (!member->trouble.empty())
      faults.push_back({"trouble", member->name, member->trouble, ""});
  }
  return faults;
}

}  // namespace pencilscan
