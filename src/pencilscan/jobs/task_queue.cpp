#include "pencilscan/jobs/task_queue.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <deque>
#include <map>
#include <optional>
#include <utility>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

constexpr int kBadInput = 2;   // exit codes of pencilscan
constexpr int kSignals = 128;  // of a shell: what a signal ended, and its number
constexpr int kLastSignal = 64;
constexpr int kHostLost = 255;   // of ssh itself
constexpr int kNoProgram = 126;  // of a shell, and 127: not there, or not to be run
constexpr int kTrialsPerHost = 2;

/// A place where one task runs at a time.
struct Slot {
  std::string host;  ///< empty: this machine
  int lost_in_a_row = 0;
  bool left_out = false;
  pid_t process = -1;
  std::size_t task = 0;
  std::uintmax_t log_before = 0;  ///< bytes that its task's log had when this try began
};

/// Starts words[0] with its output appended to a log. It ends when this program does.
pid_t start(const std::vector<std::string>& words, const fs::path& log) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const int file = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (file < 0) throw StageError(log.string() + ": cannot be written: " + std::strerror(errno));
  const int nothing = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child < 0) {
    const int error = errno;
    ::close(file);
    ::close(nothing);
    throw StageError(std::string("no further process: ") + std::strerror(error));
  }
  if (child == 0) {
    // Only what is safe between fork and exec.
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) ::_exit(kHostLost);
    sigset_t none;
    ::sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    ::dup2(nothing, STDIN_FILENO);
    ::dup2(file, STDOUT_FILENO);
    ::dup2(file, STDERR_FILENO);
    ::execvp(arguments[0], arguments.data());
    ::_exit(127);
  }
  ::close(file);
  ::close(nothing);
  return child;
}

class TaskQueue {
 public:
  TaskQueue(const Job& job, std::span<const std::size_t> tasks, const QueueOptions& options)
      : job_(job), options_(options), waiting_(tasks.begin(), tasks.end()) {
    if (job.kind == JobKind::kSsh) {
      for (const std::string& host : job.hosts) slots_.push_back({host});
    } else {
      slots_.resize(std::max<std::size_t>(1, std::min(job.limit, tasks.size())));
    }
  }
  ~TaskQueue() { end_all(); }
  TaskQueue(const TaskQueue&) = delete;
  TaskQueue& operator=(const TaskQueue&) = delete;

  TaskReport run() {
    while (true) {
      fill_slots();
      if (!is_running()) break;
      wait_for_one();
    }
    if (!waiting_.empty()) {
      if (refused_) throw *refused_;
      throw StageError(std::to_string(waiting_.size()) +
                       " tasks are left and no host can do them (see the logs in " +
                       job_folder(job_.out).string() + ")");
    }
    return std::move(report_);
  }

