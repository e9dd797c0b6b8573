#include "pencilscan/pipeline/sequence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <fstream>
#include <map>
#include <mutex>
#include <opencv2/core.hpp>
#include <set>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/core/error_of.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/pipeline/frame_source.h"
#include "pencilscan/pipeline/repeated_pictures.h"
#include "pencilscan/pipeline/run_folder.h"
#include "pencilscan/pipeline/sequence_inputs.h"
#include "pencilscan/recording/frame_folders.h"
#include "pencilscan/recording/pack.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;

// ---- shards
// ---------------------------------------------------------------------------------------

TEST(Shards, EveryFrameIsOfOneShardAndChunksStayWhole) {
  for (const std::size_t frames : {1U, 49U, 50U, 51U, 333U}) {
    for (const std::size_t count : {1U, 2U, 7U}) {
      std::vector<int> taken(frames, 0);
      for (std::size_t index = 0; index < count; ++index) {
        for (const std::size_t i : Shard{index, count}.frames_of(frames)) {
          ++taken[i];
          EXPECT_TRUE((Shard{index, count}.holds(i / kChunkFrames * kChunkFrames)));
        }
      }
      EXPECT_THAT(taken, ::testing::Each(1));
    }
  }
  EXPECT_EQ(chunk_count(1500), 30U);
  EXPECT_EQ(chunk_count(1501), 31U);
}

TEST(Shards, SchedulersSayWhichOneThisIs) {
  const auto with = [](const std::map<std::string, std::string>& variables) {
    const Environment environment = [&](const std::string& name) -> std::optional<std::string> {
      const auto found = variables.find(name);
      return found == variables.end() ? std::nullopt : std::optional(found->second);
    };
    const Shard shard = shard_from_text("auto", environment);
    return std::pair(shard.index, shard.count);
  };
  using Place = std::pair<std::size_t, std::size_t>;
  EXPECT_EQ(with({{"SLURM_ARRAY_TASK_ID", "3"},
                  {"SLURM_ARRAY_TASK_MIN", "0"},
                  {"SLURM_ARRAY_TASK_MAX", "6"},
                  {"SLURM_ARRAY_TASK_COUNT", "7"}}),
            Place(3, 7));
  EXPECT_EQ(with({{"SLURM_ARRAY_TASK_ID", "7"},
                  {"SLURM_ARRAY_TASK_MIN", "1"},
                  {"SLURM_ARRAY_TASK_COUNT", "4"},
                  {"SLURM_ARRAY_TASK_STEP", "2"}}),
            Place(3, 4));
  EXPECT_EQ(with({{"SGE_TASK_ID", "2"}, {"SGE_TASK_FIRST", "1"}, {"SGE_TASK_LAST", "5"}}),
            Place(1, 5));
  EXPECT_EQ(with({{"JOB_COMPLETION_INDEX", "0"}, {"PENCILSCAN_SHARDS", "3"}}), Place(0, 3));
  EXPECT_EQ(with({{"PBS_ARRAY_INDEX", "2"}, {"PENCILSCAN_SHARDS", "3"}}), Place(2, 3));
  EXPECT_EQ(with({{"OMPI_COMM_WORLD_RANK", "1"}, {"OMPI_COMM_WORLD_SIZE", "2"}}), Place(1, 2));
  const auto refused = [&](const std::map<std::string, std::string>& variables) {
    return error_of([&] { with(variables); });
  };
  EXPECT_THAT(refused({}), HasSubstr("no scheduler"));
  EXPECT_THAT(refused({{"SGE_TASK_ID", "undefined"}}), HasSubstr("no scheduler"));
  EXPECT_THAT(refused({{"JOB_COMPLETION_INDEX", "0"}}), HasSubstr("PENCILSCAN_SHARDS"));
  EXPECT_THAT(refused({{"PBS_ARRAY_INDEX", "3"}, {"PENCILSCAN_SHARDS", "3"}}),
              HasSubstr("one of 3 tasks"));
  for (const char* text : {"3/3", "-1/3", "1", "1/0", "a/b", "1/3x", ""})
    EXPECT_THAT(error_of([&] { (void)shard_from_text(text, process_environment()); }),
                HasSubstr("must be i/n"))
        << text;
  EXPECT_EQ(shard_from_text("2/3", process_environment()).index, 2U);
}

