#include "pencilscan/capture/gathering.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/check.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

constexpr double kNsPerSecond = 1e9;
constexpr double kSilence = 2;  ///< s; GigE cameras call a host lost after three
/// A crystal is good to 100 ppm; three of those is another clock than the camera says.
constexpr double kOddDriftPpm = 300;
/// Incomplete pictures of a camera that are remembered for sets to come.
constexpr std::size_t kRememberedLosses = 16;
/// Share of a new difference that a camera's shift takes over: sixteen pictures average the jitter.
constexpr double kShiftGain = 1.0 / 16;

}  // namespace

bool GatheredFrame::whole() const {
  return in_time && std::all_of(frames.begin(), frames.end(),
                                [](const auto& frame) { return frame.has_value(); });
}

FrameGathering::FrameGathering(GatheringOptions options, std::vector<ClockFit> clocks)
    : options_(std::move(options)),
      period_ns_(static_cast<std::int64_t>(kNsPerSecond / options_.rate_hz)),
      clocks_(std::move(clocks)),
      tallies_(options_.cameras.size()),
      last_number_(options_.cameras.size(), -1),
      last_whole_(options_.cameras.size()),
      losses_(options_.cameras.size()),
      start_ns_(options_.cameras.size(), -1),
      shift_ns_(options_.cameras.size(), 0) {
  PENCILSCAN_CHECK(options_.rate_hz > 0 && !options_.cameras.empty());
  clocks_.resize(options_.cameras.size());
}

std::int64_t FrameGathering::time_of(std::size_t camera, const CameraFrame& frame) const {
  if (frame.timestamp_ns < 0) return frame.arrival_ns;
  // One clock for all: which camera's offset to the host is taken does not matter, so the first's.
  const ClockFit& clock = clocks_[options_.one_clock ? 0 : camera];
  const std::int64_t time =
      clock.known() ? clock.host_from_camera(frame.timestamp_ns) : frame.arrival_ns;
  return time + std::llround(shift_ns_[camera]);
}

FrameGathering::Open& FrameGathering::place_for(std::size_t camera, std::int64_t time_ns) {
  Open* nearest = nullptr;
  for (Open& open : open_) {
    if (options_.still_s > 0) {
      const auto apart = static_cast<double>(std::abs(time_ns - open.time_ns)) / kNsPerSecond;
      if (open.heard[camera] == 0 && apart < options_.still_s) return open;
      continue;
    }
    if (!together(time_ns, open.time_ns) || open.heard[camera] != 0) continue;
    if (nearest == nullptr ||
        std::abs(time_ns - open.time_ns) < std::abs(time_ns - nearest->time_ns))
      nearest = &open;
  }
  if (nearest != nullptr) return *nearest;
  const auto after = std::find_if(open_.begin(), open_.end(),
                                  [&](const Open& open) { return open.time_ns > time_ns; });
  const std::size_t count = options_.cameras.size();
  Open fresh;
  fresh.time_ns = time_ns;
  fresh.set.frames.resize(count);
  fresh.set.missing.resize(count);
  fresh.times.assign(count, -1);
  fresh.heard.assign(count, 0);
  for (std::size_t c = 0; c < count; ++c) {
    auto& losses = losses_[c];
    const auto loss = std::find_if(losses.begin(), losses.end(), [&](const Loss& entry) {
      return together(entry.time_ns, time_ns);
    });
    if (loss == losses.end()) continue;
    fresh.heard[c] = 1;
    fresh.set.missing[c] = loss->why;
    losses.erase(loss);
  }
  return *open_.insert(after, std::move(fresh));
}

void FrameGathering::align_to_trigger(std::size_t camera, std::int64_t time_ns) {
  // The first camera of a set that has a time stamp stands for the moment of the trigger.
  for (const Open& open : open_) {
    if (open.times[camera] != time_ns) continue;
    for (std::size_t c = 0; c < camera; ++c) {
      if (open.times[c] < 0) continue;
      shift_ns_[camera] -= kShiftGain * static_cast<double>(time_ns - open.times[c]);
      return;
    }
  }
}

