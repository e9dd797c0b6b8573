// Runs of a sequence: resumed, refused, refined.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/pipeline/pipeline_fixture.h"
#include "pencilscan/pipeline/sequence.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

TEST_F(PipelineTest, ResumesItsOwnOutputAndRefusesThatOfOtherOptions) {
  const fs::path out = *folder_ / "out_resume";
  EXPECT_FALSE(run(*folder_ / "frames", out, quick()).front().resumed);
  const std::string report = read_file(out / "000000" / "report.json");
  EXPECT_TRUE(run(*folder_ / "frames", out, quick()).front().resumed);
  SequenceOptions other = quick();
  other.output.frame.points.detection.trace.min_points = 7;
  EXPECT_THROW(static_cast<void>(run(*folder_ / "frames", out, other)), InputError);
  EXPECT_EQ(read_file(out / "000000" / "report.json"), report);
  // An aborted frame (no report yet) is made again.
  fs::remove(out / "000000" / "report.json");
  EXPECT_FALSE(run(*folder_ / "frames", out, quick()).front().resumed);
  EXPECT_EQ(read_file(out / "000000" / "report.json"), report);
  other.overwrite = true;
  EXPECT_TRUE(run(*folder_ / "frames", out, other).front().done);
  // So says another build of the program, which would have made other frames.
  nlohmann::ordered_json inputs = nlohmann::ordered_json::parse(read_file(out / "inputs.json"));
  inputs["program"] = "0";
  std::ofstream(out / "inputs.json") << inputs;
  other.overwrite = false;
  EXPECT_THROW(static_cast<void>(run(*folder_ / "frames", out, other)), InputError);
  other.overwrite = true;
  EXPECT_FALSE(run(*folder_ / "frames", out, other).front().resumed);
}

TEST_F(PipelineTest, RefinedRigIsWrittenUsedAndResumed) {
  const PoseCorrection one{{0.5, 0.7, -0.3}, {0.1, 0.1, 0.2}};
  const PoseCorrection other{{-0.6, 0.5, 0.4}, {-0.1, 0.2, -0.1}};
  const fs::path folder = *folder_ / "refine";
  write_rig(corrected_rig(*rig_, {one, other, other, one}), folder / "rig.json");
  SequenceOptions options = quick();
  options.output.refine_rig = true;
  options.output.frame.shape.depth.enabled = false;
  std::vector<std::string> rigs;
  for (const int threads : {1, 2}) {
    const ThreadLimit limit(threads);
    const fs::path out = folder / ("out_" + std::to_string(threads));
    const auto once = reconstruct_sequence(folder / "rig.json", *folder_ / "frames", out, options);
    ASSERT_TRUE(once.frames.front().done) << once.frames.front().failure;
    ASSERT_TRUE(once.refinement.value().refined) << once.refinement->reason;
    EXPECT_GT(once.refinement->before_px, 0.2);
    EXPECT_LT(once.refinement->after_px, 0.05);  // a perfect rig's, of images without noise: 0.02
    EXPECT_EQ(once.refinement->moves.size(), 4U);
    rigs.push_back(read_file(out / "rig.json"));
  }
  EXPECT_EQ(rigs[0], rigs[1]);
  const fs::path out = folder / "out_1";
  const auto again = reconstruct_sequence(folder / "rig.json", *folder_ / "frames", out, options);
  EXPECT_TRUE(again.refinement.value().resumed);
  EXPECT_TRUE(again.refinement->refined);
  EXPECT_TRUE(again.frames.front().resumed);
  EXPECT_EQ(read_file(out / "rig.json"), rigs[0]);
  // The rig that is read is never written over.
  options.overwrite = true;
  EXPECT_THROW(
      static_cast<void>(reconstruct_sequence(out / "rig.json", *folder_ / "frames", out, options)),
      InputError);
  options.output.refine_rig = false;
  EXPECT_TRUE(reconstruct_sequence(out / "rig.json", *folder_ / "frames", out, options)
                  .frames.front()
                  .done);
  EXPECT_EQ(read_file(out / "rig.json"), rigs[0]);
}