// ---- what an output folder holds
// ------------------------------------------------------------------

class Run : public ::testing::Test {
 protected:
  fs::path out() { return temporary_.path() / "out"; }
  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
};

TEST_F(Run, AFrameAppearsWholeAndTheFirstOneStays) {
  {
    FrameFolder dropped(out(), "000000", "s", "i");
    write_text(dropped.path() / "report.json", "{}");
  }
  EXPECT_EQ(frame_status(out(), "000000", "s", "i").state, FrameState::kMissing);
  EXPECT_FALSE(fs::exists(out() / ".making"));
  FrameFolder first(out(), "000000", "s", "i");
  FrameFolder second(out(), "000000", "s", "i");
  write_text(first.path() / "report.json", "1");
  write_text(second.path() / "report.json", "2");
  EXPECT_EQ(frame_status(out(), "000000", "s", "i").state, FrameState::kMissing);
  first.publish();
  second.publish();
  EXPECT_EQ(read_file(out() / "000000" / "report.json"), "1");
  EXPECT_FALSE(fs::exists(out() / ".making"));
  EXPECT_EQ(frame_status(out(), "000000", "s", "i").state, FrameState::kDone);
  EXPECT_EQ(frame_status(out(), "000000", "s", std::nullopt).state, FrameState::kDone);
  EXPECT_EQ(frame_status(out(), "000000", "s", "j").state, FrameState::kOther);
  EXPECT_EQ(frame_status(out(), "000000", "t", "i").state, FrameState::kOther);
}

TEST_F(Run, AResultWithAnEmptyFileIsMadeAnew) {
  for (const char* name : {"report.json", "points.ply", "pictures/cam0.jpg"}) {
    FrameFolder folder(out() / name, "000000", "s", "i");
    for (const char* file : {"report.json", "points.ply", "pictures/cam0.jpg"})
      write_text(folder.path() / file, "{}");
    folder.publish();
    EXPECT_EQ(frame_status(out() / name, "000000", "s", "i").state, FrameState::kDone);
    fs::resize_file(out() / name / "000000" / name, 0);
    EXPECT_EQ(frame_status(out() / name, "000000", "s", "i").state, FrameState::kMissing) << name;
  }
}

TEST_F(Run, IsNewWhileAnotherShardWritesTheFirstFile) {
  EXPECT_TRUE(is_new_run(out()));
  write_text(out() / "inputs.json.part123_0", "{");
  EXPECT_TRUE(is_new_run(out()));
  EXPECT_FALSE(is_new_run(out() / "inputs.json.part123_0"));
  write_text(out() / "mine.txt", "mine");
  EXPECT_FALSE(is_new_run(out()));
}

TEST_F(Run, AFailureSaysWhyAndMakesWayForAResult) {
  write_failure(out(), "000000", "s", "i", {"the disk is full", true});
  const FrameStatus status = frame_status(out(), "000000", "s", "i");
  ASSERT_EQ(status.state, FrameState::kFailed);
  EXPECT_EQ(status.failure.value().reason, "the disk is full");
  EXPECT_TRUE(status.failure->is_passing);
  FrameFolder folder(out(), "000000", "s", "i");
  write_text(folder.path() / "report.json", "{}");
  folder.publish();
  EXPECT_EQ(frame_status(out(), "000000", "s", "i").state, FrameState::kDone);
  write_failure(out(), "000000", "s", "i", {"too late", true});
  EXPECT_EQ(frame_status(out(), "000000", "s", "i").state, FrameState::kDone);
}

TEST_F(Run, AFailureOfOtherPicturesIsNothingToKeep) {
  write_failure(out(), "000000", "s", "i", {"no curve", false});
  EXPECT_EQ(frame_status(out(), "000000", "s", "j").state, FrameState::kFailed);
  EXPECT_EQ(frame_status(out(), "000000", "t", "i").state, FrameState::kOther);
}

TEST_F(Run, AFullDiskLeavesNothingOpen) {
  const auto open_files = [] {
    return std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator{});
  };
  const auto before = open_files();
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &limit), 0);
  const auto usual = std::exchange(limit.rlim_cur, 0);
  const auto signals = std::signal(SIGXFSZ, SIG_IGN);  // as the program does
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
  EXPECT_THROW(FrameFolder(out(), "000000", "s", "i"), StageError);
  limit.rlim_cur = usual;
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
  std::signal(SIGXFSZ, signals);
  EXPECT_EQ(open_files(), before);
  EXPECT_FALSE(fs::exists(out() / ".making"));
}

