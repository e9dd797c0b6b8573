#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/jobs/job_folder.h"

namespace pencilscan {

/// How the tasks of a job ended.
struct TaskReport {
  std::size_t done = 0;           ///< with all their frames, or with some that failed
  std::size_t restarts = 0;       ///< of tasks that were killed or whose host was lost
  std::vector<std::size_t> lost;  ///< started again as often as allowed, and killed each time
  std::vector<std::string> hosts_left_out;  ///< could not be reached, or do no task
};

struct QueueOptions {
  /// Runs something on a host; the words before the host's name and the command for its shell.
  std::vector<std::string> ssh = {"ssh",
                                  "-o",
                                  "BatchMode=yes",
                                  "-o",
                                  "ConnectTimeout=10",
                                  "-o",
                                  "ServerAliveInterval=15",
                                  "-o",
                                  "ServerAliveCountMax=4"};
  std::function<bool()> shall_stop;  ///< asked every now and then
  std::function<void(const std::string&)> say;
};

/// Runs the given tasks of a job, on this machine `limit` at once, or over ssh one per host (name a
/// host twice for two): whoever is free takes the next. A task that ends by a signal, or whose host
/// is lost, goes back to the queue at most `retries` times; it goes on where it ended. A host that
/// cannot be reached, or ends a task before its frames, twice in a row gets no more, nor one that
/// refuses the input. InputError when a task says that its input is bad, of hosts when none is
/// left. StageError when no host is left, or when told to stop; what still runs is ended first.
[[nodiscard]] TaskReport run_tasks(const Job& job, std::span<const std::size_t> tasks,
                                   const QueueOptions& options);

}  // namespace pencilscan
