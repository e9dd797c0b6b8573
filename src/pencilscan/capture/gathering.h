#pragma once

#include <cstdint>
#include <cstdlib>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/capture/camera_device.h"
#include "pencilscan/capture/clock_fit.h"
#include "pencilscan/core/fault.h"

namespace pencilscan {

struct GatheringOptions {
  std::vector<std::string> cameras;  ///< names, for the faults
  double rate_hz = 0;                ///< at which pictures are to come; > 0
  /// Pictures of a set may begin so far apart, ms; beyond, the set is no frame of a moving object.
  /// 0: any (still objects).
  double max_spread_ms = 0;
  /// All clocks are one (PTP), or only one camera has one: time stamps are compared as they are.
  bool one_clock = false;
  /// Every pulse of a wire takes one picture of every camera: pictures of a set are of one moment,
  /// and the offsets of clocks follow from that.
  bool one_trigger = false;
  double patience_s = 0.5;  ///< a picture that comes so long after its time is late, > 0
  /// Nothing moves: pictures up to so far apart make a set, s, in the order in which they come.
  /// 0: it moves.
  double still_s = 0;
};

/// One picture of every camera of about one moment.
struct GatheredFrame {
  std::int64_t time_ns = 0;                        ///< of the host's clock, mean over its pictures
  std::vector<std::optional<CameraFrame>> frames;  ///< per camera; only complete pictures
  std::vector<std::string> missing;                ///< per camera: why there is none; else empty
  double spread_ms = 0;              ///< from the first to the last beginning of an exposure
  bool in_time = true;               ///< spread within the limit
  [[nodiscard]] bool whole() const;  ///< all pictures are there, in time
};

/// What became of a camera's pictures.
struct CameraTally {
  std::size_t pictures = 0;    ///< complete ones
  std::size_t incomplete = 0;  ///< lost packets and the like
  std::size_t unusable = 0;    ///< of the incomplete: for other reasons than packets
  std::string trouble;         ///< trouble_of() the last of those
  std::size_t skipped = 0;     ///< that the camera counted and nobody saw
  std::size_t late = 0;        ///< after their set was given out
  std::int64_t last_ns = -1;   ///< arrival of the last one, whole or not
};

/// Puts pictures of several cameras together by time.
///
/// Never by number: cameras start to count at different times. The time of a picture is its time
/// stamp on the host's clock (ClockFit); one without a time stamp counts from its arrival. A set
/// takes what lies within half a period of its first picture; the oldest set takes it where nothing
/// moves. A set is given out, in order of time, when every camera has a picture in it or its time
/// is over.
class FrameGathering {
 public:
  /// `clocks`: what is known of the cameras' clocks already; empty: nothing.
  explicit FrameGathering(GatheringOptions options, std::vector<ClockFit> clocks = {});

  [[nodiscard]] const GatheringOptions& options() const { return options_; }
  void add(std::size_t camera, CameraFrame frame);
  /// Sets that are ready at this time (host_now_ns()).
  [[nodiscard]] std::vector<GatheredFrame> take(std::int64_t now_ns);

  [[nodiscard]] const std::vector<CameraTally>& tallies() const { return tallies_; }
  [[nodiscard]] const ClockFit& clock(std::size_t camera) const { return clocks_[camera]; }
  /// The host's time of a picture.
  [[nodiscard]] std::int64_t time_of(std::size_t camera, const CameraFrame& frame) const;
  /// What is wrong so far:
  ///   dead: no picture for two seconds, or five periods
  ///   lost_packets, skipped, late: pictures that are not there, or came too late
  ///   unusable: pictures that came, and are none for other reasons
  ///   spread: sets whose pictures lie too far apart
  ///   clock: a camera's clock that no crystal explains, or that jumps
  [[nodiscard]] std::vector<Fault> faults(std::int64_t now_ns) const;
  /// Spreads of the sets given out so far: median and largest, ms.
  struct Spread {
    double median_ms = 0;
    double largest_ms = 0;
    std::size_t sets = 0;
    std::size_t beyond = 0;  ///< the limit
  };
  [[nodiscard]] Spread spread() const;

 private:
  struct Open {
    std::int64_t time_ns = 0;  ///< of its first picture
    GatheredFrame set;
    std::vector<std::int64_t> times;  ///< per camera; -1: none yet
    std::vector<char> heard;          ///< per camera: a picture, whole or not
  };
  [[nodiscard]] bool complete(const Open& open) const;
  void add_incomplete(std::size_t camera, const CameraFrame& frame);
  [[nodiscard]] bool together(std::int64_t a_ns, std::int64_t b_ns) const {
    return 2 * std::abs(a_ns - b_ns) < period_ns_;
  }
  [[nodiscard]] GatheredFrame close(Open&& open);
  Open& place_for(std::size_t camera, std::int64_t time_ns);
  void align_to_trigger(std::size_t camera, std::int64_t time_ns);

  GatheringOptions options_;
  std::int64_t period_ns_;
  std::vector<ClockFit> clocks_;
  std::vector<CameraTally> tallies_;
  std::vector<std::int64_t> last_number_;
  struct Mark {
    std::int64_t number = -1;
    std::int64_t time_ns = 0;
  };
  std::vector<Mark> last_whole_;  ///< per camera: tells when one without a time was taken
  struct Loss {
    std::int64_t time_ns = 0;
    std::string why;
  };
  std::vector<std::deque<Loss>> losses_;  ///< per camera: incomplete pictures without a set so far
  std::vector<std::int64_t> start_ns_;    ///< first heard of anything
  std::vector<double> shift_ns_;          ///< with one trigger: what to add to a camera's times
  std::deque<Open> open_;                 ///< by time
  std::int64_t given_until_ns_ = INT64_MIN;
  std::vector<double> spreads_ms_;
  std::size_t beyond_ = 0;
  std::int64_t first_add_ns_ = -1;
};

}  // namespace pencilscan
