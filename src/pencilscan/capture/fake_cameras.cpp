#include "pencilscan/capture/fake_cameras.h"

#include <arv.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>

#include "pencilscan/core/error.h"
#include "pencilscan/core/host_clock.h"

namespace pencilscan {
namespace {

/// How often a camera that is triggered looks for its trigger, Hz.
constexpr double kTriggerLook = 500;
constexpr guint32 kTriggerOn = 1;
constexpr guint32 kSourceLine = 0;
constexpr guint32 kSourceSoftware = 1;

guint32 read_register(ArvFakeCamera* camera, guint32 address) {
  guint32 value = 0;
  arv_fake_camera_read_register(camera, address, &value);
  return value;
}

}  // namespace

struct FakeCamera::State {
  FakeCameraScript script;
  ArvGvFakeCamera* server = nullptr;
  std::atomic<double> clock_ppm = 0;
  std::atomic<bool> on_line = false;  ///< a pulse of the line is being served
  std::int64_t start_ns = 0;
  std::atomic<std::int64_t> pulse_ns = 0;

  /// When the exposure of the picture that is asked for began, or is to begin.
  std::int64_t begin_of_exposure(ArvFakeCamera* camera);
  void fill(ArvBuffer* buffer, guint32 exposure_us, guint32 gain, ArvPixelFormat format);
};

std::int64_t FakeCamera::State::begin_of_exposure(ArvFakeCamera* camera) {
  const std::int64_t now = host_now_ns();
  if (on_line.exchange(false)) {
    arv_fake_camera_write_register(camera, ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOURCE, kSourceLine);
    return pulse_ns;
  }
  if (read_register(camera, ARV_FAKE_CAMERA_REGISTER_TRIGGER_MODE) == kTriggerOn) return now;
  // Free running: on the grid of the period that the server keeps. A camera's shutter is on time
  // even where the server's thread is not.
  const std::int64_t period =
      1000LL * read_register(camera, ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US);
  const std::int64_t since = period > 0 ? (now + utc_minus_host_ns()) % period : 0;
  return now - since + static_cast<std::int64_t>(1e9 * script.phase_s);
}

void FakeCamera::State::fill(ArvBuffer* buffer, guint32 exposure_us, guint32 gain,
                             ArvPixelFormat format) {
  ArvFakeCamera* camera = arv_gv_fake_camera_get_fake_camera(server);
  if (script.phase_s > 0)
    std::this_thread::sleep_for(std::chrono::duration<double>(script.phase_s));
  const std::int64_t begin = host_now_ns();
  const auto ticks = begin + script.clock_start_ns +
                     std::llround(1e-6 * clock_ppm * static_cast<double>(begin - start_ns));
  arv_buffer_set_timestamp(buffer, static_cast<guint64>(ticks));
  std::size_t unused = 0;
  void* data = const_cast<void*>(arv_buffer_get_data(buffer, &unused));  // NOLINT: ours to fill
  const auto width = static_cast<int>(read_register(camera, ARV_FAKE_CAMERA_REGISTER_WIDTH));
  const auto height = static_cast<int>(read_register(camera, ARV_FAKE_CAMERA_REGISTER_HEIGHT));
  const int type = format == ARV_PIXEL_FORMAT_RGB_8_PACKED ? CV_8UC3
                   : format == ARV_PIXEL_FORMAT_MONO_16    ? CV_16UC1
                                                           : CV_8UC1;
  cv::Mat picture(height, width, type, data);
  if (script.expose) script.expose(picture, format, begin, exposure_us, gain);
}

FakeCamera::FakeCamera(FakeCameraScript script) : state_(std::make_unique<State>()) {
  state_->script = std::move(script);
  state_->clock_ppm = state_->script.clock_ppm;
  state_->start_ns = host_now_ns();
  state_->server =
      arv_gv_fake_camera_new(state_->script.address.c_str(), state_->script.serial.c_str());
  if (state_->server == nullptr || arv_gv_fake_camera_is_running(state_->server) == 0) {
    if (state_->server != nullptr) g_object_unref(state_->server);
    throw StageError("no fake camera at " + state_->script.address +
                     ": it is no address of this computer, or another camera has it");
  }
  ArvFakeCamera* camera = arv_gv_fake_camera_get_fake_camera(state_->server);
  arv_fake_camera_set_trigger_frequency(camera, kTriggerLook);
  arv_fake_camera_set_fill_pattern(
      camera,
      [](ArvBuffer* buffer, void* self, guint32 exposure, guint32 gain, ArvPixelFormat format) {
        static_cast<State*>(self)->fill(buffer, exposure, gain, format);
      },
      state_.get());
  set_lost_packets(state_->script.lost_packets);
}

FakeCamera::~FakeCamera() { g_object_unref(state_->server); }

void FakeCamera::set_lost_packets(double share) {
  g_object_set(state_->server, "gvsp-lost-ratio", share, nullptr);
}

void FakeCamera::set_clock(double ppm) {
  state_->start_ns = host_now_ns();
  state_->clock_ppm = ppm;
}

void FakeCamera::pulse() {
  // The fake camera serves its software trigger only; while a pulse is served, the line is one.
  ArvFakeCamera* camera = arv_gv_fake_camera_get_fake_camera(state_->server);
  if (arv_fake_camera_get_acquisition_status(camera) == 0 ||
      read_register(camera, ARV_FAKE_CAMERA_REGISTER_TRIGGER_MODE) != kTriggerOn)
    return;
  const bool listens =
      read_register(camera, ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOURCE) == kSourceLine;
  if (!listens && !state_->on_line) return;  // it was set to another trigger
  state_->pulse_ns = host_now_ns();
  state_->on_line = true;
  arv_fake_camera_write_register(camera, ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOURCE, kSourceSoftware);
  arv_fake_camera_write_register(camera, ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 1);
}

}  // namespace pencilscan
