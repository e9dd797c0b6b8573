// From the images of one frame to labelled points, and with --shape on to the mesh, stage by stage,
// as blur ratios (reference_blur.h).

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <opencv2/core/utility.hpp>
#include <string>
#include <vector>

#include "pencilscan/core/memory.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/io/image.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/rig/camera_light.h"
#include "pencilscan/rig/rig.h"
#include "reference_blur.h"

namespace pencilscan {
namespace {

Frame read_frame(const Rig& rig, const std::filesystem::path& folder) {
  Frame frame;
  frame.name = folder.filename().string();
  for (const Camera& camera : rig.cameras) {
    const auto path = find_image(folder, camera.name);
    frame.images.push_back(path ? read_camera_image(camera, *path) : cv::Mat());
  }
  return frame;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void print_row(const std::string& stage, double seconds, double blur_seconds) {
  std::printf("%-24s %9.1f %9.1f\n", stage.c_str(), 1e3 * seconds, seconds / blur_seconds);
}

void run(const Rig& stated, const Frame& frame, int threads, int runs, bool with_shape) {
  const ThreadLimit limit(threads);
  const Rig rig = scaled(stated, 1 / footprint(stated));
  cv::setNumThreads(1);  // the cameras share the threads

  // The reference before and after, so that a machine that became slower in between is seen.
  const double blur_before = reference_blur_seconds();
  std::vector<std::string> stages;  // in the order in which they run
  std::map<std::string, std::vector<double>> seconds_by_stage;
  std::vector<double> total_seconds;
  std::vector<double> shape_seconds;  // depth to mesh
  std::size_t points = 0;
  for (int i = 0; i <= runs; ++i) {  // the first run warms up
    const Stopwatch watch;
    PointResult result = measure_points(rig, frame);
    const double seconds = watch.seconds();
    const Stopwatch shape_watch;
    std::vector<StageTime> times = result.times;
    if (with_shape) {
      ShapeResult shape = measure_shape(rig, frame, result);
      look_again(rig, {}, result, shape);
      times.insert(times.end(), shape.times.begin(), shape.times.end());
      times.push_back(result.times.back());
    }
    if (i == 0) {
      for (const StageTime& time : times) stages.push_back(time.stage);
      points = result.points.size();
      continue;
    }
    total_seconds.push_back(seconds);
    shape_seconds.push_back(shape_watch.seconds());
    for (const StageTime& time : times) seconds_by_stage[time.stage].push_back(time.seconds);
  }
  const double blur_after = reference_blur_seconds();
  const double blur = std::min(blur_before, blur_after);

  std::printf("%zu cameras, %zu projectors, %zu points; %d threads, medians of %d runs\n",
              rig.cameras.size(), rig.projectors.size(), points, thread_count(), runs);
  std::printf("reference blur %.1f ms before, %.1f ms after; the smaller counts\n\n",
              1e3 * blur_before, 1e3 * blur_after);
  std::printf("%-24s %9s %9s\n", "", "ms", "ratio");
  for (const std::string& stage : stages) {
    print_row(stage, median(seconds_by_stage[stage]), blur);
  }
  print_row("images to points", median(total_seconds), blur);
  if (with_shape) print_row("points to colored mesh", median(shape_seconds), blur);
}

}  // namespace
}  // namespace pencilscan

int main(int argc, char** argv) {
  using namespace pencilscan;
  keep_freed_memory();
  std::string rig_path;
  std::string frame_folder;
  int threads = 2;
  int runs = kBenchmarkRuns;
  CLI::App app("Time of one frame, images to labelled points, against the reference blur");
  app.add_option("rig", rig_path, "rig.json")->required();
  app.add_option("frame", frame_folder, "Folder of one frame's images")->required();
  app.add_option("--threads", threads)->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--runs", runs)->check(CLI::Range(kBenchmarkRuns, 1000))->capture_default_str();
  bool with_shape = false;
  app.add_flag("--shape", with_shape, "Dense depth, mesh, colour and the look after them too");
  CLI11_PARSE(app, argc, argv);
  try {
    const Rig rig = read_rig(rig_path);
    run(rig, read_frame(rig, frame_folder), threads, runs, with_shape);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "frame_benchmark: %s\n", error.what());
    return 1;
  }
  return 0;
}
