#pragma once

// A ball before the small rig: a frame in memory and on disk, for tests.

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "pencilscan/io/image.h"
#include "pencilscan/pipeline/sequence.h"
#include "pencilscan/rig/sample_devices.h"
#include "pencilscan/simulation/panel_light.h"
#include "pencilscan/simulation/render.h"
#include "pencilscan/simulation/simulated_object.h"

namespace pencilscan {

/// Before a ball: the paper's Fig. 6 with small images.
inline Rig small_rig() { return sample::small_rig(480, 360, 110); }

inline constexpr double kBallMm = 95;  // radius
inline TriangleMesh ball() { return make_sphere(kBallMm, 48); }

inline Frame render_frame(const Rig& rig, const TriangleMesh& mesh) {
  const SimulatedObject object(mesh);
  const auto lights = line_lights(rig);
  Frame frame;
  frame.name = "000000";
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    frame.images.push_back(cv::min(render_camera(rig, c, object, lights), 1.0));
  }
  return frame;
}

/// A scene folder on disk, made once: rig.json and one frame of 16-bit images.
class PipelineTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new std::filesystem::path(std::filesystem::temp_directory_path() /
                                        ("pencilscan_pipeline_test_" + std::to_string(::getpid())));
    rig_ = new Rig(small_rig());
    frame_ = new Frame(render_frame(*rig_, ball()));
    write_rig(*rig_, *folder_ / "rig.json");
    for (std::size_t c = 0; c < 2; ++c) {
      write_image(*folder_ / "frames" / "000000" / (rig_->cameras[c].name + ".png"),
                  frame_->images[c], 16);
    }
  }
  static void TearDownTestSuite() {
    std::filesystem::remove_all(*folder_);
    delete folder_;
    delete rig_;
    delete frame_;
  }

  static std::vector<FrameOutcome> run(const std::filesystem::path& frames,
                                       const std::filesystem::path& out,
                                       const SequenceOptions& options) {
    return reconstruct_sequence(*folder_ / "rig.json", frames, out, options).frames;
  }

  static SequenceOptions quick() {
    SequenceOptions options;
    options.output.pictures = false;
    options.output.frame.shape.surface.max_depth = 5;
    options.output.frame.shape.fusion.max_depth = 5;
    options.program = "test";
    return options;
  }

  inline static std::filesystem::path* folder_ = nullptr;
  inline static Rig* rig_ = nullptr;
  inline static Frame* frame_ = nullptr;
};

}  // namespace pencilscan
