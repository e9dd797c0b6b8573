#include "pencilscan/core/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <thread>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

using Clock = std::chrono::steady_clock;

constexpr ChildProcess::Seconds kPolite{3};  ///< between asking to end and ending

struct Pipe {
  std::array<int, 2> ends{-1, -1};
  Pipe() {
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw StageError("no pipe can be made");
  }
  ~Pipe() {
    for (const int end : ends)
      if (end >= 0) ::close(end);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  int take(std::size_t k) {
    const int end = ends[k];
    ends[k] = -1;
    return end;
  }
};

std::vector<char*> pointers_to(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

std::vector<std::string> environment_with(const std::map<std::string, std::string>& added) {
  std::vector<std::string> result;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string text(*entry);
    if (!added.contains(text.substr(0, text.find('=')))) result.push_back(text);
  }
  for (const auto& [name, value] : added) result.push_back(name + "=" + value);
  return result;
}

int exit_code(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace

ChildProcess::ChildProcess(const std::vector<std::string>& arguments, const Options& options) {
  // All memory is taken before the fork: afterwards only calls that are safe in a signal handler.
  std::vector<std::string> words = arguments;
  std::vector<std::string> environment = environment_with(options.environment);
  const auto argv = pointers_to(words);
  const auto envp = pointers_to(environment);
  Pipe from_child;
  Pipe failure;  // closed by a successful exec
  const pid_t parent = ::getpid();
  sigset_t none;
  sigemptyset(&none);
  id_ = ::fork();
  if (id_ < 0) throw StageError("no process can be made for " + arguments.front());
  if (id_ == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    ::setsid();  // a terminal's Ctrl-C is for its parent, which ends it in order
    if (::getppid() != parent) ::_exit(127);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    ::signal(SIGPIPE, SIG_DFL);
    const int nothing = ::open("/dev/null", O_RDWR | O_CLOEXEC);
    ::dup2(nothing, STDIN_FILENO);
    // Results of this program go to its standard output alone.
    ::dup2(options.piped ? from_child.ends[1] : STDERR_FILENO, STDOUT_FILENO);
    if (!options.error_file.empty()) {
      const int file =
          ::open(options.error_file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
      if (file >= 0) ::dup2(file, STDERR_FILENO);
      if (file >= 0 && !options.piped) ::dup2(file, STDOUT_FILENO);
    }
    ::execvpe(argv[0], argv.data(), envp.data());
    const int error = errno;
    static_cast<void>(!::write(failure.ends[1], &error, sizeof error));
    ::_exit(127);
  }
  ::close(failure.take(1));
  int error = 0;
  ssize_t got = 0;
  do {
    got = ::read(failure.ends[0], &error, sizeof error);
  } while (got < 0 && errno == EINTR);
  if (got == sizeof error) {
    ::waitpid(id_, nullptr, 0);
    throw StageError(arguments.front() + " cannot be run: " + std::strerror(error));
  }
  if (options.piped) output_ = from_child.take(0);
}

ChildProcess::~ChildProcess() {
  stop();
  if (output_ >= 0) ::close(output_);
}

std::optional<std::string> ChildProcess::read_line(Seconds patience) {
  const auto until = Clock::now() + std::chrono::duration_cast<Clock::duration>(patience);
  for (;;) {
    if (const auto end = unread_.find('\n'); end != std::string::npos) {
      std::string line = unread_.substr(0, end);
      unread_.erase(0, end + 1);
      return line;
    }
    if (output_ < 0) return std::nullopt;
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(until - Clock::now()).count();
    pollfd waiting{output_, POLLIN, 0};
    const int ready = ::poll(&waiting, 1, static_cast<int>(std::max<decltype(left)>(0, left)));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return std::nullopt;
    std::array<char, 4096> bytes{};
    const ssize_t got = ::read(output_, bytes.data(), bytes.size());
    if (got <= 0) return std::nullopt;
    unread_.append(bytes.data(), static_cast<std::size_t>(got));
  }
}

std::optional<int> ChildProcess::wait(Seconds patience) {
  const auto until = Clock::now() + std::chrono::duration_cast<Clock::duration>(patience);
  while (!code_) {
    int status = 0;
    const pid_t ended = ::waitpid(id_, &status, WNOHANG);
    if (ended == id_) code_ = exit_code(status);
    if (ended < 0 && errno != EINTR) code_ = 127;
    if (code_ || Clock::now() >= until) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return code_;
}

void ChildProcess::stop() {
  if (code_ || id_ < 0) return;
  ::kill(-id_, SIGTERM);  // with what it started itself
  if (wait(kPolite)) return;
  ::kill(-id_, SIGKILL);
  wait(kPolite);
}

}  // namespace pencilscan
