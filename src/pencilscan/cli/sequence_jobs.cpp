#include "pencilscan/cli/sequence_jobs.h"

#include <algorithm>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "pencilscan/cli/arguments.h"
#include "pencilscan/cli/command.h"
#include "pencilscan/cli/interruption.h"
#include "pencilscan/cli/reconstruct_options.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/jobs/finish.h"
#include "pencilscan/jobs/slurm.h"
#include "pencilscan/jobs/task_queue.h"
#include "pencilscan/pipeline/frame_source.h"
#include "pencilscan/pipeline/run_folder.h"
#include "pencilscan/pipeline/sequence.h"
#include "pencilscan/pipeline/sequence_inputs.h"
#include "pencilscan/pipeline/shard.h"
#include "pencilscan/recording/frame_folders.h"

namespace pencilscan::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// ---- what is there and what is missing ----------------------------------------------------------

/// "000012" or "000050 to 000099".
std::string range_name(const SequenceSummary& summary, std::size_t first, std::size_t last) {
  const std::string name = summary.rows[summary.holes[first].row].name;
  return first == last ? "frame " + name
                       : "frames " + name + " to " + summary.rows[summary.holes[last].row].name;
}

/// The reason without the frame's own name, so that it can be that of others too.
std::string shared_reason(const SequenceSummary& summary, const Hole& hole) {
  const std::string name = "frame " + summary.rows[hole.row].name;
  std::string reason = hole.reason;
  for (auto at = reason.find(name); at != std::string::npos; at = reason.find(name))
    reason.replace(at, name.size(), "this frame");
  return reason;
}

/// Neighbours with one reason share a line.
void say_holes(const SequenceSummary& summary) {
  const std::vector<Hole>& holes = summary.holes;
  for (std::size_t i = 0; i < holes.size();) {
    std::size_t last = i;
    const std::string reason = shared_reason(summary, holes[i]);
    while (last + 1 < holes.size() && holes[last + 1].row == holes[last].row + 1 &&
           holes[last + 1].state == holes[i].state &&
           shared_reason(summary, holes[last + 1]) == reason)
      ++last;
    std::cerr << "pencilscan: " << range_name(summary, i, last) << " " << holes[i].state << ": "
              << reason << "\n";
    i = last + 1;
  }
}

Json summary_figures(const fs::path& out, const SequenceSummary& summary) {
  const auto count = [&](const char* state) {
    return std::count_if(summary.holes.begin(), summary.holes.end(),
                         [&](const Hole& hole) { return hole.state == state; });
  };
  Json figures;
  figures["frames"] = summary.rows.size();
  figures["frames_done"] = summary.done();
  figures["frames_failed"] = count("failed");
  figures["frames_missing"] = count("missing") + count("other");
  figures["events"] = summary.watch.events.size();
  figures["odd_frames"] = summary.odd_frames();
  figures["table"] = (out / "sequence.csv").string();
  return figures;
}

/// Writes and says it. StageError when frames lack.
void report_sequence(const CommonOptions& common, const fs::path& out) {
  const SequenceSummary summary = summarize_sequence(out);
  write_summary(out, summary);
  say_holes(summary);
  warn_of(strays_warning(out, read_run_inputs(out).frames));
  for (const SequenceEvent& event : summary.watch.events)
    warn_of(when_text(event, summary.rows) + ": " + event.text);
  if (!summary.watch.not_watched.empty())
    warn_of(
        "whether these were moved is not seen, for most frames have too few of their crossings: " +
        name_list(summary.watch.not_watched, kNamedFrames) +
        "; rig check judges several frames together");
  print_figures(common, summary_figures(out, summary));
  if (!summary.holes.empty()) {
    throw StageError(std::to_string(summary.holes.size()) + " of " +
                     std::to_string(summary.rows.size()) + " frames have no result");
  }
}

// ---- pencilscan sequence submit -----------------------------------------------------------------

/// Of this program itself.
void run_here(const Job& job, std::span<const std::size_t> tasks, Interruption& interruption) {
  QueueOptions options;
  options.shall_stop = [&] { return interruption.within(0); };
  options.say = [](const std::string& text) { std::cerr << "pencilscan: " << text << std::endl; };
  const TaskReport report = run_tasks(job, tasks, options);
  if (!report.lost.empty()) {
    warn_of(std::to_string(report.lost.size()) +
            " tasks were ended as often as they may be started");
  }
}

