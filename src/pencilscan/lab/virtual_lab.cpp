#include "pencilscan/lab/virtual_lab.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "pencilscan/core/host_clock.h"

namespace pencilscan {
namespace {

// Numbers of pixel formats (PFNC) that cameras of this laboratory can be asked for.
constexpr std::uint32_t kMono8 = 0x01080001;
constexpr std::uint32_t kRgb8 = 0x02180014;
struct BayerFormat {
  std::uint32_t number;
  const char* name;
  const char* mosaic;
};
constexpr std::array<BayerFormat, 4> kBayer{{{0x01080008, "BayerGR8", "GRBG"},
                                             {0x01080009, "BayerRG8", "RGGB"},
                                             {0x0108000A, "BayerGB8", "GBRG"},
                                             {0x0108000B, "BayerBG8", "BGGR"}}};

std::optional<Mosaic> mosaic_of(std::uint32_t format) {
  for (const BayerFormat& bayer : kBayer)
    if (bayer.number == format) return Mosaic::from_name(bayer.mosaic);
  return std::nullopt;
}

std::string format_of(const std::optional<Mosaic>& mosaic) {
  if (!mosaic) return "RGB8";
  const auto* const bayer = std::find_if(kBayer.begin(), kBayer.end(), [&](const BayerFormat& b) {
    return b.mosaic == mosaic->name();
  });
  return bayer->name;
}

const std::string kSerial = "LAB";

std::vector<DummyScreen::Output> outputs_for(const Rig& rig) {
  std::vector<DummyScreen::Output> outputs;
  for (const Projector& projector : rig.projectors)
    outputs.push_back({projector.width, projector.height, 1000 / kRoomExposureMs});
  return outputs;
}

std::vector<std::string> output_names(std::size_t count) {
  std::vector<std::string> names;
  for (std::size_t p = 0; p < count; ++p) names.push_back(virtual_output(p));
  return names;
}

void wait_until(std::int64_t when_ns) {
  std::this_thread::sleep_for(
      std::chrono::nanoseconds(std::max<std::int64_t>(0, when_ns - host_now_ns())));
}

}  // namespace

std::string virtual_output(std::size_t projector) { return "DUMMY" + std::to_string(projector); }

VirtualLab::VirtualLab(const Rig& rig, const std::filesystem::path& folder,
                       const PhotographyOptions& photo)
    : screen_(folder, outputs_for(rig)),
      room_(rig, photo),
      watch_(screen_.display(), output_names(rig.projectors.size()),
             [this](std::size_t output, std::int64_t time_ns, const cv::Mat& picture) {
               room_.show(output, time_ns, picture);
             }) {
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) cameras_.push_back(make_camera(c));
}

std::unique_ptr<FakeCamera> VirtualLab::make_camera(std::size_t camera) {
  FakeCameraScript script;
  script.address = "127.0.0." + std::to_string(camera + 1);
  script.serial = kSerial + std::to_string(camera);
  script.expose = [this, camera](cv::Mat& picture, std::uint32_t format, std::int64_t begin_ns,
                                 double exposure_us, double gain) {
    wait_until(begin_ns + std::llround(1e3 * exposure_us));
    watch_.settle();
    const std::optional<Mosaic> mosaic = mosaic_of(format);
    cv::Mat seen = room_.expose(camera, begin_ns, exposure_us, std::pow(10, gain / 20), mosaic);
    if (format == kMono8) cv::cvtColor(seen, seen, cv::COLOR_RGB2GRAY);
    const bool known = format == kMono8 || format == kRgb8 || mosaic;
    if (known && seen.size() == picture.size() && seen.type() == picture.type())
      seen.copyTo(picture);
    else
      picture.setTo(cv::Scalar::all(0));
  };
  return std::make_unique<FakeCamera>(std::move(script));
}

Lab VirtualLab::lab_file() const {
  Lab lab;
  lab.trigger = Trigger::kSoftware;
  const Rig& rig = room_.rig();
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    LabCamera& camera = lab.cameras[rig.cameras[c].name];
    camera.device = "aravis:Aravis-Fake-" + kSerial + std::to_string(c);
    camera.exposure_ms = kRoomExposureMs;
    camera.gain = 0;
    camera.pixel_format = format_of(rig.cameras[c].mosaic);
  }
  for (std::size_t p = 0; p < rig.projectors.size(); ++p)
    lab.outputs[rig.projectors[p].name] = virtual_output(p);
  return lab;
}

}  // namespace pencilscan
