#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

namespace pencilscan {

/// A GigE Vision camera that is a program: Aravis' fake one, with pictures of ours. It answers on a
/// network address of this computer as a real one would.
struct FakeCameraScript {
  std::string address;  ///< of an interface: "127.0.0.1"
  std::string serial;
  double lost_packets = 0;          ///< share of the packets that never arrive
  double clock_ppm = 0;             ///< by which its clock runs fast
  std::int64_t clock_start_ns = 0;  ///< added to its clock
  double phase_s = 0;               ///< by which it is behind others of the same frame rate
  /// Fills `picture` (of the size and the pixel format that the client chose: Mono8, BayerRG8,
  /// RGB8, Mono16) with an exposure that began at host_now_ns() = begin; it returns when this is
  /// over.
  std::function<void(cv::Mat& picture, std::uint32_t pixel_format, std::int64_t begin_ns,
                     double exposure_us, double gain)>
      expose;
};

class FakeCamera {
 public:
  /// StageError when the address is none, or taken.
  explicit FakeCamera(FakeCameraScript script);
  /// As if the cable were pulled.
  ~FakeCamera();
  FakeCamera(const FakeCamera&) = delete;
  FakeCamera& operator=(const FakeCamera&) = delete;

  void set_lost_packets(double share);
  void set_clock(double ppm);
  /// A pulse on its line: a picture, where the client asked for the trigger Line0.
  void pulse();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pencilscan