void hand_to_slurm(const CommonOptions& common, const Job& job, std::span<const std::size_t> tasks,
                   int rounds) {
  const SlurmJobs jobs = submit_to_slurm(job, tasks, rounds);
  print_figures(common, {{"tasks", tasks.size()},
                         {"slurm_array", jobs.array},
                         {"slurm_finish", jobs.finish},
                         {"job_folder", job_folder(job.out).string()}});
}

struct SubmitCommand {
  ReconstructOptions reconstruct;
  int local = 0;
  std::vector<std::string> hosts;
  bool slurm = false;
  std::size_t limit = 0;
  std::size_t max_tasks = 1000;
  int retries = 2;
  std::vector<std::string> sbatch;
};

/// What was given of the options of reconstruct, as its arguments.
std::vector<std::string> passed_on(const CLI::App& command, const std::set<std::string>& own) {
  std::vector<std::string> arguments;
  for (const CLI::Option* option : command.get_options()) {
    if (option->count() == 0 || option->get_lnames().empty()) continue;
    const std::string& name = option->get_lnames().front();
    if (own.contains(name)) continue;
    if (option->get_expected_max() == 0) {
      arguments.push_back("--" + name);
      continue;
    }
    for (const std::string& value : option->results()) {
      arguments.push_back("--" + name);
      arguments.push_back(value);
    }
  }
  return arguments;
}

/// How many tasks: one a chunk, but no more than keep all busy to the end where they start here.
/// Every task looks through the whole sequence once: that is seconds of 10,000 frames.
std::size_t task_count(const SubmitCommand& submit, std::size_t frames) {
  constexpr std::size_t kPerPlace = 16;  // the last ones leave a place idle for a 16th at most
  std::size_t most = submit.max_tasks;
  const std::size_t places = submit.hosts.size() + static_cast<std::size_t>(submit.local);
  if (places > 0) most = std::min(most, kPerPlace * places);
  return std::min(chunk_count(frames), most);
}

/// InputError for what every task would refuse, before it takes the place of a job that can go on.
Job make_job(const SubmitCommand& submit, const CLI::App& command) {
  const FrameSource frames =
      check_sequence(submit.reconstruct.rig, submit.reconstruct.frames, submit.reconstruct.out,
                     sequence_options(submit.reconstruct));
  warn_of(open_recording_warning(frames));
  warn_of(order_warning(frames.names()));
  Job job;
  job.kind = submit.slurm           ? JobKind::kSlurm
             : submit.hosts.empty() ? JobKind::kLocal
                                    : JobKind::kSsh;
  job.program = fs::read_symlink("/proc/self/exe");
  job.directory = fs::current_path();
  job.out = fs::absolute(submit.reconstruct.out).lexically_normal();
  job.arguments = passed_on(command, {"out", "json", "local", "ssh", "slurm", "limit", "max-tasks",
                                      "retries", "sbatch", "help"});
  job.arguments.insert(job.arguments.end(), {"--out", job.out.string()});
  job.tasks = task_count(submit, frames.size());
  job.limit = submit.local > 0 ? static_cast<std::size_t>(submit.local) : submit.limit;
  job.retries = submit.retries;
  job.hosts = submit.hosts;
  job.scheduler = submit.sbatch;
  if (submit.local > 1 && command.get_option("--threads")->count() == 0) {
    const int each = std::max(1, thread_count() / submit.local);
    job.arguments.insert(job.arguments.end(), {"--threads", std::to_string(each)});
  }
  return job;
}

void run_submit(const SubmitCommand& submit, const CLI::App& command) {
  if ((submit.local > 0) + (submit.hosts.empty() ? 0 : 1) + (submit.slurm ? 1 : 0) != 1)
    throw InputError("command line", "--local, --ssh, --slurm", "", "exactly one must be given");
  Interruption interruption;
  const Job job = make_job(submit, command);
  write_job(job);
  std::vector<std::size_t> tasks(job.tasks);
  for (std::size_t i = 0; i < tasks.size(); ++i) tasks[i] = i;
  if (submit.slurm) return hand_to_slurm(submit.reconstruct.common, job, tasks, submit.retries);
  run_here(job, tasks, interruption);
  if (!has_run_inputs(job.out)) {
    throw StageError("no task could begin; the log of the first one ends: " +
                     last_log_line(job.out, 0));
  }
  report_sequence(submit.reconstruct.common, job.out);
}