TEST_F(PipelineTest, PlainImagesGiveTheColor) {
  const fs::path plain = *folder_ / "plain";
  for (const Camera& camera : rig_->cameras) {
    write_image(plain / "still" / (camera.name + ".png"),
                cv::Mat(camera.height, camera.width, CV_32FC3, cv::Scalar(0.6, 0.15, 0.3)));
  }
  SequenceOptions options = quick();
  options.plain_frames = plain;
  ASSERT_TRUE(run(*folder_ / "frames", *folder_ / "out_plain", options).front().done);
  const TriangleMesh mesh = read_mesh(*folder_ / "out_plain" / "000000" / "mesh_measured.ply");
  ASSERT_FALSE(mesh.color.empty());
  std::size_t right = 0;
  for (const auto& color : mesh.color)
    right += std::abs(color[0] / color[1] - 4) < 0.2 && std::abs(color[2] / color[1] - 2) < 0.1;
  EXPECT_GT(right, mesh.color.size() * 95 / 100);
  // One of a wrong size is refused before anything is written.
  write_image(plain / "still" / (rig_->cameras[0].name + ".png"), cv::Mat(9, 9, CV_32FC3));
  EXPECT_THROW(static_cast<void>(run(*folder_ / "frames", *folder_ / "out_none", options)),
               InputError);
  EXPECT_FALSE(fs::exists(*folder_ / "out_none"));
}

TEST_F(PipelineTest, RigOfOneProjectorIsNotRefinedAndStaysAsItIs) {
  Rig rig = *rig_;
  rig.projectors.pop_back();
  const fs::path folder = *folder_ / "refuse";
  write_rig(rig, folder / "rig.json");
  SequenceOptions options = quick();
  options.output.refine_rig = true;
  options.output.frame.shape.depth.enabled = false;
  const auto outcome =
      reconstruct_sequence(folder / "rig.json", *folder_ / "frames", folder / "out", options);
  ASSERT_TRUE(outcome.refinement);
  EXPECT_FALSE(outcome.refinement->refined);
  EXPECT_THAT(outcome.refinement->reason, testing::HasSubstr("crossings"));
  EXPECT_EQ(read_file(folder / "out" / "rig.json"), read_file(folder / "rig.json"));
}

TEST_F(PipelineTest, MissingCameraIsAWarningAndNotAFailure) {
  const fs::path frames = *folder_ / "one_missing";
  fs::create_directories(frames / "000000");
  fs::copy_file(*folder_ / "frames" / "000000" / "cam0.png", frames / "000000" / "cam0.png",
                fs::copy_options::overwrite_existing);
  SequenceOptions options = quick();
  options.output.frame.points.method = LinearOptions{};
  const auto outcomes = run(frames, *folder_ / "out_missing", options);
  ASSERT_TRUE(outcomes.front().done) << outcomes.front().failure;
  EXPECT_THAT(outcomes.front().warnings, testing::Contains(testing::HasSubstr("cam1")));
}

TEST_F(PipelineTest, AFrameWhosePicturesChangeMeanwhileIsAFailedOneAndIsMadeAnew) {
  const fs::path frames = *folder_ / "changing";
  fs::create_directories(frames);
  fs::copy(*folder_ / "frames" / "000000", frames / "000000");
  SequenceOptions options = quick();
  options.output.frame.points.method = LinearOptions{};
  options.output.frame.meshes = false;
  const auto reconstruct = [&](const Progress& progress) {
    return reconstruct_sequence(*folder_ / "rig.json", frames, *folder_ / "out_changing", options,
                                progress)
        .frames.front();
  };
  bool changed = false;
  const FrameOutcome failed = reconstruct([&](std::string_view stage, double) {
    if (!stage.starts_with("frame 1 of 1") || std::exchange(changed, true)) return;
    write_image(frames / "000000" / "cam1.png", frame_->images[1], 8);
  });
  ASSERT_TRUE(changed);
  EXPECT_FALSE(failed.done);
  EXPECT_THAT(failed.failure, testing::HasSubstr("its pictures changed"));
  const FrameOutcome again = reconstruct({});
  EXPECT_TRUE(again.done) << again.failure;
}