TEST_F(Run, OnlyResultsMakeWay) {
  fs::create_directories(out() / "000000");
  EXPECT_NO_THROW(check_replaceable(out(), "000000"));
  EXPECT_NO_THROW(check_replaceable(out(), "000001"));
  write_text(out() / "000000" / "cam0.png", "a picture");
  EXPECT_THAT(error_of([&] { check_replaceable(out(), "000000"); }),
              HasSubstr("holds pictures in 000000"));
  fs::remove(out() / "000000" / "cam0.png");
  write_text(out() / "000000" / "points.ply", "of a result that was being removed");
  EXPECT_NO_THROW(check_replaceable(out(), "000000"));
  write_failure(out(), "000002", "s", "i", {"no curve", false});
  EXPECT_NO_THROW(check_replaceable(out(), "000002"));
}

TEST_F(Run, WhatAKilledProgramLeftIsRemovedAndNothingElse) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    FrameFolder folder(out(), "000001", "s", "i");
    ::kill(::getpid(), SIGKILL);
  }
  ::waitpid(child, nullptr, 0);
  FrameFolder mine(out(), "000002", "s", "i");
  const auto folders = [&] {
    return std::distance(fs::directory_iterator(out() / ".making"), fs::directory_iterator{});
  };
  EXPECT_EQ(folders(), 2);
  remove_abandoned(out());
  EXPECT_EQ(folders(), 1);
  EXPECT_TRUE(fs::exists(mine.path()));
}

// ---- cameras that hang

TEST(RepeatedPictures, ACameraHangsWhereItRepeatsItselfWhileAnotherGoesOn) {
  using Hashes = std::vector<std::vector<std::uint64_t>>;
  const auto found = [](const Hashes& hashes) {
    std::vector<std::array<std::size_t, 3>> runs;
    for (const RepeatedPicture& r : repeated_pictures(hashes))
      runs.push_back({r.camera, r.first, r.last});
    return runs;
  };
  using Run = std::array<std::size_t, 3>;
  EXPECT_THAT(found({{1, 9}, {2, 9}, {3, 9}, {4, 8}}), ElementsAre(Run{1, 0, 2}));
  EXPECT_THAT(found({{1, 9}, {1, 8}, {2, 7}, {2, 6}}), ElementsAre(Run{0, 0, 1}, Run{0, 2, 3}));
  EXPECT_THAT(found({{1, 9}, {1, 9}}), ElementsAre());          // nothing changed at all
  EXPECT_THAT(found({{1, 0}, {2, 0}, {3, 0}}), ElementsAre());  // it has no picture
  EXPECT_THAT(found({{1, 9}, {}, {2, 9}}), ElementsAre());      // not known of the frame between
}

// ---- sequences
// ------------------------------------------------------------------------------------

/// Frames of a camera that sees nothing but noise, so that each is done at once; one has no
/// picture, one a damaged one.
class Sequence : public ::testing::Test {
 protected:
  static constexpr std::size_t kFrames = 110;

  void SetUp() override {
    write_rig(rig_, rig_file());
    cv::Mat image(rig_.cameras[0].height, rig_.cameras[0].width, CV_8UC3);
    for (std::size_t k = 0; k < kFrames; ++k) {
      image.setTo(cv::Scalar::all(static_cast<double>(k)));
      write_image(frames() / six_digits(k) / "cam0.png", image);
    }
    pack_recording(frames(), recording());
    fs::remove(recording() / "cam0" / "7.0.0.0");
    fs::resize_file(recording() / "cam0" / "60.0.0.0", 20);
  }
  fs::path rig_file() { return temporary_.path() / "rig.json"; }
  fs::path frames() { return temporary_.path() / "frames"; }
  fs::path recording() { return temporary_.path() / "recording.zarr"; }
  SequenceOutcome run(const fs::path& from, const fs::path& out, std::optional<Shard> shard,
                      bool overwrite = false) {
    SequenceOptions options;
    options.output.frame.meshes = options.output.pictures = false;
    options.overwrite = overwrite;
    options.shard = shard;
    return reconstruct_sequence(rig_file(), from, out, options);
  }
  /// Every file below a folder with its bytes.
  static std::map<std::string, std::string> bytes(const fs::path& folder) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.is_regular_file())
        files[fs::relative(entry.path(), folder).string()] = read_file(entry.path());
    }
    return files;
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  Rig rig_ = sample::small_rig(48, 36, 11);
};