 private:
  void fill_slots() {
    for (Slot& slot : slots_) {
      if (slot.process >= 0 || slot.left_out || waiting_.empty()) continue;
      slot.task = waiting_.front();
      waiting_.pop_front();
      const std::string command = task_command(
          job_, std::to_string(slot.task) + "/" + std::to_string(job_.tasks), slot.host.empty());
      std::vector<std::string> words = {"sh", "-c", command};
      if (!slot.host.empty()) {
        words = options_.ssh;
        words.insert(words.end(), {slot.host, command});
      }
      const fs::path log = task_log(job_.out, slot.task);
      std::error_code not_there;
      slot.log_before = fs::exists(log, not_there) ? fs::file_size(log) : 0;
      slot.process = start(words, log);
    }
  }
  [[nodiscard]] bool is_running() const {
    return std::any_of(slots_.begin(), slots_.end(), [](const Slot& s) { return s.process >= 0; });
  }
  void wait_for_one() {
    constexpr useconds_t kPause = 20'000;  // us: far less than a task takes
    while (true) {
      for (Slot& slot : slots_) {
        int status = 0;
        if (slot.process < 0 || ::waitpid(slot.process, &status, WNOHANG) != slot.process) continue;
        slot.process = -1;
        ended(slot, status);
        return;
      }
      if (options_.shall_stop && options_.shall_stop()) throw StageError("stopped");
      ::usleep(kPause);
    }
  }
  void ended(Slot& slot, int status) {
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : kSignals + WTERMSIG(status);
    const std::string who =
        "task " + std::to_string(slot.task) + (slot.host.empty() ? "" : " on " + slot.host);
    const bool host_lost =
        !slot.host.empty() && (code == kHostLost || code == kNoProgram || code == kNoProgram + 1);
    if (host_lost) {
      lose_host(slot, who, code);
    } else if (code == kBadInput || code == kNoProgram || code == kNoProgram + 1) {
      const InputError refused(task_log(job_.out, slot.task).string(), "",
                               last_log_line(job_.out, slot.task),
                               "every task needs input that it can read");
      if (slot.host.empty()) throw refused;
      refuse(slot, who, refused);
    } else if (code > kSignals && code <= kSignals + kLastSignal) {
      put_back(slot.task, who + " was ended by signal " + std::to_string(code - kSignals));
    } else if (code != 0 && !went_through(job_.out, slot.task, slot.log_before)) {
      ended_early(slot, who);
    } else {
      slot.lost_in_a_row = 0;
      ++report_.done;
      say(who + (code == 0 ? " is done" : " is done; frames of it failed"));
    }
  }
  /// It did not come as far as its frames: the output cannot be written, memory is too little. Such
  /// a host would be free at once, and take all that waits.
  void ended_early(Slot& slot, const std::string& who) {
    const std::string what = who + " did not come to its frames";
    const std::string why = ": " + last_log_line(job_.out, slot.task);
    if (slot.host.empty()) return say(what + why);
    count_failure(slot);
    const std::string so = what + (slot.left_out ? ", the host gets no more" : "") + why;
    if (restarts_[slot.task]++ < job_.retries) {
      waiting_.push_back(slot.task);
      ++report_.restarts;
      say(so);
    } else {
      report_.lost.push_back(slot.task);
      say(so + " (as often as it may)");
    }
  }
  void lose_host(Slot& slot, const std::string& who, int code) {
    count_failure(slot);
    give_back(slot,
              who + (code == kHostLost ? ": the host is lost" : ": the program is not there"));
  }
  void count_failure(Slot& slot) {
    if (++slot.lost_in_a_row >= kTrialsPerHost) leave_out(slot);
  }
  /// Here the input was good: over there a folder is not mounted, or the program is another.
  void refuse(Slot& slot, const std::string& who, const InputError& refused) {
    refused_ = refused;
    leave_out(slot);
    give_back(slot, who + ": the host refuses the input");
  }
  void leave_out(Slot& slot) {
    slot.left_out = true;
    report_.hosts_left_out.push_back(slot.host);
  }
  /// That a host is lost is no fault of the task.
  void give_back(const Slot& slot, const std::string& what) {
    waiting_.push_front(slot.task);
    ++report_.restarts;
    say(what + (slot.left_out ? ", it gets no more: " : ": ") + last_log_line(job_.out, slot.task));
  }
  void put_back(std::size_t task, const std::string& why) {
    if (restarts_[task]++ < job_.retries) {
      waiting_.push_front(task);
      ++report_.restarts;
      say(why + ", it goes on");
    } else {
      report_.lost.push_back(task);
      say(why + ", as often as it may");
    }
  }
  void say(const std::string& text) const {
    if (options_.say) options_.say(text);
  }
  void end_all() {
    for (Slot& slot : slots_) {
      if (slot.process < 0) continue;
      ::kill(slot.process, SIGKILL);
      ::waitpid(slot.process, nullptr, 0);
    }
  }

  const Job& job_;
  const QueueOptions& options_;
  std::deque<std::size_t> waiting_;
  std::vector<Slot> slots_;
  std::map<std::size_t, int> restarts_;
  std::optional<InputError> refused_;  ///< by the host that was left out last for it
  TaskReport report_;
};

}  // namespace

TaskReport run_tasks(const Job& job, std::span<const std::size_t> tasks,
                     const QueueOptions& options) {
  fs::create_directories(job_folder(job.out));
  return TaskQueue(job, tasks, options).run();
}

}  // namespace pencilscan
