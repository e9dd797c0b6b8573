#pragma once

#include <cstdint>
#include <deque>
#include <optional>

namespace pencilscan {

/// A camera's clock on the host's. A picture arrives some time after its exposure: at least
/// exposure and transfer, often more. The pictures that arrived soonest show the offset of the
/// clocks, up to that least delay, which is the same for every picture; how this changes with time
/// shows whether one runs faster.
///
/// For every block of time the least arrival - timestamp is kept; with four blocks and more, a line
/// through those (least squares) is the offset, before that their least.
class ClockFit {
 public:
  void add(std::int64_t timestamp_ns, std::int64_t arrival_ns);
  [[nodiscard]] bool known() const { return !blocks_.empty(); }
  /// The host's time at which a picture of this time stamp arrives at the soonest.
  [[nodiscard]] std::int64_t host_from_camera(std::int64_t timestamp_ns) const;
  /// What the soonest arrival of the latest pictures adds to their time stamps.
  [[nodiscard]] std::int64_t offset_ns() const;
  /// How much faster than the host's the camera's clock runs, and one standard deviation of that
  /// (from the scatter of the blocks); nothing before three seconds.
  struct Drift {
    double ppm = 0;
    double sigma_ppm = 0;
  };
  [[nodiscard]] std::optional<Drift> drift() const;

 private:
  struct Block {
    std::int64_t begin_ns = 0;      ///< on the camera's clock
    std::int64_t timestamp_ns = 0;  ///< of the picture with the least delay
    std::int64_t offset_ns = 0;     ///< its arrival - timestamp
  };
  struct Line {
    double origin_ns = 0;  ///< camera's clock
    double offset_ns = 0;  ///< there
    double slope = 0;
    double slope_sigma = 0;
  };
  [[nodiscard]] bool was_set(std::int64_t timestamp_ns, std::int64_t offset_ns) const;
  void fit();
  std::deque<Block> blocks_;
  std::optional<Line> line_;
};

}  // namespace pencilscan
