#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/jobs/finish.h"
#include "pencilscan/jobs/slurm.h"
#include "pencilscan/jobs/task_queue.h"
#include "pencilscan/pipeline/run_folder.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class Jobs : public ::testing::Test {
 protected:
  /// A program for the tasks: a shell script, in which $shard is "i/n".
  Job job_of(const std::string& script, std::size_t tasks) {
    const fs::path program = path() / "pro'gram";
    std::ofstream(program) << "#!/bin/sh\nfor word; do shard=$word; done\necho \"$@\"\n"
                           << script << "\n";
    fs::permissions(program, fs::perms::owner_all);
    Job job;
    job.program = program;
    job.directory = path();
    job.out = path() / "out";
    job.arguments = {"--rig", "a rig"};
    job.tasks = tasks;
    job.limit = 2;
    return job;
  }
  static std::vector<std::size_t> all(const Job& job) {
    std::vector<std::size_t> tasks(job.tasks);
    for (std::size_t i = 0; i < tasks.size(); ++i) tasks[i] = i;
    return tasks;
  }
  static std::string error_of(const std::function<void()>& call) {
    try {
      call();
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  }
  [[nodiscard]] const fs::path& path() const { return temporary_.path(); }

  TemporaryFolder temporary_{std::string("jobs_") +
                             ::testing::UnitTest::GetInstance()->current_test_info()->name()};
};

TEST_F(Jobs, AJobIsReadAsItWasWritten) {
  Job job = job_of("", 7);
  job.kind = JobKind::kSsh;
  job.hosts = {"a", "b"};
  job.scheduler = {"--partition=long"};
  EXPECT_FALSE(has_job(job.out));
  write_job(job);
  ASSERT_TRUE(has_job(job.out));
  const Job read = read_job(job.out / "");
  EXPECT_EQ(read.kind, job.kind);
  EXPECT_EQ(read.program, job.program);
  EXPECT_EQ(read.arguments, job.arguments);
  EXPECT_EQ(read.tasks, 7U);
  EXPECT_EQ(read.hosts, job.hosts);
  EXPECT_EQ(read.scheduler, job.scheduler);
  write_text(job_folder(job.out) / "job.json",
             R"({"format": "pencilscan-job/1", "kind": "cloud"})");
  EXPECT_THAT(error_of([&] { (void)read_job(job.out); }), HasSubstr("must be local, ssh or slurm"));
}

TEST_F(Jobs, EveryTaskIsRunOnceAndFailedFramesAreNoReasonToRepeat) {
  const Job job = job_of("echo $shard >> ran; echo 'frames_failed   1'; exit 1", 5);
  const TaskReport report = run_tasks(job, all(job), {});
  EXPECT_EQ(report.done, 5U);
  EXPECT_EQ(report.restarts, 0U);
  std::istringstream lines(read_file(path() / "ran"));
  std::vector<std::string> ran{std::istream_iterator<std::string>(lines), {}};
  std::sort(ran.begin(), ran.end());
  EXPECT_THAT(ran, ElementsAre("0/5", "1/5", "2/5", "3/5", "4/5"));
  EXPECT_THAT(read_file(task_log(job.out, 3)), HasSubstr("reconstruct --rig a rig --shard 3/5\n"));
}

TEST_F(Jobs, WhatIsKilledIsStartedAgainAsOftenAsItMay) {
  Job job = job_of(
      "[ $shard = 1/3 ] && [ ! -e once ] && touch once && kill -9 $$\n"
      "[ $shard = 2/3 ] && echo x >> always && kill -9 $$\nexit 0",
      3);
  std::vector<std::string> said;
  QueueOptions options;
  options.say = [&](const std::string& text) { said.push_back(text); };
  const TaskReport report = run_tasks(job, all(job), options);
  EXPECT_EQ(report.done, 2U);
  EXPECT_EQ(report.restarts, 1U + 2U);
  EXPECT_THAT(report.lost, ElementsAre(2));
  EXPECT_EQ(read_file(path() / "always"), "x\nx\nx\n");
  EXPECT_THAT(said, ::testing::Contains(HasSubstr("task 1 was ended by signal 9, it goes on")));
}

TEST_F(Jobs, BadInputEndsAllWithWhatTheTaskSaid) {
  const Job job = job_of("echo 'pencilscan: rig.json: K: must be upper triangular'; exit 2", 3);
  EXPECT_THROW((void)run_tasks(job, all(job), {}), InputError);
  EXPECT_THAT(error_of([&] { (void)run_tasks(job, all(job), {}); }),
              HasSubstr("must be upper triangular"));
}

TEST_F(Jobs, StoppingEndsWhatRuns) {
  const Job job = job_of("echo $$ > running; sleep 60", 1);
  QueueOptions options;
  options.shall_stop = [&] { return fs::exists(path() / "running"); };
  EXPECT_THROW((void)run_tasks(job, all(job), options), StageError);
}

