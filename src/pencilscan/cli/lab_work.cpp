#include "pencilscan/cli/lab_work.h"

#include <exception>
#include <nlohmann/json.hpp>

namespace pencilscan::cli {
namespace {

constexpr std::size_t kSaidLines = 40;  ///< kept for the page

}  // namespace

std::string LabWork::begin(const std::string& what, std::function<void()> work) {
  const std::lock_guard lock(mutex_);
  if (running_) return "something is being done: stop it first";
  if (thread_.joinable()) thread_.join();  // it needs the mutex no more
  what_ = what;
  share_ = 0;
  stopping_ = false;
  thread_ = std::thread([this, work = std::move(work)] {
    try {
      work();
    } catch (const std::exception& error) {
      say(error.what(), true);
    }
    const std::lock_guard lock(mutex_);
    running_ = false;
  });
  running_ = true;
  return "";
}

bool LabWork::progress(const std::string& what, double share) {
  const std::lock_guard lock(mutex_);
  what_ = what;
  share_ = share;
  return !stopping_;
}

void LabWork::say(const std::string& text, bool fault) {
  const std::lock_guard lock(mutex_);
  said_.emplace_front(text, fault);
  if (said_.size() > kSaidLines) said_.pop_back();
}

void LabWork::say(const std::vector<Fault>& faults) {
  for (const Fault& fault : faults)
    say(to_string(fault) + (fault.advice.empty() ? "" : "\n  what to do: " + fault.advice), true);
}

void LabWork::end() {
  stop();
  if (thread_.joinable()) thread_.join();
}

bool LabWork::running() const {
  const std::lock_guard lock(mutex_);
  return running_;
}

nlohmann::ordered_json LabWork::json() const {
  const std::lock_guard lock(mutex_);
  return {{"running", running_}, {"what", what_}, {"share", share_}};
}

nlohmann::ordered_json LabWork::said() const {
  const std::lock_guard lock(mutex_);
  auto lines = nlohmann::ordered_json::array();
  for (const auto& [text, fault] : said_) lines.push_back({{"text", text}, {"fault", fault}});
  return lines;
}

}  // namespace pencilscan::cli
