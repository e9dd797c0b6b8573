#include "pencilscan/capture/v4l2_camera.h"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "pencilscan/capture/sensor_pixels.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/io/codec.h"

namespace pencilscan {

VideoKernel video_kernel() {
  VideoKernel kernel;
  kernel.open = [](const std::string& path) {
    return ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  };
  kernel.close = [](int file) { ::close(file); };
  kernel.control = [](int file, unsigned long request, void* argument) {
    int result = 0;
    do {
      result = ::ioctl(file, request, argument);
    } while (result == -1 && errno == EINTR);
    return result;
  };
  kernel.map = [](int file, std::size_t length, std::size_t offset) -> void* {
    void* memory = ::mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED, file,
                          static_cast<off_t>(offset));
    return memory == MAP_FAILED ? nullptr : memory;
  };
  kernel.unmap = [](void* memory, std::size_t length) { ::munmap(memory, length); };
  kernel.wait = [](int file, Seconds patience) {
    pollfd waiting{file, POLLIN, 0};
    return ::poll(&waiting, 1, static_cast<int>(std::lround(1000 * patience.count()))) > 0;
  };
  return kernel;
}

namespace {

constexpr std::uint32_t kBuffers = 8;
constexpr std::uint32_t kStream = V4L2_BUF_TYPE_VIDEO_CAPTURE;

/// Formats that can be taken, the best first: what the sensor gave before what was made of it.
struct Format {
  const char* name;  ///< GenICam's, or the four letters
  std::uint32_t code;
};
constexpr std::array kFormats{
    Format{"BayerRG8", V4L2_PIX_FMT_SRGGB8},   Format{"BayerBG8", V4L2_PIX_FMT_SBGGR8},
    Format{"BayerGR8", V4L2_PIX_FMT_SGRBG8},   Format{"BayerGB8", V4L2_PIX_FMT_SGBRG8},
    Format{"BayerRG10", V4L2_PIX_FMT_SRGGB10}, Format{"BayerBG10", V4L2_PIX_FMT_SBGGR10},
    Format{"BayerGR10", V4L2_PIX_FMT_SGRBG10}, Format{"BayerGB10", V4L2_PIX_FMT_SGBRG10},
    Format{"BayerRG12", V4L2_PIX_FMT_SRGGB12}, Format{"BayerBG12", V4L2_PIX_FMT_SBGGR12},
    Format{"BayerGR12", V4L2_PIX_FMT_SGRBG12}, Format{"BayerGB12", V4L2_PIX_FMT_SGBRG12},
    Format{"BayerRG16", V4L2_PIX_FMT_SRGGB16}, Format{"BayerBG16", V4L2_PIX_FMT_SBGGR16},
    Format{"BayerGR16", V4L2_PIX_FMT_SGRBG16}, Format{"BayerGB16", V4L2_PIX_FMT_SGBRG16},
    Format{"RGB8", V4L2_PIX_FMT_RGB24},        Format{"BGR8", V4L2_PIX_FMT_BGR24},
    Format{"Mono8", V4L2_PIX_FMT_GREY},        Format{"Mono10", V4L2_PIX_FMT_Y10},
    Format{"Mono12", V4L2_PIX_FMT_Y12},        Format{"Mono16", V4L2_PIX_FMT_Y16},
    Format{"YUYV", V4L2_PIX_FMT_YUYV},         Format{"MJPG", V4L2_PIX_FMT_MJPEG},
};

/// Controls that are set, as found, to be put back.
constexpr std::array<std::uint32_t, 7> kControls{V4L2_CID_EXPOSURE_AUTO,
                                                 V4L2_CID_EXPOSURE_AUTO_PRIORITY,
                                                 V4L2_CID_AUTOGAIN,
                                                 V4L2_CID_AUTO_WHITE_BALANCE,
                                                 V4L2_CID_GAIN,
                                                 V4L2_CID_EXPOSURE_ABSOLUTE,
                                                 V4L2_CID_POWER_LINE_FREQUENCY};

class VideoCamera final : public CameraDevice {
 public:
  VideoCamera(const std::string& path, VideoKernel kernel);
  ~VideoCamera() override;