/// An ssh that runs things here; the host `dead` cannot be reached, `apart` has other folders,
/// `unmounted` finds no input in them, and `readonly` cannot write the output.
class Ssh : public Jobs {
 protected:
  QueueOptions options() {
    const fs::path ssh = path() / "ssh";
    std::ofstream(ssh)
        << "#!/bin/sh\n[ \"$1\" = -o ] && shift 2\necho \"$1\" >> '" << path().string()
        << "/hosts'\n"
        << "[ $1 = dead ] && echo 'ssh: no route to host' && exit 255\n"
        << "[ $1 = unmounted ] && echo 'pencilscan: rig.json: the file does not exist' && exit 2\n"
        << "[ $1 = readonly ] && echo 'inputs.json: cannot be written' && exit 1\n"
        << "[ $1 = apart ] && set \"$1\" \"cd /not/there ${2#cd \'*\'}\"\n"
        << "exec sh -c \"$2\"\n";
    fs::permissions(ssh, fs::perms::owner_all);
    QueueOptions options;
    options.ssh = {ssh.string(), "-o", "BatchMode=yes"};
    return options;
  }
  Job job_on(const std::vector<std::string>& hosts, const std::string& script) {
    Job job = job_of(script, 6);
    job.kind = JobKind::kSsh;
    job.hosts = hosts;
    return job;
  }
};

TEST_F(Ssh, HostsTakeTasksAndALostOneGetsNoMore) {
  const Job job = job_on({"good", "dead"}, "sleep 0.05; echo $shard >> ran");
  const TaskReport report = run_tasks(job, all(job), options());
  EXPECT_EQ(report.done, 6U);
  EXPECT_THAT(report.hosts_left_out, ElementsAre("dead"));
  EXPECT_EQ(report.restarts, 2U);
  const std::string hosts = read_file(path() / "hosts");
  EXPECT_EQ(std::count(hosts.begin(), hosts.end(), '\n'), 8);
  EXPECT_EQ(read_file(path() / "ran").size(), 6 * 4U);
}

TEST_F(Ssh, AHostWithoutTheFolderDoesNoTask) {
  const Job job = job_on({"good", "apart"}, "sleep 0.05; echo $shard >> ran");
  const TaskReport report = run_tasks(job, all(job), options());
  EXPECT_EQ(report.done, 6U);
  EXPECT_THAT(report.hosts_left_out, ElementsAre("apart"));
  EXPECT_EQ(read_file(path() / "ran").size(), 6 * 4U);
}

TEST_F(Ssh, AHostThatRefusesTheInputEndsNoOthers) {
  const Job job = job_on({"good", "unmounted"}, "sleep 0.05; echo $shard >> ran");
  const TaskReport report = run_tasks(job, all(job), options());
  EXPECT_EQ(report.done, 6U);
  EXPECT_THAT(report.hosts_left_out, ElementsAre("unmounted"));
  EXPECT_EQ(read_file(path() / "ran").size(), 6 * 4U);
}

TEST_F(Ssh, WhatAllHostsRefuseIsBadInput) {
  const Job job = job_on({"unmounted", "unmounted"}, "");
  EXPECT_THROW((void)run_tasks(job, all(job), options()), InputError);
  EXPECT_THAT(error_of([&] { (void)run_tasks(job, all(job), options()); }),
              HasSubstr("the file does not exist"));
}

TEST_F(Ssh, AHostThatCannotWriteTakesNotAllThatWaits) {
  const Job job = job_on({"readonly", "good"},
                         "sleep 0.2; echo $shard >> ran; echo 'frames_failed   1'; exit 1");
  std::vector<std::string> said;
  QueueOptions watched = options();
  watched.say = [&](const std::string& text) { said.push_back(text); };
  const TaskReport report = run_tasks(job, all(job), watched);
  EXPECT_EQ(report.done, 6U);
  EXPECT_THAT(report.lost, IsEmpty());
  EXPECT_THAT(report.hosts_left_out, ElementsAre("readonly"));
  EXPECT_EQ(read_file(path() / "ran").size(), 6 * 4U);
  EXPECT_THAT(said, ::testing::Contains(
                        HasSubstr("on readonly did not come to its frames, the host gets no more: "
                                  "inputs.json: cannot be written")));
}

TEST_F(Ssh, ATaskThatIsKilledOverThereIsNoLostHost) {
  const Job job =
      job_on({"good"}, "[ $shard = 4/6 ] && [ ! -e once ] && touch once && kill -9 $$\nexit 0");
  const TaskReport report = run_tasks(job, all(job), options());
  EXPECT_EQ(report.done, 6U);
  EXPECT_EQ(report.restarts, 1U);
  EXPECT_THAT(report.hosts_left_out, IsEmpty());
}