void FrameGathering::add(std::size_t camera, CameraFrame frame) {
  CameraTally& tally = tallies_[camera];
  tally.last_ns = frame.arrival_ns;
  if (first_add_ns_ < 0) first_add_ns_ = frame.arrival_ns;
  if (frame.number >= 0) {
    const std::int64_t before = last_number_[camera];
    // Sixteen-bit counts of GigE Vision start anew at 1: a step back is no loss.
    if (before >= 0 && frame.number > before + 1 && frame.number - before < 1000)
      tally.skipped += static_cast<std::size_t>(frame.number - before - 1);
    last_number_[camera] = frame.number;
  }
  if (frame.status != PictureStatus::kComplete) {
    ++tally.incomplete;
    if (std::string trouble = trouble_of(frame); !trouble.empty()) {
      ++tally.unusable;
      tally.trouble = std::move(trouble);
    }
    return add_incomplete(camera, frame);
  }
  ++tally.pictures;
  if (frame.timestamp_ns >= 0) clocks_[camera].add(frame.timestamp_ns, frame.arrival_ns);
  const std::int64_t time = time_of(camera, frame);
  last_whole_[camera] = {frame.number, time};
  if (given_until_ns_ != INT64_MIN && time < given_until_ns_ - period_ns_ / 2) {
    ++tally.late;
    return;
  }
  Open& open = place_for(camera, time);
  open.heard[camera] = 1;
  open.times[camera] = time;
  open.set.frames[camera] = std::move(frame);
  if (options_.one_trigger) align_to_trigger(camera, time);
}

/// An incomplete picture has no time; its number tells which one is missing. It makes no set: no
/// other camera may have one.
void FrameGathering::add_incomplete(std::size_t camera, const CameraFrame& frame) {
  const Mark& mark = last_whole_[camera];
  if (mark.number < 0 || frame.number < 0) return;
  // GigE Vision numbers frames from 1 to 65535, and begins anew.
  constexpr std::int64_t kNumbers = 65535;
  std::int64_t ahead = frame.number - mark.number;
  if (ahead < 0) ahead += kNumbers;
  const std::int64_t time = mark.time_ns + ahead * period_ns_;
  const std::string why = frame.remark.empty() ? to_string(frame.status) : frame.remark;
  for (Open& open : open_) {
    if (!together(time, open.time_ns) || open.heard[camera] != 0) continue;
    open.heard[camera] = 1;
    open.set.missing[camera] = why;
    return;
  }
  losses_[camera].push_back({time, why});
  if (losses_[camera].size() > kRememberedLosses) losses_[camera].pop_front();
}

bool FrameGathering::complete(const Open& open) const {
  return std::all_of(open.heard.begin(), open.heard.end(), [](char heard) { return heard != 0; });
}

GatheredFrame FrameGathering::close(Open&& open) {
  GatheredFrame set = std::move(open.set);
  std::int64_t first = INT64_MAX;
  std::int64_t last = INT64_MIN;
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t c = 0; c < set.frames.size(); ++c) {
    if (!set.frames[c]) {
      if (set.missing[c].empty()) set.missing[c] = "no picture came";
      continue;
    }
    first = std::min(first, open.times[c]);
    last = std::max(last, open.times[c]);
    sum += static_cast<double>(open.times[c] - open.time_ns);
    ++count;
  }
  set.time_ns = open.time_ns;
  given_until_ns_ = std::max(given_until_ns_, open.time_ns);
  if (count == 0) return set;
  set.time_ns += std::llround(sum / static_cast<double>(count));
  set.spread_ms = static_cast<double>(last - first) / 1e6;
  set.in_time = options_.max_spread_ms <= 0 || set.spread_ms <= options_.max_spread_ms;
  spreads_ms_.push_back(set.spread_ms);
  if (!set.in_time) ++beyond_;
  return set;
}

std::vector<GatheredFrame> FrameGathering::take(std::int64_t now_ns) {
  std::vector<GatheredFrame> ready;
  const auto patience = static_cast<std::int64_t>(options_.patience_s * kNsPerSecond);
  while (!open_.empty() &&
         (complete(open_.front()) || now_ns - open_.front().time_ns > patience + period_ns_)) {
    Open open = std::move(open_.front());
    open_.pop_front();
    ready.push_back(close(std::move(open)));
  }
  return ready;
}