  const CameraInfo& info() const override { return info_; }
  CameraSettings configure(const CameraSettings& settings) override;
  void start() override;
  void stop() override;
  void trigger() override {
    throw StageError(info_.address + ": a Video4Linux camera has no software trigger");
  }
  std::optional<CameraFrame> next(Seconds patience) override;
  std::string trouble() const override { return trouble_; }

 private:
  struct Mapped {
    void* memory = nullptr;
    std::size_t length = 0;
  };
  template <typename T>
  bool control(unsigned long request, T& argument) {
    return kernel_.control(file_, request, &argument) == 0;
  }
  [[nodiscard]] std::optional<std::int32_t> get(std::uint32_t id) {
    v4l2_control value{id, 0};
    return control(VIDIOC_G_CTRL, value) ? std::optional(value.value) : std::nullopt;
  }
  bool set(std::uint32_t id, std::int32_t wanted) {
    v4l2_control value{id, wanted};
    return control(VIDIOC_S_CTRL, value);
  }
  [[nodiscard]] std::vector<std::uint32_t> offered_formats();
  void start_stream();
  void choose_format(const CameraSettings& settings, CameraSettings& result);
  void choose_exposure(const CameraSettings& settings, CameraSettings& result);
  void choose_rate(const CameraSettings& settings, CameraSettings& result);
  [[nodiscard]] cv::Mat picture_of(const v4l2_buffer& buffer) const;