TEST_F(Sequence, ARecordingGivesTheFramesOfItsFolders) {
  const FrameSource folders = FrameSource::open(rig_, frames());
  const FrameSource recorded = FrameSource::open(rig_, recording());
  ASSERT_EQ(folders.names(), recorded.names());
  for (const std::size_t k : {0U, 6U, 109U}) {
    const Frame a = folders.read(rig_, k);
    const Frame b = recorded.read(rig_, k);
    EXPECT_EQ(cv::norm(a.images[0], b.images[0], cv::NORM_INF), 0);
    EXPECT_TRUE(b.images[1].empty());
  }
  EXPECT_TRUE(recorded.read(rig_, 7).images[0].empty());
  EXPECT_THROW((void)recorded.read(rig_, 60), InputError);
  EXPECT_NE(recorded.hash(1), recorded.hash(2));
  Rig other = rig_;
  other.cameras[0].width = 50;
  EXPECT_THAT(error_of([&] { (void)FrameSource::open(other, recording()); }),
              HasSubstr("must be 50x36"));
  other.cameras[0].name = "else";
  EXPECT_THAT(error_of([&] { (void)FrameSource::open(other, recording()); }),
              HasSubstr("must hold a camera of the rig"));
}

TEST_F(Sequence, ARecordingOfFramesWithGapsHasTheirNumbersAndNoOthers) {
  for (std::size_t k = 1; k + 1 < kFrames; ++k)
    if (k != 4) fs::remove_all(frames() / six_digits(k));
  const fs::path packed = temporary_.path() / "gaps.zarr";
  pack_recording(frames(), packed);
  const FrameSource recorded = FrameSource::open(rig_, packed);
  EXPECT_THAT(recorded.names(), ElementsAre("000000", "000004", "000109"));
  EXPECT_EQ(recorded.names(), FrameSource::open(rig_, frames()).names());
  EXPECT_EQ(recorded.read(rig_, 1).images[0].at<cv::Vec3b>(0, 0)[0], 4);
  EXPECT_THAT(recorded.left_out(), ElementsAre(HasSubstr("no frames: 107 (000001, 000002")));
}

TEST_F(Sequence, AFrameFolderWithoutAPictureIsAFailedFrame) {
  for (std::size_t k = 3; k < kFrames; ++k) fs::remove_all(frames() / six_digits(k));
  fs::remove(frames() / "000001" / "cam0.png");
  for (const std::optional<Shard> shard : {std::optional<Shard>(), std::optional(Shard{0, 1})}) {
    const auto outcome = run(frames(), temporary_.path() / (shard ? "shard" : "whole"), shard);
    ASSERT_EQ(outcome.frames.size(), 3U);
    EXPECT_THAT(outcome.frames[0].failure, HasSubstr("no curve"));
    EXPECT_THAT(outcome.frames[1].failure, HasSubstr("no camera of the rig has a picture"));
    EXPECT_THAT(outcome.frames[2].failure, HasSubstr("no curve"));
  }
  for (const char* name : {"000000", "000002"}) fs::remove_all(frames() / name);
  EXPECT_THAT(error_of([&] { (void)FrameSource::open(rig_, frames()); }),
              HasSubstr("000001: images = none: must hold an image of a camera of the rig"));
}

TEST_F(Sequence, WarnsOfPicturesOfNoCamera) {
  EXPECT_FALSE(strangers_warning(FrameSource::open(rig_, frames())));
  EXPECT_FALSE(strangers_warning(FrameSource::open(rig_, recording())));
  const cv::Mat picture(4, 4, CV_8UC3, cv::Scalar(9, 9, 9));
  write_image(frames() / six_digits(3) / "cam9.png", picture);
  write_image(frames() / six_digits(5) / "cam8.tiff", picture);
  EXPECT_THAT(strangers_warning(FrameSource::open(rig_, frames())).value(),
              EndsWith("nobody looks at them: cam8, cam9"));
  const fs::path recorded = temporary_.path() / "strangers.zarr";
  pack_recording(frames(), recorded);
  EXPECT_THAT(strangers_warning(FrameSource::open(rig_, recorded)).value(),
              EndsWith(": cam8, cam9"));
}

