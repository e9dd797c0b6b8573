#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace pencilscan {

/// How shards of a sequence are started.
enum class JobKind { kLocal, kSsh, kSlurm };

/// What was submitted: `<out>.job/job.json`, beside the output. Its logs lie there too.
struct Job {
  JobKind kind = JobKind::kLocal;
  std::filesystem::path program;       ///< that runs the tasks
  std::filesystem::path directory;     ///< that relative paths of the arguments are of
  std::filesystem::path out;           ///< of all tasks
  std::vector<std::string> arguments;  ///< of `pencilscan reconstruct`, without --shard
  std::size_t tasks = 1;               ///< task i does shard i/tasks
  std::size_t limit = 0;               ///< tasks that run at once; 0: no limit (Slurm)
  int retries = 2;                     ///< times that a killed task is started again
  std::vector<std::string> hosts;      ///< of kSsh
  std::vector<std::string> scheduler;  ///< further options of sbatch
};

/// Beside the output folder, so that it holds nothing but output.
[[nodiscard]] std::filesystem::path job_folder(const std::filesystem::path& out);
[[nodiscard]] bool has_job(const std::filesystem::path& out);
/// InputError when it is missing or broken.
[[nodiscard]] Job read_job(const std::filesystem::path& out);
void write_job(const Job& job);

/// `<job folder>/task-<index>.log`.
[[nodiscard]] std::filesystem::path task_log(const std::filesystem::path& out, std::size_t task);
/// Its last line, to say why a task ended; empty where there is none.
[[nodiscard]] std::string last_log_line(const std::filesystem::path& out, std::size_t task);
/// Whether the try of a task whose part of the log begins at byte `from` went through its frames,
/// failed or not: `reconstruct` has printed its figures. That comes with the log; folders of other
/// machines are seen late.
[[nodiscard]] bool went_through(const std::filesystem::path& out, std::size_t task,
                                std::uintmax_t from);
/// The figure of `reconstruct` that it is known by.
inline constexpr const char* kFramesFailed = "frames_failed";

/// What a shell runs for one task. `shard` is "i/n". Where the shell makes way for the program, a
/// signal that ends the program is seen as one; where it stays, as exit code 128 + the signal: ssh
/// tells no signal from a lost connection.
[[nodiscard]] std::string task_command(const Job& job, const std::string& shard,
                                       bool shell_makes_way);
/// One word for a shell, whatever is in it.
[[nodiscard]] std::string shell_word(const std::string& text);

}  // namespace pencilscan