  VideoKernel kernel_;
  CameraInfo info_;
  int file_ = -1;
  std::vector<std::pair<std::uint32_t, std::int32_t>> found_;
  std::vector<Mapped> buffers_;
  v4l2_pix_format format_{};
  std::string trouble_;
  bool running_ = false;
};

VideoCamera::VideoCamera(const std::string& path, VideoKernel kernel) : kernel_(std::move(kernel)) {
  info_.address = "v4l2:" + path;
  file_ = kernel_.open(path);
  if (file_ < 0) throw StageError(path + " cannot be opened: " + std::strerror(errno));
  v4l2_capability capability{};
  const bool answers = control(VIDIOC_QUERYCAP, capability);
  const std::uint32_t can = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                                ? capability.device_caps
                                : capability.capabilities;
  if (!answers || (can & V4L2_CAP_VIDEO_CAPTURE) == 0 || (can & V4L2_CAP_STREAMING) == 0) {
    kernel_.close(file_);
    throw StageError(path + " is no camera");
  }
  info_.model = reinterpret_cast<const char*>(capability.card);
  info_.serial = reinterpret_cast<const char*>(capability.bus_info);
  for (const std::uint32_t id : kControls)
    if (const auto value = get(id)) found_.emplace_back(id, *value);
}

VideoCamera::~VideoCamera() {
  stop();
  // Values before the automatics that would change them.
  for (auto it = found_.rbegin(); it != found_.rend(); ++it) set(it->first, it->second);
  kernel_.close(file_);
}

std::vector<std::uint32_t> VideoCamera::offered_formats() {
  std::vector<std::uint32_t> codes;
  for (std::uint32_t i = 0;; ++i) {
    v4l2_fmtdesc description{};
    description.index = i;
    description.type = kStream;
    if (!control(VIDIOC_ENUM_FMT, description)) return codes;
    codes.push_back(description.pixelformat);
  }
}

void VideoCamera::choose_format(const CameraSettings& settings, CameraSettings& result) {
  const auto offered = offered_formats();
  std::string names;
  const Format* chosen = nullptr;
  for (const Format& format : kFormats) {
    if (std::find(offered.begin(), offered.end(), format.code) == offered.end()) continue;
    add_name(names, format.name);
    const bool wanted = !settings.pixel_format || *settings.pixel_format == format.name;
    if (wanted && chosen == nullptr) chosen = &format;
  }
  if (chosen == nullptr)
    throw InputError(info_.address, "pixel_format", settings.pixel_format.value_or(""),
                     "must be one that the camera offers: " + (names.empty() ? "none" : names));
  v4l2_format format{};
  format.type = kStream;
  control(VIDIOC_G_FMT, format);
  if (settings.width > 0) format.fmt.pix.width = static_cast<std::uint32_t>(settings.width);
  if (settings.height > 0) format.fmt.pix.height = static_cast<std::uint32_t>(settings.height);
  format.fmt.pix.pixelformat = chosen->code;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  if (!control(VIDIOC_S_FMT, format))
    throw StageError(info_.address + ": the format cannot be set: " + std::strerror(errno));
  format_ = format.fmt.pix;
  result.width = static_cast<int>(format_.width);
  result.height = static_cast<int>(format_.height);
  result.pixel_format = chosen->name;
  if (format_.pixelformat != chosen->code ||
      (settings.width > 0 && (result.width != settings.width || result.height != settings.height)))
    throw InputError(info_.address, "size", size_text(result.width, result.height),
                     "must be " + size_text(settings.width, settings.height) +
                         ", that of the rig: the camera offers " + "no other in " + chosen->name);
}

void VideoCamera::choose_exposure(const CameraSettings& settings, CameraSettings& result) {
  constexpr double kStepUs = 100;  // of V4L2_CID_EXPOSURE_ABSOLUTE
  set(V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL);
  set(V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0);
  set(V4L2_CID_AUTOGAIN, 0);
  set(V4L2_CID_AUTO_WHITE_BALANCE, 0);
  set(V4L2_CID_POWER_LINE_FREQUENCY, V4L2_CID_POWER_LINE_FREQUENCY_DISABLED);
  if (settings.exposure_us &&
      !set(V4L2_CID_EXPOSURE_ABSOLUTE,
           std::max(1, static_cast<int>(std::lround(*settings.exposure_us / kStepUs)))))
    throw InputError(info_.address, "exposure", std::to_string(*settings.exposure_us) + " us",
                     "the camera does not take it");
  if (settings.gain && !set(V4L2_CID_GAIN, static_cast<int>(std::lround(*settings.gain))))
    throw InputError(info_.address, "gain", std::to_string(*settings.gain),
                     "the camera does not take it");
  if (const auto steps = get(V4L2_CID_EXPOSURE_ABSOLUTE)) result.exposure_us = kStepUs * *steps;
  if (const auto gain = get(V4L2_CID_GAIN)) result.gain = *gain;
}

void VideoCamera::choose_rate(const CameraSettings& settings, CameraSettings& result) {
  if (!settings.rate_hz) return;
  v4l2_streamparm parameters{};
  parameters.type = kStream;
  parameters.parm.capture.timeperframe = {
      1000, static_cast<std::uint32_t>(std::lround(1000 * *settings.rate_hz))};
  if (!control(VIDIOC_S_PARM, parameters)) return;
  const v4l2_fract& period = parameters.parm.capture.timeperframe;
  if (period.numerator > 0)
    result.rate_hz = static_cast<double>(period.denominator) / period.numerator;
}

CameraSettings VideoCamera::configure(const CameraSettings& settings) {
  if (settings.trigger != Trigger::kFree)
    throw InputError(info_.address, "trigger", to_string(settings.trigger),
                     "must be free: Video4Linux knows no triggers");
  CameraSettings result = settings;
  choose_format(settings, result);
  choose_exposure(settings, result);
  choose_rate(settings, result);
  return result;
}

void VideoCamera::start() {
  if (running_) return;
  try {
    start_stream();
  } catch (...) {
    stop();  // buffers that it has already
    throw;
  }
  running_ = true;
}

void VideoCamera::start_stream() {
  v4l2_requestbuffers request{};
  request.count = kBuffers;
  request.type = kStream;
  request.memory = V4L2_MEMORY_MMAP;
  if (!control(VIDIOC_REQBUFS, request) || request.count < 2)
    throw StageError(info_.address +
                     ": no buffers (is it used by another program?): " + std::strerror(errno));
  for (std::uint32_t i = 0; i < request.count; ++i) {
    v4l2_buffer buffer{};
    buffer.type = kStream;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = i;
    if (!control(VIDIOC_QUERYBUF, buffer)) throw StageError(info_.address + ": no buffer");
    buffers_.push_back({kernel_.map(file_, buffer.length, buffer.m.offset), buffer.length});
    if (buffers_.back().memory == nullptr || !control(VIDIOC_QBUF, buffer))
      throw StageError(info_.address + ": no memory for pictures");
  }
  int type = static_cast<int>(kStream);
  if (!control(VIDIOC_STREAMON, type))
    throw StageError(info_.address + ": it does not start: " + std::strerror(errno));
}

void VideoCamera::stop() {
  if (running_) {
    int type = static_cast<int>(kStream);
    control(VIDIOC_STREAMOFF, type);
    running_ = false;
  }
  for (const Mapped& mapped : buffers_)
    if (mapped.memory != nullptr) kernel_.unmap(mapped.memory, mapped.length);
  buffers_.clear();
  v4l2_requestbuffers none{};
  none.type = kStream;
  none.memory = V4L2_MEMORY_MMAP;
  control(VIDIOC_REQBUFS, none);
}

cv::Mat VideoCamera::picture_of(const v4l2_buffer& buffer) const {
  const Mapped& mapped = buffers_[buffer.index];
  const std::size_t used = std::min<std::size_t>(buffer.bytesused, mapped.length);
  const int width = static_cast<int>(format_.width);
  const int height = static_cast<int>(format_.height);
  if (format_.pixelformat == V4L2_PIX_FMT_MJPEG) {
    cv::Mat picture =
        decoded_picture({static_cast<const char*>(mapped.memory), used}, cv::IMREAD_COLOR);
    return picture.cols == width && picture.rows == height ? picture : cv::Mat();
  }
  if (format_.pixelformat == V4L2_PIX_FMT_YUYV) {
    const std::size_t stride = format_.bytesperline > 0 ? format_.bytesperline : 2U * format_.width;
    if (used < stride * format_.height) return {};
    cv::Mat picture;
    cv::cvtColor(cv::Mat(height, width, CV_8UC2, mapped.memory, stride), picture,
                 cv::COLOR_YUV2RGB_YUYV);
    return picture;
  }
  for (const Format& format : kFormats)
    if (format.code == format_.pixelformat)
      return picture_from_bytes(mapped.memory, used, width, height,
                                *layout_from_genicam(format.name), format_.bytesperline);
  return {};
}

std::optional<CameraFrame> VideoCamera::next(Seconds patience) {
  if (!running_ || !kernel_.wait(file_, patience)) return std::nullopt;
  v4l2_buffer buffer{};
  buffer.type = kStream;
  buffer.memory = V4L2_MEMORY_MMAP;
  if (!control(VIDIOC_DQBUF, buffer)) {
    if (errno == ENODEV)
      trouble_ = "the camera was unplugged";
    else if (errno != EAGAIN)
      trouble_ = std::string("it gives no picture: ") + std::strerror(errno);
    return std::nullopt;
  }
  trouble_.clear();
  CameraFrame frame;
  frame.arrival_ns = host_now_ns();
  frame.number = buffer.sequence;
  const bool monotonic =
      (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  if (monotonic)
    frame.timestamp_ns =
        1'000'000'000LL * buffer.timestamp.tv_sec + 1'000LL * buffer.timestamp.tv_usec;
  if ((buffer.flags & V4L2_BUF_FLAG_ERROR) != 0) {
    frame.status = PictureStatus::kLostPackets;
  } else {
    frame.image = picture_of(buffer);
    if (frame.image.empty()) frame.status = PictureStatus::kWrongSize;
    for (const Format& format : kFormats)
      if (format.code == format_.pixelformat)
        if (const auto layout = layout_from_genicam(format.name)) frame.mosaic = layout->mosaic;
  }
  control(VIDIOC_QBUF, buffer);
  return frame;
}

}  // namespace

std::vector<CameraInfo> list_v4l2_cameras() {
  namespace fs = std::filesystem;
  std::vector<CameraInfo> cameras;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator("/dev", ignored)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("video")) continue;
    try {
      cameras.push_back(VideoCamera(entry.path().string(), video_kernel()).info());
    } catch (const StageError&) {  // an output, a decoder, or somebody else's
    }
  }
  std::sort(cameras.begin(), cameras.end(),
            [](const CameraInfo& a, const CameraInfo& b) { return a.address < b.address; });
  return cameras;
}

std::unique_ptr<CameraDevice> open_v4l2_camera(const std::string& path, const VideoKernel& kernel) {
  return std::make_unique<VideoCamera>(path, kernel);
}

}  // namespace pencilscan
