// From the images of one frame to labelled points, and with --shape on to the mesh, stage by stage,
// as blur ratios (reference_blur.h); how busy the threads are, memory, and frames made at once.

#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cpu_seconds.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/memory.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/io/image.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/frame_files.h"
#include "pencilscan/pipeline/sensor_frame.h"
#include "pencilscan/pipeline/sequence.h"
#include "pencilscan/rig/camera_light.h"
#include "pencilscan/rig/rig.h"
#include "read_frame.h"
#include "reference_blur.h"

namespace pencilscan {
namespace {

/// Largest memory of the process so far, GB.
double peak_memory_gb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / (1 << 20);
}

/// Wall and processor time of something that is done several times.
class Times {
 public:
  template <class Work>
  void measure(Work&& work) {
    const double cpu = cpu_seconds();
    const Stopwatch watch;
    work();
    wall_.push_back(watch.seconds());
    busy_.push_back((cpu_seconds() - cpu) / wall_.back());
  }
  void forget_warm_up() {
    wall_.erase(wall_.begin());
    busy_.erase(busy_.begin());
  }
  [[nodiscard]] double wall() const { return upper_median(wall_); }
  /// How many processors work, on average.
  [[nodiscard]] double busy() const { return upper_median(busy_); }

 private:
  std::vector<double> wall_;
  std::vector<double> busy_;
};

/// `share`: of the whole, where that says something.
void print_row(const std::string& stage, double seconds, double blur_seconds,
               std::optional<double> share = std::nullopt) {
  std::printf("%-24s %9.1f %9.1f", stage.c_str(), 1e3 * seconds, seconds / blur_seconds);
  if (share) std::printf(" %8.1f %%", 100 * *share);
  std::printf("\n");
}

/// Seconds a frame when several are made at once, as a sequence makes them.
double seconds_at_once(const Rig& rig, const Frame& frame, bool with_shape) {
  constexpr std::size_t kFrames = 8;
  FrameOptions options;
  options.meshes = with_shape;
  const Stopwatch watch;
  run_at_once(kFrames, frames_at_once(rig),
              [&](std::size_t) { static_cast<void>(reconstruct_frame(rig, frame, options)); });
  return watch.seconds() / kFrames;
}

void run(const Rig& stated, const std::filesystem::path& folder, int threads, int runs,
         bool with_shape) {
  const ThreadLimit limit(threads);
  const Rig rig = in_footprints(stated);
  cv::setNumThreads(1);  // the cameras share the threads

  // The reference before and after, so that a machine that became slower in between is seen.
  const double blur_before = reference_blur_seconds();
  std::vector<std::string> stages;  // in the order in which they run
  std::map<std::string, std::vector<double>> seconds_by_stage;
  Times reading;
  Times points;
  Times shape;  // depth to mesh
  std::size_t point_count = 0;
  Frame frame;
  const PointOptions options = with_shape ? before_surface({}) : PointOptions{};
  for (int i = 0; i <= runs; ++i) {  // the first run warms up
    reading.measure([&] { frame = read_frame(rig, folder); });
    FrameResult result;
    std::vector<StageTime> times;
    const StageClock clock({}, times);
    SensorFrame seen;
    points.measure([&] {
      seen = sensor_frame(rig, frame);
      PointResult curves = detect_frame(seen.rig, seen.frame, options, clock);
      curves = check_pictures(seen.rig, seen.frame, std::move(curves));
      PointResult lines = solve_frame(seen.rig, seen.frame, std::move(curves), options, clock);
      result.points = place_points(seen.rig, std::move(lines), options, clock);
    });
    shape.measure([&] {
      if (!with_shape) return;
      result.shape = measure_shape(seen.rig, seen.frame, result.points, {}, {}, clock);
      result = match_on_surface(seen.rig, std::move(result), {}, clock);
      result = finish_shape(seen.rig, std::move(result));
    });
    if (i == 0) {
      for (const StageTime& time : times) stages.push_back(time.stage);
      point_count = result.points.points.size();
      continue;
    }
    for (const StageTime& time : times) seconds_by_stage[time.stage].push_back(time.seconds);
  }
  for (Times* of : {&reading, &points, &shape}) of->forget_warm_up();
  const double memory = peak_memory_gb();
  const double alone = points.wall() + (with_shape ? shape.wall() : 0);
  const double at_once = seconds_at_once(stated, frame, with_shape);
  const double blur_after = reference_blur_seconds();
  const double blur = std::min(blur_before, blur_after);

  std::printf("%zu cameras, %zu projectors, %zu points; %d threads, medians of %d runs\n",
              rig.cameras.size(), rig.projectors.size(), point_count, thread_count(), runs);
  std::printf("reference blur %.1f ms before, %.1f ms after; the smaller counts\n\n",
              1e3 * blur_before, 1e3 * blur_after);
  std::printf("%-24s %9s %9s %10s\n", "", "ms", "ratio", "share");
  for (const std::string& stage : stages) {
    const double seconds = upper_median(seconds_by_stage[stage]);
    print_row(stage, seconds, blur, seconds / alone);
  }
  print_row("pictures read", reading.wall(), blur);
  print_row("images to points", points.wall(), blur);
  if (with_shape) print_row("points to colored mesh", shape.wall(), blur);
  print_row("a frame of several", at_once, blur);
  std::printf("\nprocessors at work: %.2f to points", points.busy());
  if (with_shape) std::printf(", %.2f to the mesh", shape.busy());
  std::printf("; memory %.2f GB at most, one frame at a time\n", memory);
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
    run(rig, frame_folder, threads, runs, with_shape);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "frame_benchmark: %s\n", error.what());
    return 1;
  }
  return 0;
}