void add_submit(CLI::App& group) {
  auto options = std::make_shared<SubmitCommand>();
  CLI::App* command = group.add_subcommand(
      "submit", "Reconstruct on several processes, machines, or with Slurm; then finish");
  command->add_option("--local", options->local, "So many processes on this machine")
      ->check(between(1, 4096));
  command
      ->add_option("--ssh", options->hosts,
                   "Machines that see the same folders, with commas; one task each at a time")
      ->delimiter(',');
  command->add_flag("--slurm", options->slurm, "An array of jobs and one that finishes");
  const auto of_slurm = [options](const char* option) {
    return told_where_not(
        option, [options] { return options->slurm; }, "needs --slurm");
  };
  command->add_option("--limit", options->limit, "Tasks of Slurm at once; 0: as many as it likes")
      ->check(of_slurm("--limit"))
      ->capture_default_str();
  add_number(*command, "--max-tasks", options->max_tasks, 1, 1000000,
             "Slurm's MaxArraySize is 1001 as it comes; tasks of longer sequences take "
             "several chunks of 50 frames");
  add_number(*command, "--retries", options->retries, 0, 100,
             "How often a task that was killed is started again");
  command
      ->add_option("--sbatch", options->sbatch,
                   "A further option for sbatch, such as --sbatch=--partition=long")
      ->check(of_slurm("--sbatch"));
  add_reconstruct_options(*command, options->reconstruct);
  add_common_options(*command, options->reconstruct.common,
                     "pencilscan sequence submit --local 2 --rig rig.json --frames "
                     "recording.zarr --out result");
  command->callback([options, command] { run_submit(*options, *command); });
}

// ---- pencilscan sequence finish -----------------------------------------------------------------

struct FinishCommand {
  CommonOptions common;
  std::string out;
  bool resubmit = false;
  int rounds = 0;
};

/// The output may have been moved, with its job beside it: it goes on where it is now.
void move_job(Job& job, const fs::path& to) {
  const fs::path out = fs::absolute(to).lexically_normal();
  const auto option = std::find(job.arguments.begin(), job.arguments.end(), "--out");
  std::error_code ignored;  // where the old place is gone
  if (out == job.out || fs::equivalent(out, job.out, ignored)) return;
  if (option == job.arguments.end() || option + 1 == job.arguments.end()) return;
  std::cerr << "pencilscan: the output was moved from " << job.out.string() << " to "
            << out.string() << ", where all tasks have to find it\n";
  job.out = out;
  *(option + 1) = out.string();
  write_job(job);
}

void run_finish(const FinishCommand& command) {
  const ThreadLimit threads(command.common.threads);
  if (!command.resubmit) return report_sequence(command.common, command.out);
  Interruption interruption;
  if (!has_job(command.out))
    throw InputError("--resubmit", "", job_folder(command.out).string(),
                     "must hold the job.json that sequence submit writes");
  Job job = read_job(command.out);
  move_job(job, command.out);
  const SequenceSummary summary = summarize_sequence(command.out);
  warn_of(not_run_again(summary));
  const std::vector<std::size_t> tasks = tasks_with_holes(summary, job.tasks);
  if (tasks.empty()) return report_sequence(command.common, command.out);
  if (job.kind == JobKind::kSlurm) return hand_to_slurm(command.common, job, tasks, command.rounds);
  if (command.rounds > 0)
    warn_of("--rounds has no effect here: it needs a job that was submitted with --slurm");
  run_here(job, tasks, interruption);
  report_sequence(command.common, command.out);
}

void add_finish(CLI::App& group) {
  auto options = std::make_shared<FinishCommand>();
  CLI::App* command = group.add_subcommand(
      "finish", "What a sequence lacks and why, one table of its frames, and what changed when");
  command->add_option("--out", options->out, "The output folder of reconstruct")->required();
  command->add_flag("--resubmit", options->resubmit,
                    "Run the tasks with missing frames again, as they were submitted");
  add_number(*command, "--rounds", options->rounds, 0, 100,
             "Slurm: how often the job that finishes may itself resubmit")
      ->check(told_where_not(
          "--rounds", [options] { return options->resubmit; }, "needs --resubmit"));
  add_common_options(*command, options->common, "pencilscan sequence finish --out result");
  command->callback([options] { run_finish(*options); });
}

}  // namespace

void add_sequence_jobs(CLI::App& group) {
  add_submit(group);
  add_finish(group);
}

}  // namespace pencilscan::cli
