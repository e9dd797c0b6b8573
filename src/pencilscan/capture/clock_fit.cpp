#include "pencilscan/capture/clock_fit.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {
namespace {

constexpr std::int64_t kBlockNs = 500'000'000;  ///< some pictures each
constexpr std::size_t kBlocks = 120;            ///< a minute: temperature moves a crystal slower
constexpr std::size_t kLeastClockBlocks = 4;    ///< for a line
/// Least arrivals of blocks differ by less: a picture of each would have to wait a whole block.
constexpr std::int64_t kMostWaitNs = kBlockNs;
constexpr double kMostDrift = 1e-3;                 ///< ten times what crystals are sold with
constexpr std::int64_t kLeastSpan = 3'000'000'000;  ///< ns: jitter of 1 ms is then 300 ppm at most

}  // namespace

void ClockFit::add(std::int64_t timestamp_ns, std::int64_t arrival_ns) {
  const std::int64_t offset = arrival_ns - timestamp_ns;
  if (!blocks_.empty() && was_set(timestamp_ns, offset)) {
    blocks_.clear();
    line_.reset();
  }
  if (blocks_.empty() || timestamp_ns - blocks_.back().begin_ns >= kBlockNs) {
    fit();  // of whole blocks
    blocks_.push_back({timestamp_ns, timestamp_ns, offset});
    if (blocks_.size() > kBlocks) blocks_.pop_front();
  } else if (offset < blocks_.back().offset_ns) {
    blocks_.back().timestamp_ns = timestamp_ns;
    blocks_.back().offset_ns = offset;
  }
}

/// A clock that was set anew tells nothing about the time before: back, or so far on that pictures
/// would now arrive before they could.
bool ClockFit::was_set(std::int64_t timestamp_ns, std::int64_t offset_ns) const {
  const Block& last = blocks_.back();
  if (timestamp_ns < last.begin_ns) return true;
  const double drift = kMostDrift * static_cast<double>(timestamp_ns - last.timestamp_ns);
  return static_cast<double>(last.offset_ns) - static_cast<double>(offset_ns) >
         static_cast<double>(kMostWaitNs) + std::max(0.0, drift);
}

void ClockFit::fit() {
  line_.reset();
  if (blocks_.size() < kLeastClockBlocks) return;
  const double first = static_cast<double>(blocks_.front().timestamp_ns);
  const double base = static_cast<double>(blocks_.front().offset_ns);
  const double count = static_cast<double>(blocks_.size());
  double mean_x = 0;
  double mean_y = 0;
  for (const Block& block : blocks_) {
    mean_x += (static_cast<double>(block.timestamp_ns) - first) / count;
    mean_y += (static_cast<double>(block.offset_ns) - base) / count;
  }
  double xx = 0;
  double xy = 0;
  for (const Block& block : blocks_) {
    const double x = static_cast<double>(block.timestamp_ns) - first - mean_x;
    xx += x * x;
    xy += x * (static_cast<double>(block.offset_ns) - base - mean_y);
  }
  Line line;
  line.origin_ns = first + mean_x;
  line.offset_ns = base + mean_y;
  line.slope = xy / xx;
  double square = 0;
  for (const Block& block : blocks_) {
    const double x = static_cast<double>(block.timestamp_ns) - line.origin_ns;
    const double error = static_cast<double>(block.offset_ns) - line.offset_ns - line.slope * x;
    square += error * error;
  }
  line.slope_sigma = std::sqrt(square / (count - 2) / xx);
  line_ = line;
}

std::int64_t ClockFit::host_from_camera(std::int64_t timestamp_ns) const {
  if (line_) {
    const double x = static_cast<double>(timestamp_ns) - line_->origin_ns;
    return timestamp_ns + std::llround(line_->offset_ns + line_->slope * x);
  }
  std::int64_t least = blocks_.empty() ? 0 : blocks_.front().offset_ns;
  for (const Block& block : blocks_) least = std::min(least, block.offset_ns);
  return timestamp_ns + least;
}

std::int64_t ClockFit::offset_ns() const {
  if (blocks_.empty()) return 0;
  const std::int64_t latest = blocks_.back().timestamp_ns;
  return host_from_camera(latest) - latest;
}

std::optional<ClockFit::Drift> ClockFit::drift() const {
  if (!line_ || blocks_.back().timestamp_ns - blocks_.front().timestamp_ns < kLeastSpan)
    return std::nullopt;
  // arrival - timestamp grows where the camera's clock is slow.
  return Drift{-1e6 * line_->slope, 1e6 * line_->slope_sigma};
}

}  // namespace pencilscan