TEST_F(Ssh, NoHostIsAFailureThatSaysWhere) {
  const Job job = job_on({"dead"}, "");
  EXPECT_THAT(error_of([&] { (void)run_tasks(job, all(job), options()); }),
              HasSubstr("no host can do them"));
  EXPECT_THAT(last_log_line(job.out, 0), HasSubstr("no route to host"));
}

TEST_F(Jobs, SlurmGetsAnArrayOfWhatIsAskedForAndAJobThatFinishes) {
  EXPECT_EQ(index_list(std::vector<std::size_t>{0, 1, 2, 3}), "0-3");
  EXPECT_EQ(index_list(std::vector<std::size_t>{2, 5, 7, 8, 9}), "2,5,7-9");
  Job job = job_of("", 30);
  job.kind = JobKind::kSlurm;
  job.limit = 8;
  job.scheduler = {"--partition=long"};
  const SlurmScripts scripts = slurm_scripts(job, std::vector<std::size_t>{3, 4}, 2);
  EXPECT_THAT(scripts.array, HasSubstr("#SBATCH --array=3-4%8\n"));
  EXPECT_THAT(scripts.array, HasSubstr("#SBATCH --requeue\n"));
  EXPECT_THAT(scripts.array, HasSubstr("#SBATCH --partition=long\n"));
  EXPECT_THAT(scripts.array, HasSubstr("--shard \"$SLURM_ARRAY_TASK_ID/30\""));
  EXPECT_THAT(scripts.array, HasSubstr("pro'\\''gram' reconstruct '--rig' 'a rig'"));
  EXPECT_THAT(scripts.finish, HasSubstr("sequence finish --out"));
  EXPECT_THAT(scripts.finish, HasSubstr("--resubmit --rounds 1"));
  const fs::path out = job.out;
  job.out = out.parent_path() / "run 50%a";
  EXPECT_THAT(slurm_scripts(job, std::vector<std::size_t>{0}, 0).array,
              HasSubstr("run 50%%a.job/"));
  job.out = out.parent_path() / "a \" b";
  EXPECT_THROW((void)slurm_scripts(job, std::vector<std::size_t>{0}, 0), InputError);
  job.out = out;
  job.scheduler = {"a\nb"};
  EXPECT_THROW((void)slurm_scripts(job, std::vector<std::size_t>{0}, 0), InputError);
}

/// 120 frames of which one is not there, two failed and one is of something else.
class Finish : public Jobs {
 protected:
  void SetUp() override {
    for (std::size_t k = 0; k < 120; ++k) inputs_.frames.push_back("f" + std::to_string(1000 + k));
    write_run_inputs(out(), inputs_);
    write_rig(sample::small_rig(48, 36, 11), out() / "devices.json");
    for (std::size_t k = 0; k < 120; ++k) {
      if (k != 60 && k != 7 && k != 8) write_frame(k, k == 110 ? "other" : inputs_.settings());
    }
    write_failure(out(), inputs_.frames[7], inputs_.settings(), "i", {"no curve, \"none\"", false});
    write_failure(out(), inputs_.frames[8], inputs_.settings(), "i", {"the disk is full", true});
  }
  void write_frame(std::size_t k, const std::string& settings) {
    FrameFolder folder(out(), inputs_.frames[k], settings, "i");
    write_text(folder.path() / "report.json", R"({"points": 100, "points_by_projector":
      {"proj0": 60, "proj1": 40}, "time_spread_us": 12.5,
      "cameras": [{"name": "cam0", "curve_points": 200, "labelled_curve_points": 150,
                   "curve_height_by_projector": {"proj0": 0.2},
                   "saturated_pixels": 3, "time_offset_us": -12.5, "late": true},
                  {"name": "cam1", "curve_points": 0, "labelled_curve_points": 0}],
      "crossing_disagreement": {"median_px": 0.1, "expected_px": 0.09,
        "devices": [{"name": "cam0", "crossings": 30, "median_px": 0.11},
                    {"name": "cam1", "crossings": 0, "median_px": 0.0},
                    {"name": "proj0", "crossings": 29, "median_px": 0.4},
                    {"name": "proj1", "crossings": 29, "median_px": null}]},
      "surface": {"vertices": 10, "measured_share": 0.8}, "warnings": ["one, two"],
      "findings": [{"code": "no-picture", "device": "cam1", "text": "one, two"}]})",
               Durability::kProcess);
    folder.publish();
  }
  [[nodiscard]] fs::path out() const { return path() / "out"; }

  RunInputs inputs_{"p", "r", "o", "", {}};
};

