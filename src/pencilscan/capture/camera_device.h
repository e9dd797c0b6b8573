#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace pencilscan {

using Seconds = std::chrono::duration<double>;

enum class PictureStatus {
  kComplete,
  kLostPackets,  ///< a part of the picture did not arrive
  kAborted,      ///< the camera or the driver gave it up
  kWrongSize,    ///< not the size or the pixel format that was agreed
  kUnreadable,   ///< a file that is no picture, a program that failed
};
[[nodiscard]] std::string to_string(PictureStatus status);
struct CameraFrame;
/// Why it is not complete, as a sentence on its camera; empty for packets that got lost.
[[nodiscard]] std::string trouble_of(const CameraFrame& frame);

/// One picture of one camera, or the news that there is none.
struct CameraFrame {
  PictureStatus status = PictureStatus::kComplete;
  /// As the sensor gave it: 8U or 16U (full range), one channel or three (RGB). Empty unless
  /// complete.
  cv::Mat image;
  std::string mosaic;              ///< "RGGB" and so on: one channel, colours in turn; empty: none
  std::int64_t timestamp_ns = -1;  ///< of the camera's own clock; -1: it has none
  std::int64_t arrival_ns = 0;  ///< host_now_ns() when it began to arrive, as far as that is known
  std::int64_t number = -1;     ///< the camera's count of its pictures; -1: it has none
  std::string remark;           ///< why it is not complete, where the back end knows more
};

/// What a camera is, before it is opened.
struct CameraInfo {
  std::string address;  ///< "aravis:Basler-23456789", "v4l2:/dev/video0", "folder:shots"
  std::string model;
  std::string serial;
  /// Its pictures are files that somebody else makes, when he likes: no network loses them.
  bool of_files = false;
};

enum class Trigger {
  kFree,      ///< pictures at the camera's own pace
  kSoftware,  ///< a picture for every call of trigger()
  kWire,      ///< a picture for every pulse on a line of the camera
  kPtp,       ///< at its own pace, all clocks one by the Precision Time Protocol
};
[[nodiscard]] std::optional<Trigger> trigger_from_text(const std::string& text);
[[nodiscard]] std::string to_string(Trigger trigger);

/// Exposures above are a slip: projectors are seen in a fiftieth of a second, and whoever looks at
/// the page waits for the picture.
inline constexpr double kLongestExposureMs = 10'000;

/// What is asked of a camera; what is not stated stays as it is.
struct CameraSettings {
  int width = 0;   ///< px; 0: as it is
  int height = 0;  ///< px
  std::optional<double> exposure_us;
  std::optional<double> gain;               ///< in the camera's own unit, most often dB
  std::optional<double> rate_hz;            ///< of free running cameras
  std::optional<std::string> pixel_format;  ///< as the camera names it: "BayerRG8", "Mono8"
  Trigger trigger = Trigger::kFree;
  std::string line = "Line0";  ///< that the wire is on
};

/// A camera that was opened. One thread at a time. Closing it stops it and puts its settings back.
class CameraDevice {
 public:
  CameraDevice() = default;
  virtual ~CameraDevice() = default;
  CameraDevice(const CameraDevice&) = delete;
  CameraDevice& operator=(const CameraDevice&) = delete;

  [[nodiscard]] virtual const CameraInfo& info() const = 0;
  /// Not while it runs. What the camera made of the settings: it may round, or ignore what it does
  /// not have. InputError for what it refuses.
  virtual CameraSettings configure(const CameraSettings& settings) = 0;
  virtual void start() = 0;
  virtual void stop() = 0;
  /// Asks for a picture, where configure() said kSoftware.
  virtual void trigger() = 0;
  /// The next picture; nothing when none comes in time.
  [[nodiscard]] virtual std::optional<CameraFrame> next(Seconds patience) = 0;
  /// Empty while it can be reached; else what is wrong, in words.
  [[nodiscard]] virtual std::string trouble() const { return {}; }
};

}  // namespace pencilscan
