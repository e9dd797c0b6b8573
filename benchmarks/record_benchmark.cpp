// Whether this computer records a ring of cameras without loss: fake GigE Vision cameras on a
// network of its own send raw pictures, and record() writes them. What the cameras cost comes on
// top.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <thread>
#include <vector>

#include "cpu_seconds.h"
#include "pencilscan/capture/aravis_cameras.h"
#include "pencilscan/capture/fake_cameras.h"
#include "pencilscan/capture/record.h"
#include "pencilscan/core/private_network.h"

namespace pencilscan {
namespace {

struct Setting {
  int cameras = 6;
  int width = 1280;
  int height = 960;
  double rate_hz = 10;
  double seconds = 60;
  double exposure_ms = 16;
  std::filesystem::path out;
};

/// Raw pictures with the noise of a sensor, which does not compress.
std::vector<cv::Mat> sensor_pictures(const Setting& setting) {
  std::vector<cv::Mat> pictures;
  cv::RNG random(1);
  for (int k = 0; k < 4; ++k) {
    cv::Mat noisy(setting.height, setting.width, CV_16SC1);
    random.fill(noisy, cv::RNG::NORMAL, 60 + 20 * k, 3);
    noisy.convertTo(pictures.emplace_back(), CV_8U);
  }
  return pictures;
}

std::string serial_of(int camera) { return "RECORD" + std::to_string(camera); }

std::vector<std::unique_ptr<FakeCamera>> make_cameras(const Setting& setting,
                                                      const std::vector<cv::Mat>& pictures) {
  std::vector<std::unique_ptr<FakeCamera>> cameras;
  for (int c = 0; c < setting.cameras; ++c) {
    FakeCameraScript script;
    script.address = "127.0.0." + std::to_string(c + 1);
    script.serial = serial_of(c);
    script.expose = [&pictures, next = std::size_t{0}](cv::Mat& picture, std::uint32_t,
                                                       std::int64_t, double exposure_us,
                                                       double) mutable {
      std::this_thread::sleep_for(std::chrono::microseconds(static_cast<int>(exposure_us)));
      pictures[next++ % pictures.size()].copyTo(picture);
    };
    cameras.push_back(std::make_unique<FakeCamera>(script));
  }
  return cameras;
}

std::unique_ptr<LiveCameras> open_cameras(const Setting& setting) {
  CameraSettings settings;
  settings.width = setting.width;
  settings.height = setting.height;
  settings.exposure_us = 1000 * setting.exposure_ms;
  settings.rate_hz = setting.rate_hz;
  settings.pixel_format = "BayerRG8";
  std::vector<NamedCamera> named;
  for (int c = 0; c < setting.cameras; ++c)
    named.push_back({"cam" + std::to_string(c), open_aravis_camera("Aravis-Fake-" + serial_of(c))});
  auto live = std::make_unique<LiveCameras>(std::move(named));
  for (std::size_t c = 0; c < live->group().size(); ++c) live->group().configure(c, settings);
  return live;
}

void run(const Setting& setting) {
  enter_private_network(setting.cameras);
  const std::vector<cv::Mat> pictures = sensor_pictures(setting);
  const auto cameras = make_cameras(setting, pictures);
  (void)list_aravis_cameras();
  const auto live = open_cameras(setting);
  RecordOptions options;
  options.rate_hz = setting.rate_hz;
  options.seconds = setting.seconds;
  const double busy = cpu_seconds();
  live->start();
  Rig rig;  // raw pictures stay raw
  for (std::size_t c = 0; c < live->group().size(); ++c) {
    rig.cameras.emplace_back().name = live->group().name(c);
    rig.cameras.back().mosaic = Mosaic::from_name("RGGB");
  }
  const RecordReport report = record(*live, rig, setting.out, options);
  live->stop();
  const double processors = (cpu_seconds() - busy) / report.seconds;
  CameraTally all;
  for (const CameraTally& tally : report.tallies) {
    all.pictures += tally.pictures;
    all.incomplete += tally.incomplete;
    all.skipped += tally.skipped;
    all.late += tally.late;
  }
  std::printf("frames written     %zu in %.1f s, %zu of them whole\n", report.frames,
              report.seconds, report.whole);
  std::printf("pictures           %zu arrived\n", all.pictures);
  std::printf(
      "lost               %zu incomplete, %zu never seen, %zu late, %zu frames at the disk\n",
      all.incomplete, all.skipped, all.late, report.disk_drops);
  std::printf("waited for disk    %zu frames at most\n", report.most_waiting);
  std::printf("spread, median     %.1f ms\n", report.spread.median_ms);
  std::printf("processors at work %.2f, with the cameras\n", processors);
  for (const Fault& fault : report.faults)
    std::printf("%s: %s\n", fault.kind.c_str(), to_string(fault).c_str());
}

}  // namespace
}  // namespace pencilscan

int main(int argc, char** argv) {
  CLI::App app{"Records fake cameras"};
  pencilscan::Setting setting;
  app.add_option("--out", setting.out, "recording.zarr, or a folder, that is not there yet")
      ->required();
  app.add_option("--cameras", setting.cameras);
  app.add_option("--width", setting.width);
  app.add_option("--height", setting.height);
  app.add_option("--rate", setting.rate_hz);
  app.add_option("--seconds", setting.seconds);
  app.add_option("--exposure-ms", setting.exposure_ms);
  CLI11_PARSE(app, argc, argv);
  try {
    pencilscan::run(setting);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "record_benchmark: %s\n", error.what());
    return 1;
  }
}
