#include "pencilscan/capture/aravis_cameras.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <climits>
#include <cmath>
#include <map>
#include <mutex>
#include <utility>

#include "pencilscan/capture/aravis_features.h"
#include "pencilscan/capture/sensor_pixels.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/core/stopwatch.h"

namespace pencilscan {

bool has_aravis() { return true; }

namespace {

constexpr int kAravisBuffers = 16;  ///< pictures that may wait for us: 1.6 s at 10 a second
/// Between tries to reach a camera that was lost: as long as one waits for a host that is silent.
constexpr double kReopenEvery = 3;  ///< s

/// Aravis looks for cameras in one thread at a time.
std::mutex& discovery() {
  static std::mutex mutex;
  return mutex;
}

class AravisCamera final : public CameraDevice {
 public:
  explicit AravisCamera(const std::string& name);
  ~AravisCamera() override;

  const CameraInfo& info() const override { return info_; }
  CameraSettings configure(const CameraSettings& settings) override;
  void start() override;
  void stop() override;
  void trigger() override;
  std::optional<CameraFrame> next(Seconds patience) override;
  std::string trouble() const override {
    return lost_ ? "the camera no longer answers" : std::string();
  }

 private:
  /// StageError when it does not answer, or another program holds it.
  void open();
  /// Lets the camera go, answering or not.
  void let_go();
  /// Opens one that was lost, set and running as it was; StageError when it still cannot be
  /// reached.
  void reopen();
  void begin();
  [[nodiscard]] bool has(const char* feature) {
    Failure failure;
    return arv_camera_is_feature_available(camera_.get(), feature, failure.out()) != 0;
  }
  /// InputError that names the setting.
  void refuse(const std::string& setting, const std::string& value, const std::string& why) const {
    throw InputError(info_.address, setting, value, why);
  }
  void set_picture(const CameraSettings& settings, CameraSettings& result);
  void set_exposure(const CameraSettings& settings, CameraSettings& result);
  void set_trigger(const CameraSettings& settings);
  void switch_off_automatics();
  void read_layout();
  [[nodiscard]] CameraFrame frame_of(ArvBuffer* buffer) const;