TEST_F(PipelineTest, TrackedFramesGoOnFromWhereAKilledProgramWas) {
  // The ball rests, and then is a smaller one elsewhere.
  const fs::path frames = *folder_ / "tracked";
  const Frame jumped = render_frame(*rig_, make_sphere(50, 48, {40, 0, 0}));
  const auto add_frame = [&](const std::string& name, const Frame& frame, double gain) {
    for (std::size_t c = 0; c < 2; ++c)
      write_image(frames / name / (rig_->cameras[c].name + ".png"), frame.images[c] * gain, 16);
  };
  SequenceOptions options = quick();
  const fs::path whole = *folder_ / "out_tracked";
  const fs::path parts = *folder_ / "out_tracked_parts";
  const fs::path alone = *folder_ / "out_tracked_alone";
  add_frame("000000", *frame_, 1);
  add_frame("000001", *frame_, 0.99);
  options.output.tracks = true;
  ASSERT_EQ(run(frames, parts, options).size(), 2U);
  add_frame("000002", *frame_, 0.98);
  add_frame("000003", jumped, 1);
  for (const FrameOutcome& outcome : run(frames, parts, options))
    EXPECT_TRUE(outcome.done) << outcome.failure;
  fs::remove_all(parts / "000001");  // its surface decides the next one's, too
  EXPECT_TRUE(run(frames, parts, options)[1].done);
  static_cast<void>(run(frames, whole, options));
  SequenceOptions independent = options;
  independent.output.tracks = false;
  static_cast<void>(run(frames, alone, independent));

  const auto mesh = [](const fs::path& out, const std::string& frame) {
    return read_file(out / frame / "mesh.ply");
  };
  for (const std::string frame : {"000000", "000001", "000002", "000003"}) {
    EXPECT_TRUE(mesh(whole, frame) == mesh(parts, frame)) << frame;
    // The frame's own pictures alone decide points, faces and what was measured.
    for (const std::string file : {"points.ply", "curves.ply"})
      EXPECT_TRUE(read_file(whole / frame / file) == read_file(alone / frame / file)) << frame;
    const TriangleMesh film = read_mesh(whole / frame / "mesh.ply");
    const TriangleMesh single = read_mesh(alone / frame / "mesh.ply");
    EXPECT_TRUE(film.faces == single.faces) << frame;
    EXPECT_TRUE(film.confidence == single.confidence) << frame;
    EXPECT_TRUE(film.sigma == single.sigma) << frame;
  }
  EXPECT_FALSE(mesh(whole, "000001") == mesh(alone, "000001"));
  // What is not where it was stays as measured: the bytes are those of a frame alone.
  EXPECT_TRUE(mesh(whole, "000003") == mesh(alone, "000003"));
  EXPECT_FALSE(fs::exists(whole / ".surfaces"));
  // A program that is killed behind its last frame leaves surfaces behind; the next one takes them
  // away, whether frames are missing or not.
  for (const bool is_whole : {true, false}) {
    fs::create_directories(parts / ".surfaces");
    write_text(parts / ".surfaces" / "000000", "left behind");
    if (!is_whole) fs::remove_all(parts / "000003");
    static_cast<void>(run(frames, parts, options));
    EXPECT_FALSE(fs::exists(parts / ".surfaces")) << is_whole;
  }
}

/// Expects an InputError whose line has all the given parts, and no output.
void expect_refused(const fs::path& rig, const fs::path& frames,
                    const std::vector<std::string>& parts) {
  const fs::path out = frames.parent_path() / "out_refused";
  try {
    static_cast<void>(reconstruct_sequence(rig, frames, out, {}));
    FAIL() << frames << " was accepted";
  } catch (const InputError& error) {
    for (const std::string& part : parts) EXPECT_THAT(error.what(), testing::HasSubstr(part));
    EXPECT_THAT(error.what(), testing::Not(testing::HasSubstr("\n")));
  }
  EXPECT_FALSE(fs::exists(out));
}

TEST_F(PipelineTest, RefusesBrokenFramesBeforeWritingAnything) {
  const fs::path rig = *folder_ / "rig.json";
  const std::string png = read_file(*folder_ / "frames" / "000000" / "cam0.png");
  const auto frames_with = [&](const std::string& name, const std::string& file,
                               const std::string& bytes) {
    const fs::path frames = *folder_ / name;
    fs::create_directories(frames / "000000");
    std::ofstream(frames / "000000" / file, std::ios::binary) << bytes;
    return frames;
  };
  expect_refused(rig, frames_with("truncated", "cam0.png", png.substr(0, png.size() / 2)),
                 {"cam0.png"});
  write_image(*folder_ / "wrong_size" / "000000" / "cam1.png", cv::Mat(100, 50, CV_8UC3), 8);
  expect_refused(rig, *folder_ / "wrong_size", {"cam1.png", "50x100", "480x360"});
  expect_refused(rig, frames_with("strangers", "other.png", png), {"000000", "cam0"});
  fs::create_directories(*folder_ / "empty");
  expect_refused(rig, *folder_ / "empty", {"empty", "frame folder"});
  expect_refused(rig, *folder_ / "nowhere", {"nowhere"});
}

}  // namespace
}  // namespace pencilscan
