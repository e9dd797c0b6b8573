#include "pencilscan/jobs/job_folder.h"

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/partial_folder.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kJobFormat = "pencilscan-job/1";
constexpr const char* kJobFile = "job.json";
constexpr std::array<const char*, 3> kKinds = {"local", "ssh", "slurm"};

}  // namespace

fs::path job_folder(const fs::path& out) { return bare_folder(out) += ".job"; }

bool has_job(const fs::path& out) {
  std::error_code ignored;
  return fs::exists(job_folder(out) / kJobFile, ignored);
}

Job read_job(const fs::path& out) {
  const fs::path file = job_folder(out) / kJobFile;
  const json object = read_json(file);
  Job job;
  try {
    if (object.at("format") != kJobFormat)
      throw InputError(file.string(), "format", object.at("format").dump(),
                       std::string("must be ") + kJobFormat);
    const auto kind = std::find(kKinds.begin(), kKinds.end(), object.at("kind").get<std::string>());
    if (kind == kKinds.end())
      throw InputError(file.string(), "kind", object.at("kind").dump(),
                       "must be local, ssh or slurm");
    job.kind = static_cast<JobKind>(kind - kKinds.begin());
    job.program = object.at("program").get<std::string>();
    job.directory = object.at("directory").get<std::string>();
    job.out = object.at("out").get<std::string>();
    job.arguments = object.at("arguments").get<std::vector<std::string>>();
    job.tasks = object.at("tasks").get<std::size_t>();
    job.limit = object.at("limit").get<std::size_t>();
    job.retries = object.at("retries").get<int>();
    job.hosts = object.at("hosts").get<std::vector<std::string>>();
    job.scheduler = object.at("scheduler").get<std::vector<std::string>>();
  } catch (const json::exception& error) {
    throw InputError(file.string(), "", "", std::string("must be a whole job: ") + error.what());
  }
  return job;
}

void write_job(const Job& job) {
  write_json(job_folder(job.out) / kJobFile, {{"format", kJobFormat},
                                              {"kind", kKinds[static_cast<std::size_t>(job.kind)]},
                                              {"program", job.program.string()},
                                              {"directory", job.directory.string()},
                                              {"out", job.out.string()},
                                              {"arguments", job.arguments},
                                              {"tasks", job.tasks},
                                              {"limit", job.limit},
                                              {"retries", job.retries},
                                              {"hosts", job.hosts},
                                              {"scheduler", job.scheduler}});
}

fs::path task_log(const fs::path& out, std::size_t task) {
  return job_folder(out) / ("task-" + std::to_string(task) + ".log");
}

std::string last_log_line(const fs::path& out, std::size_t task) {
  return last_line(task_log(out, task));
}

bool went_through(const fs::path& out, std::size_t task, std::uintmax_t from) {
  std::ifstream log(task_log(out, task));
  log.seekg(static_cast<std::streamoff>(from));
  for (std::string line; std::getline(log, line);)
    if (line.starts_with(kFramesFailed)) return true;
  return false;
}

std::string shell_word(const std::string& text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

std::string task_command(const Job& job, const std::string& shard, bool shell_makes_way) {
  // 126: as if the program could not be started. A machine without the folder is no place for any
  // task.
  std::string command = "cd " + shell_word(job.directory.string()) + " || exit 126; " +
                        (shell_makes_way ? "exec " : "") + shell_word(job.program.string()) +
                        " reconstruct";
  for (const std::string& argument : job.arguments) command += " " + shell_word(argument);
  return command + " --shard " + shard + (shell_makes_way ? "" : "; exit $?");
}

}  // namespace pencilscan