TEST_F(Finish, HolesHaveTheirReasonsAndTheirTasks) {
  SequenceSummary summary = summarize_sequence(out());
  EXPECT_EQ(summary.done(), 116U);
  ASSERT_THAT(summary.holes, SizeIs(4));
  EXPECT_EQ(summary.holes[0].reason, "no curve, \"none\"");
  EXPECT_FALSE(summary.holes[0].may_fill);
  EXPECT_TRUE(summary.holes[1].may_fill);
  EXPECT_EQ(summary.holes[2].state, "missing");
  EXPECT_EQ(summary.holes[2].reason, "was not made");
  EXPECT_EQ(summary.holes[3].state, "other");
  EXPECT_THAT(tasks_with_holes(summary, 3), ElementsAre(0, 1, 2));
  EXPECT_THAT(not_run_again(summary).value(),
              AllOf(HasSubstr("not run again: f1007;"), HasSubstr("with --overwrite")));
  summary.holes.erase(summary.holes.begin() + 1);
  EXPECT_THAT(tasks_with_holes(summary, 3), ElementsAre(1, 2));
  summary.holes.erase(summary.holes.begin());
  EXPECT_FALSE(not_run_again(summary));
  Job job = job_of("", 3);
  write_job(job);
  write_text(task_log(job.out, 1), "first\nslurmstepd: error: out of memory\n");
  EXPECT_THAT(summarize_sequence(out()).holes[2].reason, HasSubstr("out of memory"));
}

TEST_F(Finish, TheTableHasARowAFrame) {
  write_summary(out(), summarize_sequence(out()));
  std::istringstream csv(read_file(out() / "sequence.csv"));
  std::vector<std::string> lines;
  for (std::string line; std::getline(csv, line);) lines.push_back(line);
  ASSERT_THAT(lines, SizeIs(121));
  EXPECT_THAT(lines[0], ::testing::StartsWith("frame,state,points,labelled_share,crossing_px,"));
  EXPECT_THAT(lines[1], ::testing::StartsWith("f1000,done,100,0.75,0.1,0.09,0.8,"));
  EXPECT_THAT(lines[1], ::testing::EndsWith(",\"one, two\""));
  EXPECT_THAT(lines[8], ::testing::StartsWith("f1007,failed,,,"));
  EXPECT_THAT(lines[8], ::testing::EndsWith(",\"no curve, \"\"none\"\"\""));
  const auto json = read_json(out() / "sequence.json");
  EXPECT_EQ(json["frames_done"], 116);
  EXPECT_EQ(json["table"][0]["cam0.crossing_px"], 0.11);
  EXPECT_EQ(json["table"][0]["late"][0], "cam0");
  EXPECT_EQ(json["table"][0]["proj0.line_height"], 0.2);
  EXPECT_FALSE(json["table"][0].contains("proj1.line_height"));
  EXPECT_EQ(json["holes"][2]["frame"], "f1060");
  EXPECT_EQ(json["events"], nlohmann::json::parse(R"([{"frame": "f1000", "last_frame": "f1119",
      "figure": "no-picture", "device": "cam1", "text": "one, two"}])"));
}

TEST_F(Finish, AFrameWithTwoOddFiguresIsOneFrame) {
  SequenceSummary summary;
  summary.watch.odd = {{3, "one"}, {5, "two"}, {3, "three"}};
  EXPECT_EQ(summary.odd_frames(), 2U);
}

// Earlier results have a median of 0 px where there is no crossing.
TEST_F(Finish, FewCrossingsSayNothingOfADevice) {
  const std::vector<double> px = summarize_sequence(out()).rows[0].device_crossing_px;
  EXPECT_EQ(px[0], 0.11);
  for (const std::size_t d : {1U, 2U, 3U}) EXPECT_TRUE(std::isnan(px[d])) << d;
}

TEST_F(Finish, ResultsOfFramesThatTheInputHasNotAreNamed) {
  EXPECT_FALSE(strays_warning(out(), inputs_.frames));
  fs::create_directories(out() / "notes");
  const std::vector<std::string> fewer(inputs_.frames.begin(), inputs_.frames.end() - 2);
  EXPECT_THAT(strays_warning(out(), fewer).value(),
              AllOf(HasSubstr(": f1118, f1119;"), HasSubstr("remove their folders")));
}

TEST_F(Finish, ABrokenReportIsSaidAndOtherFoldersAreRefused) {
  write_text(out() / "f1000" / "report.json", "{");
  const SequenceSummary summary = summarize_sequence(out());
  EXPECT_EQ(summary.holes[0].row, 0U);
  EXPECT_THAT(summary.holes[0].reason, HasSubstr("its report cannot be read"));
  EXPECT_THAT(error_of([&] { (void)summarize_sequence(path()); }),
              HasSubstr("must be an output folder"));
}

}  // namespace
}  // namespace pencilscan