FrameGathering::Spread FrameGathering::spread() const {
  Spread result;
  result.sets = spreads_ms_.size();
  result.beyond = beyond_;
  if (spreads_ms_.empty()) return result;
  result.median_ms = upper_median(spreads_ms_);
  result.largest_ms = *std::max_element(spreads_ms_.begin(), spreads_ms_.end());
  return result;
}

std::vector<Fault> FrameGathering::faults(std::int64_t now_ns) const {
  std::vector<Fault> faults;
  const double silence_s = std::max({kSilence, 5 / options_.rate_hz, options_.still_s});
  for (std::size_t c = 0; c < tallies_.size(); ++c) {
    const CameraTally& tally = tallies_[c];
    const std::string& name = options_.cameras[c];
    const auto add = [&](const char* kind, const std::string& what, const std::string& advice) {
      faults.push_back({kind, name, what, advice});
    };
    const std::size_t heard = tally.pictures + tally.incomplete;
    const std::int64_t since = tally.last_ns >= 0 ? tally.last_ns : first_add_ns_;
    const double quiet_s = since < 0 ? 0 : static_cast<double>(now_ns - since) / kNsPerSecond;
    if (quiet_s > silence_s)
      add("dead",
          (heard == 0 ? "no picture at all"
                      : "no picture since " + formatted(quiet_s, "%.1f") + " s"),
          "check its power, its cable, its trigger; other programs that hold it");
    if (tally.unusable > 0)
      add("unusable",
          tally.trouble + " (" + std::to_string(tally.unusable) + " of " + std::to_string(heard) +
              " pictures)",
          "");
    if (const std::size_t lost = tally.incomplete - tally.unusable; lost > 0)
      add("lost_packets",
          std::to_string(lost) + " of " + std::to_string(heard) +
              " pictures arrived incomplete: packets were lost on the way",
          "larger packets (MTU 9000), larger receive buffers (sysctl net.core.rmem_max), a network "
          "card of its own, a lower frame rate");
    if (tally.skipped > 0)
      add("skipped",
          "the camera counted " + std::to_string(tally.skipped) + " pictures that never arrived",
          "as for lost packets; or its exposure is longer than the time between two pictures");
    if (tally.late > 0)
      add("late",
          std::to_string(tally.late) + " pictures arrived more than " +
              formatted(options_.patience_s + 1 / options_.rate_hz, "%.3g") + " s after their time",
          "a lower frame rate, fewer cameras per network card");
    if (const auto drift = clocks_[c].drift();
        drift && std::abs(drift->ppm) > kOddDriftPpm + 3 * drift->sigma_ppm)
      add("clock",
          "its clock runs " + formatted(std::abs(drift->ppm) / 1e4, "%.3g") + " % too " +
              (drift->ppm > 0 ? "fast" : "slow") + ", which no crystal does",
          "its time stamps are in other units than it says; update its firmware, or trigger by "
          "wire");
  }
  for (std::size_t c = 1; options_.one_clock && c < clocks_.size(); ++c) {
    if (!clocks_[c].known() || !clocks_[0].known()) continue;
    // Transfers of all cameras through one wire take turns, but never longer than a period.
    const auto apart = clocks_[c].offset_ns() - clocks_[0].offset_ns();
    if (std::abs(apart) <= period_ns_) continue;
    faults.push_back({"clock", options_.cameras[c],
                      "its clock and that of " + options_.cameras[0] + " are " +
                          formatted(std::abs(static_cast<double>(apart)) / kNsPerSecond, "%.3g") +
                          " s apart, though PTP is to make them one",
                      "look at PtpStatus of both: one has to be Master, the others Slave"});
  }
  if (beyond_ > 0) {
    const Spread all = spread();
    faults.push_back({"spread", "",
                      std::to_string(beyond_) + " of " + std::to_string(all.sets) +
                          " frames have pictures up to " + formatted(all.largest_ms, "%.3g") +
                          " ms apart (at most " + formatted(options_.max_spread_ms, "%.3g") +
                          " ms is asked)",
                      "trigger all cameras by one wire, or by PTP"});
  }
  return faults;
}

}  // namespace pencilscan
