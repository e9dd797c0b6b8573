#include "pencilscan/capture/record.h"

#include <algorithm>
#include <mutex>
#include <thread>
#include <utility>

#include "pencilscan/capture/frame_writer.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/core/stopwatch.h"

namespace pencilscan {
namespace {

constexpr double kWatchInterval = 0.25;                    ///< s
constexpr double kLongestStart = 2;                        ///< s that cameras may take for those
constexpr double kLongestSilence = 5;                      ///< s without a picture of any camera
constexpr std::size_t kFirstPictures = 5;                  ///< of each camera, for its clock
constexpr auto kLookEvery = std::chrono::milliseconds(2);  ///< between looks at what came

/// One recording while it runs.
class Session {
 public:
  Session(LiveCameras& cameras, const Rig& rig, const std::filesystem::path& out,
          const RecordOptions& options)
      : cameras_(cameras),
        options_(options),
        gathering_(gathering_of(cameras.group(), options), cameras.clocks()),
        writer_(cameras.group(), rig, out, utc_minus_host_ns(), true),
        first_ns_(cameras.group().size(), -1),
        answered_(cameras.group().size(), 0),
        listener_(cameras, [this](std::size_t camera, CameraFrame frame) {
          const std::lock_guard lock(mutex_);
          arrived_.emplace_back(camera, std::move(frame));
        }) {
    report_.missing.assign(cameras.group().size(), 0);
    bool others_begin = !options.software_trigger;
    for (std::size_t c = 0; c < cameras.group().size(); ++c)
      others_begin = others_begin && cameras.group().info(c).of_files;
    if (others_begin) begin_ns_ = host_now_ns();
  }

  RecordReport run(const RecordWatch& watch);

 private:
  static GatheringOptions gathering_of(const CameraGroup& cameras, const RecordOptions& options);
  void collect();
  /// Every camera has sent something since the last pulse.
  [[nodiscard]] bool all_answered() const {
    return std::all_of(answered_.begin(), answered_.end(), [](char a) { return a != 0; });
  }
  [[nodiscard]] bool pulse_is_due() const;
  void pulse();
  void take_in(std::vector<GatheredFrame> frames);
  void note_faults();
  [[nodiscard]] bool enough() const {
    return options_.frames > 0 && report_.frames + report_.left_out >= options_.frames;
  }
  /// Nothing comes any more: waiting longer would be waiting for ever.
  [[nodiscard]] bool silent() const {
    const double limit = std::max({kLongestSilence, 20 / options_.rate_hz, options_.still_s});
    return last_heard_.seconds() > limit;
  }
  [[nodiscard]] double seconds() const {
    return begin_ns_ < 0 ? 0 : static_cast<double>(host_now_ns() - begin_ns_) / 1e9;
  }