TEST_F(Sequence, WarnsOfARecordingThatWasCutOff) {
  EXPECT_FALSE(open_recording_warning(FrameSource::open(rig_, frames())));
  EXPECT_FALSE(open_recording_warning(FrameSource::open(rig_, recording())));
  const fs::path cut = temporary_.path() / "cut.zarr";
  {
    const Camera& camera = rig_.cameras[0];
    RecordingWriter writer(cut, {{camera.name, camera.width, camera.height, 3, 8, 0}});
    for (std::size_t k = 0; k < 3; ++k)
      writer.write(k, 0, read_stored_image(frames() / six_digits(k) / "cam0.png"), kUnknownTime);
  }
  const SequenceOutcome outcome = run(cut, temporary_.path() / "out", {});
  EXPECT_EQ(outcome.frames.size(), 3U);
  EXPECT_THAT(outcome.warnings, ElementsAre(HasSubstr("the recording was cut off or goes on")));
  EXPECT_THAT(outcome.warnings.front(), HasSubstr("frame 000002"));
}

TEST_F(Sequence, FramesThatAreCountedComeInTheOrderOfTheirNumbers) {
  const fs::path counted = temporary_.path() / "counted";
  const cv::Mat picture(rig_.cameras[0].height, rig_.cameras[0].width, CV_8UC3, cv::Scalar(9));
  for (const char* name : {"1", "2", "3", "10"}) write_image(counted / name / "cam0.png", picture);
  fs::create_directories(counted / ".ipynb_checkpoints");
  EXPECT_THAT(FrameSource::open(rig_, counted).names(), ElementsAre("1", "2", "3", "10"));
}

TEST_F(Sequence, FramesInAnotherOrderThanTheirNumbersAreWarnedOf) {
  const fs::path shots = temporary_.path() / "shots";
  const cv::Mat picture(rig_.cameras[0].height, rig_.cameras[0].width, CV_8UC3, cv::Scalar(9));
  for (const char* name : {"shot_1", "shot_2", "shot_10"})
    write_image(shots / name / "cam0.png", picture);
  EXPECT_THAT(run(shots, temporary_.path() / "out", {}).warnings,
              ElementsAre(HasSubstr("shot_10 comes before shot_2")));
}

TEST_F(Sequence, ShardsInAnyNumberGiveTheSameBytes) {
  const fs::path one = temporary_.path() / "one";
  const fs::path three = temporary_.path() / "three";
  const auto outcome = run(recording(), one, Shard{0, 1});
  ASSERT_EQ(outcome.frames.size(), kFrames);
  EXPECT_THAT(outcome.frames[7].failure, HasSubstr("no camera"));
  EXPECT_THAT(outcome.frames[60].failure, HasSubstr("damaged"));
  EXPECT_THAT(outcome.frames[0].failure, HasSubstr("no curve"));
  for (const std::size_t index : {2U, 0U, 1U}) (void)run(recording(), three, Shard{index, 3});
  EXPECT_EQ(bytes(one), bytes(three));
  EXPECT_EQ(bytes(one).size(), 2 * kFrames + 2);
  const fs::path whole = temporary_.path() / "whole";
  (void)run(recording(), whole, {});
  EXPECT_EQ(bytes(one), bytes(whole));
}

TEST_F(Sequence, ARunWithoutAnyFrameThatCanBeReadWritesNothing) {
  for (std::size_t k = 2; k < kFrames; ++k) fs::remove_all(frames() / six_digits(k));
  write_text(frames() / "000000" / "cam0.png", "no picture");
  EXPECT_THAT(run(frames(), temporary_.path() / "one", {}).frames[0].failure,
              HasSubstr("cam0.png"));
  write_text(frames() / "000001" / "cam0.png", "no picture either");
  EXPECT_THAT(error_of([&] { (void)run(frames(), temporary_.path() / "none", {}); }),
              HasSubstr("000000/cam0.png"));
  EXPECT_FALSE(fs::exists(temporary_.path() / "none"));
}

