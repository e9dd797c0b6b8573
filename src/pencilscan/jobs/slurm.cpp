#include "pencilscan/jobs/slurm.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

/// Options of sbatch end at the line's end and may be quoted, but a line break ends any.
std::string sbatch_line(const std::string& option) {
  if (option.find('\n') != std::string::npos)
    throw InputError("--sbatch", "", option, "must be one line");
  return "#SBATCH " + option + "\n";
}

/// A folder in a file name of sbatch, in which % begins a pattern.
std::string without_patterns(const std::string& folder) {
  std::string text;
  for (const char c : folder) text += c == '%' ? "%%" : std::string(1, c);
  return text;
}

std::string script_head(const Job& job, const std::string& name, const std::string& log) {
  for (const fs::path& path : {job.directory, job.out}) {
    if (path.string().find('"') != std::string::npos)
      throw InputError("--out", "", path.string(), "must have no \" with --slurm");
  }
  std::string text = "#!/bin/sh\n";
  text += sbatch_line("--job-name=" + name);
  text += sbatch_line("--chdir=\"" + job.directory.string() + "\"");
  text += sbatch_line("--output=\"" + without_patterns(job_folder(job.out).string()) + "/" + log +
                      "\"");
  text += sbatch_line("--open-mode=append");
  for (const std::string& option : job.scheduler) text += sbatch_line(option);
  return text;
}

/// What a command says; StageError when it fails.
std::string answer_of(const std::string& command) {
  std::string text;
  std::array<char, 512> part{};
  FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) throw StageError("no further process");
  while (std::fgets(part.data(), part.size(), pipe) != nullptr) text += part.data();
  const int status = ::pclose(pipe);
  while (!text.empty() && text.back() == '\n') text.pop_back();
  if (status != 0)
    throw StageError(command.substr(0, command.find(' ')) + " did not take the job: " + text);
  return text;
}

/// `sbatch --parsable` says "id" or "id;cluster".
std::string submit_script(const fs::path& script, const std::string& options) {
  const std::string answer =
      answer_of("sbatch --parsable " + options + " " + shell_word(script.string()));
  // Warnings stand in lines of their own before it.
  const std::string last = answer.substr(answer.rfind('\n') + 1);
  const std::string id = last.substr(0, last.find(';'));
  if (id.empty() || id.find_first_not_of("0123456789") != std::string::npos)
    throw StageError("sbatch did not say which job it made: " + answer);
  return id;
}

}  // namespace

std::string index_list(std::span<const std::size_t> indices) {
  std::string text;
  for (std::size_t i = 0; i < indices.size();) {
    std::size_t end = i + 1;
    while (end < indices.size() && indices[end] == indices[end - 1] + 1) ++end;
    text += (text.empty() ? "" : ",") + std::to_string(indices[i]);
    if (end > i + 1) text += "-" + std::to_string(indices[end - 1]);
    i = end;
  }
  return text;
}

SlurmScripts slurm_scripts(const Job& job, std::span<const std::size_t> tasks, int rounds) {
  SlurmScripts scripts;
  scripts.array = script_head(job, "pencilscan", "task-%a.log");
  scripts.array += sbatch_line("--requeue");
  scripts.array += sbatch_line("--array=" + index_list(tasks) +
                               (job.limit > 0 ? "%" + std::to_string(job.limit) : ""));
  // The number of shards is written out: an array of what is missing has fewer tasks.
  scripts.array +=
      task_command(job, "\"$SLURM_ARRAY_TASK_ID/" + std::to_string(job.tasks) + "\"", true);
  const auto& given = job.arguments;
  if (std::find(given.begin(), given.end(), "--threads") == given.end())
    scripts.array += " --threads \"${SLURM_CPUS_PER_TASK:-0}\"";
  scripts.array += "\n";
  scripts.finish = script_head(job, "pencilscan-finish", "finish.log");
  scripts.finish += "exec " + shell_word(job.program.string()) + " sequence finish --out " +
                    shell_word(job.out.string());
  if (rounds > 0) scripts.finish += " --resubmit --rounds " + std::to_string(rounds - 1);
  scripts.finish += "\n";
  return scripts;
}

SlurmJobs submit_to_slurm(const Job& job, std::span<const std::size_t> tasks, int rounds) {
  const SlurmScripts scripts = slurm_scripts(job, tasks, rounds);
  const fs::path folder = job_folder(job.out);
  write_text(folder / "array.sh", scripts.array);
  write_text(folder / "finish.sh", scripts.finish);
  SlurmJobs jobs;
  jobs.array = submit_script(folder / "array.sh", "");
  jobs.finish = submit_script(folder / "finish.sh", "--dependency=afterany:" + jobs.array);
  return jobs;
}

}  // namespace pencilscan