  std::string name_;
  std::unique_ptr<ArvCamera, Unref> camera_;  ///< null while it is lost and was looked for in vain
  std::unique_ptr<FeatureKeeper> keeper_;
  std::unique_ptr<ArvStream, Unref> stream_;
  CameraInfo info_;
  PixelLayout layout_;
  ArvPixelFormat pixel_format_ = 0;
  std::int64_t utc_minus_host_ = 0;
  std::optional<CameraSettings> asked_;  ///< of the last configure() that it took
  std::atomic<bool> lost_ = false;
  std::optional<Stopwatch> since_lost_;  ///< or since it was looked for; empty: nobody was told yet
  bool running_ = false;
};

void AravisCamera::open() {
  Failure failure;
  camera_.reset(arv_camera_new(name_.c_str(), failure.out()));
  if (!camera_)
    throw StageError("camera " + name_ + " cannot be opened: " +
                     (failure.failed() ? failure.text() : "it does not answer"));
  ArvDevice* device = arv_camera_get_device(camera_.get());
  if (ARV_IS_GV_DEVICE(device) && arv_gv_device_is_controller(ARV_GV_DEVICE(device)) == 0) {
    camera_.reset();
    throw StageError("camera " + name_ +
                     " cannot be opened: another program holds it; close that one, or wait some "
                     "seconds where it has just ended");
  }
  g_signal_connect(device, "control-lost", G_CALLBACK(+[](ArvDevice*, gpointer self) {
                     static_cast<AravisCamera*>(self)->lost_ = true;
                   }),
                   this);
}

void AravisCamera::let_go() {
  stream_.reset();
  if (!camera_) return;
  g_signal_handlers_disconnect_by_data(arv_camera_get_device(camera_.get()), this);
  camera_.reset();
}

void AravisCamera::reopen() {
  since_lost_ = Stopwatch();
  let_go();
  // It may have come back at another address of the network; one that does not say that it is there
  // would be waited for.
  const std::vector<CameraInfo> there = list_aravis_cameras();
  if (std::none_of(there.begin(), there.end(), [&](const CameraInfo& camera) {
        return camera.address == info_.address || camera.serial == info_.serial;
      }))
    throw StageError(info_.address + ": the camera no longer answers");
  {
    const std::lock_guard lock(discovery());
    open();
  }
  lost_ = false;
  keeper_->belongs_to(arv_camera_get_device(camera_.get()));
  try {
    if (asked_) (void)configure(CameraSettings(*asked_));
    if (running_) begin();
  } catch (const std::exception&) {
    lost_ = true;
    throw;
  }
  since_lost_.reset();
}

AravisCamera::AravisCamera(const std::string& name) : name_(name) {
  open();
  Failure failure;
  info_.address = "aravis:" + name;
  info_.model = text_of(arv_camera_get_vendor_name(camera_.get(), failure.out())) + " ";
  info_.model += text_of(arv_camera_get_model_name(camera_.get(), failure.out()));
  info_.serial = text_of(arv_camera_get_device_serial_number(camera_.get(), failure.out()));
  keeper_ = std::make_unique<FeatureKeeper>(arv_camera_get_device(camera_.get()));
}

AravisCamera::~AravisCamera() {
  try {
    stop();
  } catch (const std::exception&) {  // a camera that is gone has stopped
  }
  // A camera that does not answer shall not be asked for every feature in turn.
  if (lost_) keeper_->leave();
  keeper_.reset();
  let_go();
}

void AravisCamera::switch_off_automatics() {
  ArvDevice* device = arv_camera_get_device(camera_.get());
  Failure ignored;
  for (const char* name : {"ExposureAuto", "GainAuto", "BalanceWhiteAuto"})
    if (has(name)) arv_device_set_string_feature_value(device, name, "Off", ignored.out());
  // Linear light: what a gamma adds would have to be taken out again.
  if (has("GammaEnable"))
    arv_device_set_boolean_feature_value(device, "GammaEnable", 0, ignored.out());
  if (has("Gamma")) arv_device_set_float_feature_value(device, "Gamma", 1, ignored.out());
}

void AravisCamera::set_picture(const CameraSettings& settings, CameraSettings& result) {
  Failure failure;
  if (settings.pixel_format) {
    if (!layout_from_genicam(*settings.pixel_format))
      refuse("pixel_format", *settings.pixel_format,
             "must be unpacked: Mono8, BayerRG8, RGB8, Mono12, BayerRG12, Mono16 or the like");
    arv_camera_set_pixel_format_from_string(camera_.get(), settings.pixel_format->c_str(),
                                            failure.out());
    if (failure.failed()) refuse("pixel_format", *settings.pixel_format, failure.text());
  }
  if (settings.width > 0 && settings.height > 0) {
    gint least = 0;
    gint widest = INT_MAX;
    gint highest = INT_MAX;
    arv_camera_get_width_bounds(camera_.get(), &least, &widest, failure.out());
    arv_camera_get_height_bounds(camera_.get(), &least, &highest, failure.out());
    const std::string size = size_text(settings.width, settings.height);
    if (settings.width > widest || settings.height > highest)
      refuse("size", size, "must be at most " + size_text(widest, highest));
    arv_camera_set_region(camera_.get(), 0, 0, settings.width, settings.height, failure.out());
    if (failure.failed()) refuse("size", size, failure.text());
  }
  gint x = 0;
  gint y = 0;
  arv_camera_get_region(camera_.get(), &x, &y, &result.width, &result.height, failure.out());
  if (settings.width > 0 && (result.width != settings.width || result.height != settings.height))
    refuse("size", size_text(result.width, result.height),
           "must be " + size_text(settings.width, settings.height) +
               ", that of the rig: the camera allows no other");
  result.pixel_format =
      text_of(arv_camera_get_pixel_format_as_string(camera_.get(), failure.out()));
}

void AravisCamera::set_exposure(const CameraSettings& settings, CameraSettings& result) {
  Failure failure;
  if (settings.exposure_us) {
    double least = 0;
    double most = 0;
    arv_camera_get_exposure_time_bounds(camera_.get(), &least, &most, failure.out());
    // Aravis itself sends what is out of them, cut to the register's bits.
    if (!failure.failed() && least < most &&
        (*settings.exposure_us < least || *settings.exposure_us > most))
      refuse("exposure", formatted(*settings.exposure_us, "%.0f us"),
             "must be " + formatted(least, "%.0f") + " to " + formatted(most, "%.0f us") +
                 ", which the camera can");
    arv_camera_set_exposure_time(camera_.get(), *settings.exposure_us, failure.out());
    if (failure.failed())
      refuse("exposure", std::to_string(*settings.exposure_us) + " us", failure.text());
  }
  if (settings.gain) {
    arv_camera_set_gain(camera_.get(), *settings.gain, failure.out());
    if (failure.failed()) refuse("gain", std::to_string(*settings.gain), failure.text());
  }
  const double exposure = arv_camera_get_exposure_time(camera_.get(), failure.out());
  if (!failure.failed()) result.exposure_us = exposure;
  const double gain = arv_camera_get_gain(camera_.get(), failure.out());
  if (!failure.failed()) result.gain = gain;
}

void AravisCamera::set_trigger(const CameraSettings& settings) {
  Failure failure;
  ArvDevice* device = arv_camera_get_device(camera_.get());
  arv_camera_clear_triggers(camera_.get(), failure.out());
  if (settings.trigger == Trigger::kSoftware || settings.trigger == Trigger::kWire) {
    const std::string source = settings.trigger == Trigger::kSoftware ? "Software" : settings.line;
    arv_camera_set_trigger(camera_.get(), source.c_str(), failure.out());
    if (failure.failed()) refuse("trigger", source, failure.text());
  }
  if (settings.trigger != Trigger::kPtp) return;
  const char* name = has("PtpEnable") ? "PtpEnable" : "GevIEEE1588";
  arv_device_set_boolean_feature_value(device, name, 1, failure.out());
  if (failure.failed())
    refuse("trigger", "ptp", "the camera has no Precision Time Protocol: " + failure.text());
}

CameraSettings AravisCamera::configure(const CameraSettings& settings) {
  if (lost_) reopen();
  CameraSettings result = settings;
  Failure failure;
  switch_off_automatics();
  set_picture(settings, result);
  if (settings.rate_hz &&
      (settings.trigger == Trigger::kFree || settings.trigger == Trigger::kPtp)) {
    arv_camera_set_frame_rate(camera_.get(), *settings.rate_hz, failure.out());
    if (failure.failed()) refuse("rate", std::to_string(*settings.rate_hz) + " Hz", failure.text());
    const double rate = arv_camera_get_frame_rate(camera_.get(), failure.out());
    if (!failure.failed()) result.rate_hz = rate;
  }
  set_exposure(settings, result);
  set_trigger(settings);
  arv_camera_set_acquisition_mode(camera_.get(), ARV_ACQUISITION_MODE_CONTINUOUS, failure.out());
  // The largest packets that the way to the camera lets through.
  if (arv_camera_is_gv_device(camera_.get()) != 0)
    arv_camera_gv_auto_packet_size(camera_.get(), failure.out());
  asked_ = settings;
  return result;
}

void AravisCamera::read_layout() {
  Failure failure;
  const std::string name =
      text_of(arv_camera_get_pixel_format_as_string(camera_.get(), failure.out()));
  const auto layout = layout_from_genicam(name);
  if (!layout) refuse("pixel_format", name, "must be unpacked: Mono8, BayerRG8, RGB8 or the like");
  layout_ = *layout;
  pixel_format_ = arv_camera_get_pixel_format(camera_.get(), failure.out());
}

void AravisCamera::start() {
  if (running_) return;
  if (lost_) reopen();
  begin();
  running_ = true;
}

void AravisCamera::begin() {
  read_layout();
  Failure failure;
  stream_.reset(arv_camera_create_stream(camera_.get(), nullptr, nullptr, failure.out()));
  if (!stream_) throw StageError(info_.address + ": no stream: " + failure.text());
  if (ARV_IS_GV_STREAM(stream_.get()))
    g_object_set(stream_.get(), "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_AUTO, "packet-resend",
                 ARV_GV_STREAM_PACKET_RESEND_ALWAYS, nullptr);
  const auto payload =
      static_cast<std::size_t>(arv_camera_get_payload(camera_.get(), failure.out()));
  for (int i = 0; i < kAravisBuffers; ++i)
    arv_stream_push_buffer(stream_.get(), arv_buffer_new_allocate(payload));
  utc_minus_host_ = utc_minus_host_ns();
  arv_camera_start_acquisition(camera_.get(), failure.out());
  if (failure.failed()) throw StageError(info_.address + ": it does not start: " + failure.text());
}

void AravisCamera::stop() {
  if (!running_) return;
  running_ = false;
  Failure failure;
  if (!lost_) arv_camera_stop_acquisition(camera_.get(), failure.out());
  if (failure.failed()) lost_ = true;
  stream_.reset();
}

void AravisCamera::trigger() {
  if (lost_) return;  // trouble() says so
  Failure failure;
  arv_camera_software_trigger(camera_.get(), failure.out());
  if (failure.failed())
    throw StageError(info_.address + ": it cannot be triggered: " + failure.text());
}

CameraFrame AravisCamera::frame_of(ArvBuffer* buffer) const {
  CameraFrame frame;
  const auto system = static_cast<std::int64_t>(arv_buffer_get_system_timestamp(buffer));
  frame.arrival_ns = system > 0 ? system - utc_minus_host_ : host_now_ns();
  frame.number = static_cast<std::int64_t>(arv_buffer_get_frame_id(buffer));
  // The status before the picture: what is not complete has neither size nor format.
  switch (arv_buffer_get_status(buffer)) {
    case ARV_BUFFER_STATUS_SUCCESS:
      break;
    case ARV_BUFFER_STATUS_TIMEOUT:
    case ARV_BUFFER_STATUS_MISSING_PACKETS:
    case ARV_BUFFER_STATUS_WRONG_PACKET_ID:
      frame.status = PictureStatus::kLostPackets;
      return frame;
    case ARV_BUFFER_STATUS_SIZE_MISMATCH:
      frame.status = PictureStatus::kWrongSize;
      return frame;
    default:
      frame.status = PictureStatus::kAborted;
      return frame;
  }
  frame.timestamp_ns = static_cast<std::int64_t>(arv_buffer_get_timestamp(buffer));
  frame.mosaic = layout_.mosaic;
  gint x = 0;
  gint y = 0;
  gint width = 0;
  gint height = 0;
  arv_buffer_get_image_region(buffer, &x, &y, &width, &height);
  std::size_t size = 0;
  const void* data = arv_buffer_get_data(buffer, &size);
  if (arv_buffer_get_image_pixel_format(buffer) == pixel_format_)
    frame.image = picture_from_bytes(data, size, width, height, layout_);
  if (frame.image.empty()) frame.status = PictureStatus::kWrongSize;
  return frame;
}

std::optional<CameraFrame> AravisCamera::next(Seconds patience) {
  if (lost_ && running_) {
    // First the news; then it is looked for, which takes a second or some.
    if (!since_lost_) since_lost_ = Stopwatch();
    if (since_lost_->seconds() < kReopenEvery) return std::nullopt;
    try {
      reopen();
    } catch (const std::exception&) {  // trouble() says so
      return std::nullopt;
    }
  }
  if (!stream_) return std::nullopt;
  ArvBuffer* buffer = arv_stream_timeout_pop_buffer(
      stream_.get(), static_cast<guint64>(std::max(0.0, patience.count() * 1e6)));
  if (buffer == nullptr) return std::nullopt;
  CameraFrame frame = frame_of(buffer);
  arv_stream_push_buffer(stream_.get(), buffer);
  return frame;
}

}  // namespace

std::vector<CameraInfo> list_aravis_cameras() {
  const std::lock_guard lock(discovery());
  arv_update_device_list();
  std::vector<CameraInfo> cameras;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i)
    cameras.push_back({"aravis:" + text_of(arv_get_device_id(i)),
                       text_of(arv_get_device_vendor(i)) + " " + text_of(arv_get_device_model(i)),
                       text_of(arv_get_device_serial_nbr(i))});
  std::sort(cameras.begin(), cameras.end(),
            [](const CameraInfo& a, const CameraInfo& b) { return a.address < b.address; });
  return cameras;
}

std::unique_ptr<CameraDevice> open_aravis_camera(const std::string& name) {
  const std::lock_guard lock(discovery());
  return std::make_unique<AravisCamera>(name);
}

}  // namespace pencilscan