// A surface starts some frames before a chunk: those are of no shard's own.
TEST_F(Sequence, FramesBeforeAChunkAreNotCountedAmongItsOwn) {
  SequenceOptions options;
  options.output.pictures = false;
  options.output.tracks = true;
  options.shard = Shard{2, 3};
  std::mutex mutex;
  std::multiset<std::string> told;
  (void)reconstruct_sequence(rig_file(), frames(), temporary_.path() / "out", options,
                             [&](std::string_view what, double) {
                               const std::lock_guard lock(mutex);
                               told.emplace(what);
                             });
  const auto count = [&](const std::string& start) {
    return std::count_if(told.begin(), told.end(),
                         [&](const std::string& what) { return what.starts_with(start); });
  };
  for (const char* name : {"000096", "000097", "000098", "000099"})
    EXPECT_GT(count("frame " + std::string(name) + " of the chunk before: "), 0) << name;
  EXPECT_EQ(count("frame 10 of 10: "), count("frame 1 of 10: "));
}

TEST_F(Sequence, NeverReplacesItsFrames) {
  EXPECT_THAT(error_of([&] { (void)run(frames(), frames(), {}, true); }),
              HasSubstr("must not be that of --frames"));
  EXPECT_THAT(error_of([&] { (void)run(frames(), frames() / "result", {}, true); }),
              HasSubstr("must not lie in that of --frames"));
  EXPECT_FALSE(fs::exists(frames() / "result"));
  // Reached on another way, too: as a part of the output.
  const fs::path out = temporary_.path() / "out";
  fs::create_directories(out);
  fs::create_directory_symlink(frames() / six_digits(3), out / six_digits(3));
  EXPECT_THAT(error_of([&] { (void)run(frames(), out, {}, true); }),
              HasSubstr("holds pictures in 000003"));
  EXPECT_TRUE(fs::exists(frames() / six_digits(3) / "cam0.png"));
}

TEST_F(Sequence, WarnsOfACameraThatHangs) {
  for (const std::size_t k : {3U, 4U, 5U})
    write_image(
        frames() / six_digits(k) / "cam1.png",
        cv::Mat(rig_.cameras[1].height, rig_.cameras[1].width, CV_8UC3, cv::Scalar(9, 9, 9)));
  EXPECT_THAT(
      run(frames(), temporary_.path() / "out", {}).warnings,
      ElementsAre(HasSubstr("camera cam1 has the same picture in frames 000003 to 000005")));
}

TEST_F(Sequence, KilledAtAnyMomentAndResumedGivesTheSameBytes) {
  const fs::path whole = temporary_.path() / "whole";
  const fs::path killed = temporary_.path() / "killed";
  (void)run(frames(), whole, Shard{0, 1});
  for (const int milliseconds : {5, 17, 40, 90, 160}) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      const ThreadLimit limit(1);  // no thread but this one outlives a fork
      (void)run(frames(), killed, Shard{0, 1});
      ::_exit(0);
    }
    ::usleep(static_cast<unsigned>(1000 * milliseconds));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    for (std::size_t k = 0; k < kFrames; ++k) {
      if (fs::exists(killed / six_digits(k))) {
        EXPECT_EQ(bytes(killed / six_digits(k)), bytes(whole / six_digits(k)));
      }
    }
  }
  (void)run(frames(), killed, Shard{0, 1});
  EXPECT_EQ(bytes(whole), bytes(killed));
}

TEST_F(Sequence, OtherSettingsAreRefusedAndReplacedShardByShard) {
  const fs::path out = temporary_.path() / "out";
  (void)run(frames(), out, Shard{0, 2});
  (void)run(frames(), out, Shard{1, 2});
  rig_.cameras[0].K(0, 0) += 1;
  write_rig(rig_, rig_file());
  EXPECT_THAT(error_of([&] { (void)run(frames(), out, Shard{0, 2}); }), HasSubstr("another rig"));
  (void)run(frames(), out, Shard{0, 2}, true);
  const std::string settings = read_run_inputs(out).settings();
  EXPECT_EQ(frame_status(out, "000049", settings, std::nullopt).state, FrameState::kFailed);
  EXPECT_EQ(frame_status(out, "000050", settings, std::nullopt).state, FrameState::kOther);
  (void)run(frames(), out, Shard{1, 2}, true);
  EXPECT_EQ(frame_status(out, "000050", settings, std::nullopt).state, FrameState::kFailed);
}

}  // namespace
}  // namespace pencilscan