  LiveCameras& cameras_;
  const RecordOptions& options_;
  RecordReport report_;
  FrameGathering gathering_;
  FrameWriter writer_;
  std::vector<std::int64_t> first_ns_;  ///< per camera, time of its first picture
  std::int64_t begin_ns_ = -1;          ///< frames before are not recorded
  std::int64_t end_ns_ = INT64_MAX;     ///< nor those after
  double next_pulse_s_ = 0;             ///< since the start
  Stopwatch since_pulse_;
  std::vector<char> answered_;  ///< per camera: a picture since then, whole or not
  Stopwatch since_start_;
  Stopwatch last_heard_;
  std::mutex mutex_;
  std::vector<std::pair<std::size_t, CameraFrame>> arrived_;
  LiveCameras::Listener listener_;  ///< last: it calls as soon as it is there
};

GatheringOptions Session::gathering_of(const CameraGroup& cameras, const RecordOptions& options) {
  GatheringOptions gathering;
  for (std::size_t c = 0; c < cameras.size(); ++c) gathering.cameras.push_back(cameras.name(c));
  gathering.rate_hz = options.rate_hz;
  gathering.max_spread_ms = options.max_spread_ms;
  gathering.one_clock = options.one_clock;
  // Where nothing moves, a set may hold pictures of several pulses.
  gathering.one_trigger = options.still_s <= 0 && (options.one_trigger || options.software_trigger);
  gathering.still_s = options.still_s;
  gathering.patience_s = std::max(gathering.patience_s, options.still_s);
  return gathering;
}

bool Session::pulse_is_due() const {
  if (!options_.software_trigger) return false;
  if (options_.still_s <= 0 || next_pulse_s_ == 0) return since_start_.seconds() >= next_pulse_s_;
  const double waited = since_pulse_.seconds();
  return (all_answered() && waited * options_.rate_hz >= 1) || waited >= options_.still_s;
}

void Session::pulse() {
  if (!pulse_is_due()) return;
  cameras_.group().trigger();
  // Pulses that a stall kept back are not made up: cameras would drop them, or crowd.
  const double period = 1 / options_.rate_hz;
  const double now = since_start_.seconds();
  next_pulse_s_ = (now - next_pulse_s_ < period ? next_pulse_s_ : now) + period;
  since_pulse_ = Stopwatch();
  std::fill(answered_.begin(), answered_.end(), 0);
}

void Session::collect() {
  std::vector<std::pair<std::size_t, CameraFrame>> arrived;
  {
    const std::lock_guard lock(mutex_);
    arrived = std::exchange(arrived_, {});
  }
  if (!arrived.empty()) last_heard_ = Stopwatch();
  for (auto& [camera, frame] : arrived) {
    const bool first = first_ns_[camera] < 0 && frame.status == PictureStatus::kComplete;
    if (first) first_ns_[camera] = frame.arrival_ns;
    answered_[camera] = 1;
    gathering_.add(camera, std::move(frame));
  }
  if (begin_ns_ >= 0) return;
  bool all = true;
  for (std::size_t c = 0; c < first_ns_.size(); ++c)
    all = all && first_ns_[c] >= 0 && cameras_.count(c).whole >= kFirstPictures;
  if (!all && since_start_.seconds() < kLongestStart) return;
  // From the next moment on every camera that lives has a picture.
  const auto period = static_cast<std::int64_t>(1e9 / options_.rate_hz);
  begin_ns_ =
      all ? *std::max_element(first_ns_.begin(), first_ns_.end()) + period / 2 : host_now_ns();
}

void Session::take_in(std::vector<GatheredFrame> frames) {
  for (GatheredFrame& frame : frames) {
    if (enough()) return;
    if (begin_ns_ < 0 || frame.time_ns < begin_ns_ || frame.time_ns > end_ns_) continue;
    const bool whole = frame.whole();
    for (std::size_t c = 0; c < frame.frames.size(); ++c)
      if (!frame.frames[c]) ++report_.missing[c];
    if (!whole && !options_.keep_partial) {
      ++report_.left_out;
      continue;
    }
    const std::size_t waiting = writer_.waiting();
    report_.most_waiting = std::max(report_.most_waiting, waiting);
    if (waiting >= options_.queue) {
      ++report_.disk_drops;
      continue;
    }
    FrameWriter::Item item;
    for (std::size_t c = 0; c < frame.frames.size(); ++c)
      item.times_ns.push_back(frame.frames[c] ? gathering_.time_of(c, *frame.frames[c]) : -1);
    item.frame = std::move(frame);
    writer_.add(std::move(item));
    ++report_.frames;
    if (whole) ++report_.whole;
  }
}

void Session::note_faults() {
  report_.tallies = gathering_.tallies();
  report_.spread = gathering_.spread();
  report_.faults = cameras_.group().faults();
  for (Fault& fault : gathering_.faults(host_now_ns())) {
    const bool said =
        std::any_of(report_.faults.begin(), report_.faults.end(), [&](const Fault& other) {
          return other.kind == fault.kind && other.device == fault.device;
        });
    if (!said) report_.faults.push_back(std::move(fault));
  }
  for (std::size_t c = 0; c < report_.missing.size(); ++c) {
    const CameraTally& tally = report_.tallies[c];
    const std::string& name = cameras_.group().name(c);
    const bool said = std::any_of(report_.faults.begin(), report_.faults.end(),
                                  [&](const Fault& fault) { return fault.device == name; });
    if (report_.missing[c] == 0 || said || tally.incomplete + tally.skipped + tally.late > 0)
      continue;
    report_.faults.push_back({"missing", name,
                              std::to_string(report_.missing[c]) + " of " +
                                  std::to_string(report_.frames + report_.left_out) +
                                  " frames have no picture of it, though none was lost",
                              options_.still_s > 0
                                  ? "where its pictures take longer, a longer \"patience_s\" in "
                                    "lab.json"
                                  : "its frame rate is lower than asked for, or its pictures come "
                                    "at uneven times"});
  }
  if (report_.disk_drops > 0)
    report_.faults.push_back(
        {"disk", "",
         std::to_string(report_.disk_drops) + " frames were lost: the disk did not keep up",
         "record to recording.zarr, to a faster disk, or fewer frames a second"});
}

RecordReport Session::run(const RecordWatch& watch) {
  double watched = 0;
  bool stopped = false;
  const auto turn = [&] {
    collect();
    if (begin_ns_ >= 0) take_in(gathering_.take(host_now_ns()));
    std::this_thread::sleep_for(kLookEvery);
  };
  while (!stopped && !enough() && !silent() &&
         !(options_.seconds > 0 && seconds() >= options_.seconds)) {
    pulse();
    turn();
    if (!watch || since_start_.seconds() - watched < kWatchInterval) continue;
    watched = since_start_.seconds();
    report_.seconds = seconds();
    note_faults();
    stopped = !watch(report_);
  }
  report_.seconds = seconds();
  // What began in time may still be on its way.
  end_ns_ = host_now_ns();
  const Stopwatch rest;
  const double patience = gathering_.options().patience_s;
  const bool still = options_.software_trigger && options_.still_s > 0;
  while (!enough() && rest.seconds() < patience && !(still && all_answered())) turn();
  take_in(gathering_.take(INT64_MAX / 2));
  note_faults();
  writer_.finish();
  return report_;
}

}  // namespace

RecordReport record(LiveCameras& cameras, const Rig& rig, const std::filesystem::path& out,
                    const RecordOptions& options, const RecordWatch& watch) {
  return Session(cameras, rig, out, options).run(watch);
}

}  // namespace pencilscan
