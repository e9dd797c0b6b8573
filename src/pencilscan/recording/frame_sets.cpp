#include "pencilscan/recording/frame_sets.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <tuple>
#include <utility>

#include "pencilscan/core/median.h"
#include "pencilscan/recording/camera_turns.h"
#include "pencilscan/recording/untimed_pictures.h"

namespace pencilscan {
namespace {

/// The known times of a camera in order of rows, after `origin`.
struct Track {
  std::vector<std::size_t> rows;
  std::vector<double> times;
};

/// Pictures over which a clock counts as steady: few enough for drift (100 ppm of 64 / 25 s is
/// 0.3 ms), enough for a median.
constexpr std::size_t kBlock = 64;
/// Lags that are tried where clocks do not share their start.
constexpr int kMaxLag = 100;

/// a - b, also of times whose difference no int64 holds.
double difference_ns(std::int64_t a, std::int64_t b) {
  const auto size = [](std::int64_t more, std::int64_t less) {
    return static_cast<double>(static_cast<std::uint64_t>(more) - static_cast<std::uint64_t>(less));
  };
  return a < b ? -size(b, a) : size(a, b);
}

Track track_of(const ShotTimes& camera, std::int64_t origin) {
  Track track;
  for (std::size_t row = 0; row < camera.times_ns.size(); ++row) {
    if (camera.times_ns[row] == kUnknownTime) continue;
    track.rows.push_back(row);
    track.times.push_back(difference_ns(camera.times_ns[row], origin));
  }
  return track;
}

double period_of(const Track& track) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < track.times.size(); ++i)
    steps.push_back(track.times[i] - track.times[i - 1]);
  return upper_median(std::move(steps));
}

/// The index of the sorted time nearest to t.
std::size_t nearest(const std::vector<double>& times, double t) {
  const auto after = std::lower_bound(times.begin(), times.end(), t);
  if (after == times.begin()) return 0;
  const auto i = static_cast<std::size_t>(after - times.begin());
  if (after == times.end()) return i - 1;
  return t - times[i - 1] <= times[i] - t ? i - 1 : i;
}

/// How many pictures of `other` meet one of `reference` when its clock is `shift` ahead, within a
/// quarter of a period: twice as near as belonging together asks for.
std::size_t meetings(const Track& reference, const Track& other, double shift, double period) {
  std::size_t count = 0;
  for (const double t : other.times) {
    const double at = t - shift;
    count += std::abs(reference.times[nearest(reference.times, at)] - at) < period / 4;
  }
  return count;
}

/// True when the two clocks seem to count from the same moment: they were recording at the same
/// time for most of the shorter one. Cameras start one after the other, but clocks that were never
/// set to each other lie hours apart.
bool share_start(const Track& reference, const Track& other, double period) {
  const double first = std::max(reference.times.front(), other.times.front());
  const double last = std::min(reference.times.back(), other.times.back());
  const double shorter = std::min(reference.times.back() - reference.times.front(),
                                  other.times.back() - other.times.front());
  return last - first > 0.5 * shorter - period;
}

double best_shift(const Track& reference, const Track& other, double period) {
  double best = 0;
  std::size_t most = 0;
  bool found = false;
  for (int k = 0; k <= 2 * kMaxLag; ++k) {
    const int lag = k % 2 == 0 ? -k / 2 : (k + 1) / 2;  // 0, 1, -1, 2, -2, ...
    std::vector<double> differences;
    for (std::size_t i = 0; i < reference.times.size(); ++i) {
      const auto j = static_cast<std::ptrdiff_t>(i) + lag;
      if (j < 0 || j >= static_cast<std::ptrdiff_t>(other.times.size())) continue;
      differences.push_back(other.times[static_cast<std::size_t>(j)] - reference.times[i]);
    }
    if (differences.empty()) continue;
    const double shift = upper_median(std::move(differences));
    const std::size_t count = meetings(reference, other, shift, period);
    if (found && count <= most) continue;
    found = true;
    most = count;
    best = shift;
  }
  return best;
}

/// The clock's lead over the reference at each picture of `other`, followed block by block from
/// `shift`.
std::vector<double> followed_lead(const Track& reference, const Track& other, double shift,
                                  double period) {
  std::vector<double> lead;
  double now = shift;
  for (std::size_t first = 0; first < other.times.size(); first += kBlock) {
    const std::size_t end = std::min(other.times.size(), first + kBlock);
    std::vector<double> leads;
    for (std::size_t i = first; i < end; ++i) {
      const double at = other.times[i] - now;
      const double t = reference.times[nearest(reference.times, at)];
      if (std::abs(t - at) < period / 2) leads.push_back(other.times[i] - t);
    }
    if (2 * leads.size() > end - first) now = upper_median(std::move(leads));
    lead.resize(end, now);
  }
  return lead;
}

/// Slope of the line through the first and the last block of a lead, ppm; blocks are steps.
double drift_ppm(const Track& track, const std::vector<double>& lead) {
  if (track.times.size() < 2 * kBlock) return 0;
  const double span = track.times.back() - track.times.front();
  return 1e6 * (lead.back() - lead.front()) / span;
}

/// When each camera begins its next picture after each shot; shots are in order of time.
std::vector<double> next_times(const std::vector<TimedShot>& shots, std::size_t cameras) {
  std::vector<double> next(cameras, std::numeric_limits<double>::infinity());
  std::vector<double> result(shots.size());
  for (std::size_t i = shots.size(); i-- > 0;) {
    result[i] = next[shots[i].camera];
    next[shots[i].camera] = shots[i].time_ns;
  }
  return result;
}

/// Where a set ends that the shot `end` does not fit into, of those from `first` on: before the
/// longest pause, so that a camera half a period late tears no others apart, unless the set has a
/// shot of the same camera.
std::size_t end_of_set(const std::vector<TimedShot>& shots, std::size_t first, std::size_t end) {
  std::size_t longest = end;
  const auto pause = [&](std::size_t at) { return shots[at].time_ns - shots[at - 1].time_ns; };
  for (std::size_t k = end; k-- > first;) {
    if (shots[k].camera == shots[end].camera) return end;
    if (k > first && pause(k) > pause(longest)) longest = k;
  }
  return longest;
}

/// How much longer a set waits for a shot in the middle between others: an eighth of a period, so
/// that one camera half a period late, a little more or less, is always of the moment before.
double slack_for(const std::vector<TimedShot>& shots, std::size_t i, double period) {
  const auto is_far = [&](std::size_t a, std::size_t b) {
    return shots[b].time_ns - shots[a].time_ns > period / 4;
  };
  const bool is_alone = (i == 0 || is_far(i - 1, i)) && (i + 1 == shots.size() || is_far(i, i + 1));
  return is_alone ? period / 8 : 0;
}

/// Shots in order of time fall into sets: a set ends where the next shot is half a period after its
/// first one, of a camera that it holds already, or nearer to the next picture of a camera of it.
std::vector<std::vector<TimedShot>> fall_into_sets(std::vector<TimedShot> shots,
                                                   std::size_t cameras, double period) {
  std::sort(shots.begin(), shots.end(), [](const TimedShot& a, const TimedShot& b) {
    return std::tie(a.time_ns, a.camera) < std::tie(b.time_ns, b.camera);
  });
  const std::vector<double> next = next_times(shots, cameras);
  std::vector<std::vector<TimedShot>> sets;
  std::size_t first = 0;
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const TimedShot& shot = shots[i];
    const double slack = slack_for(shots, i, period);
    bool fits = !sets.empty() && shot.time_ns - shots[first].time_ns < period / 2 + slack;
    for (std::size_t k = first; fits && k < i; ++k) {
      fits = shots[k].camera != shot.camera &&
             shot.time_ns - shots[k].time_ns <= next[k] - shot.time_ns + 2 * slack;
    }
    if (!fits && !sets.empty()) {
      const std::size_t end = end_of_set(shots, first, i);
      std::vector<TimedShot>& last = sets.back();
      std::vector<TimedShot> rest(last.begin() + static_cast<std::ptrdiff_t>(end - first),
                                  last.end());
      last.resize(end - first);
      sets.push_back(std::move(rest));
      first = end;
    } else if (!fits) {
      sets.emplace_back();
    }
    sets.back().push_back(shot);
  }
  return sets;
}

/// Median step from set to set, of two at a time: those of cameras that take turns need not be
/// even. `fallback` where there are fewer.
double period_of_sets(const std::vector<std::vector<TimedShot>>& sets, double fallback) {
  std::vector<double> steps;
  for (std::size_t k = 2; k < sets.size(); ++k)
    steps.push_back((sets[k].front().time_ns - sets[k - 2].front().time_ns) / 2);
  return steps.empty() ? fallback : upper_median(std::move(steps));
}

/// The row that all shots of each set share, increasing; nothing where that is not so.
bool are_rows(const std::vector<std::vector<TimedShot>>& sets) {
  std::ptrdiff_t last = -1;
  for (const std::vector<TimedShot>& set : sets) {
    const auto row = static_cast<std::ptrdiff_t>(set.front().row);
    if (row <= last) return false;
    for (const TimedShot& shot : set) {
      if (static_cast<std::ptrdiff_t>(shot.row) != row) return false;
    }
    last = row;
  }
  return true;
}

std::size_t row_count(std::span<const ShotTimes> cameras) {
  std::size_t rows = 0;
  for (const ShotTimes& camera : cameras) rows = std::max(rows, camera.valid.size());
  return rows;
}

/// Set number k is row k. Pictures without a time are taken in as well.
void take_rows(std::span<const ShotTimes> cameras, FrameSets& result) {
  result.by_row = true;
  result.sets.resize(row_count(cameras));
  for (std::size_t k = 0; k < result.sets.size(); ++k) {
    FrameSet& set = result.sets[k];
    set.number = k;
    set.rows.resize(cameras.size());
    set.offset_ns.resize(cameras.size(), 0);
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      if (k < cameras[c].valid.size() && cameras[c].valid[k] != 0) set.rows[c] = k;
    }
  }
}

void note_offsets(const std::vector<TimedShot>& shots, FrameSet& set) {
  std::vector<double> times;
  for (const TimedShot& shot : shots) times.push_back(shot.time_ns);
  const auto [low, high] = std::minmax_element(times.begin(), times.end());
  set.spread_ns = *high - *low;
  const double middle = upper_median(times);
  for (const TimedShot& shot : shots) set.offset_ns[shot.camera] = shot.time_ns - middle;
}

/// Sets without any picture are no frames.
void leave_out_empty(FrameSets& result) {
  std::erase_if(result.sets, [&](const FrameSet& set) {
    const bool is_empty = std::none_of(set.rows.begin(), set.rows.end(),
                                       [](const auto& row) { return row.has_value(); });
    if (is_empty) result.no_frame.push_back(set.number);
    return is_empty;
  });
}

void name_dropped_and_late(std::span<const ShotTimes> cameras, FrameSets& result) {
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    CameraClock& clock = result.clocks[c];
    if (clock.timed) {
      clock.limit_ns =
          cameras[c].exposure_us > 0 ? 500 * cameras[c].exposure_us : result.period_ns / 4;
    }
    for (const FrameSet& set : result.sets) {
      if (!set.rows[c])
        clock.dropped.push_back(set.number);
      else if (clock.timed && clock.limit_ns > 0 && std::abs(set.offset_ns[c]) > clock.limit_ns)
        clock.late.push_back(set.number);
    }
  }
}

/// All shots by the clock of the reference, and what each clock does.
std::vector<TimedShot> common_clock(std::span<const ShotTimes> cameras, FrameSets& result) {
  std::size_t reference = 0;
  std::vector<Track> tracks;
  std::int64_t origin = kUnknownTime;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const auto known = std::find_if(cameras[c].times_ns.begin(), cameras[c].times_ns.end(),
                                    [](std::int64_t t) { return t != kUnknownTime; });
    if (origin == kUnknownTime && known != cameras[c].times_ns.end()) origin = *known;
  }
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    tracks.push_back(track_of(cameras[c], origin));
    if (tracks[c].times.size() > tracks[reference].times.size()) reference = c;
  }
  std::vector<double> periods;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    result.clocks[c].timed = !tracks[c].times.empty();
    result.clocks[c].period_ns = period_of(tracks[c]);
    if (result.clocks[c].period_ns > 0) periods.push_back(result.clocks[c].period_ns);
  }
  result.period_ns = upper_median(std::move(periods));
  std::vector<TimedShot> shots;
  if (result.period_ns <= 0) return shots;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const Track& track = tracks[c];
    if (track.times.empty()) continue;
    CameraClock& clock = result.clocks[c];
    std::vector<double> lead(track.times.size(), 0);
    if (c != reference) {
      clock.shared =
          cameras[c].shares_clock.value_or(share_start(tracks[reference], track, result.period_ns));
      const double shift =
          clock.shared ? 0 : best_shift(tracks[reference], track, result.period_ns);
      const std::vector<double> followed =
          followed_lead(tracks[reference], track, shift, result.period_ns);
      clock.shift_ns = followed.front();
      clock.drift_ppm = drift_ppm(track, followed);
      if (!clock.shared) lead = followed;
    }
    for (std::size_t i = 0; i < track.times.size(); ++i)
      shots.push_back({track.times[i] - lead[i], c, track.rows[i]});
  }
  return shots;
}

/// Moments that no camera has, by the time between sets. Of rows that are the moments, those
/// without a time between two are no gap: they are sets.
void name_gaps(const std::vector<std::vector<TimedShot>>& sets, FrameSets& result) {
  for (std::size_t k = 1; k < sets.size(); ++k) {
    const double step = (sets[k].front().time_ns - sets[k - 1].front().time_ns) / result.period_ns;
    const std::size_t at = result.by_row ? sets[k].front().row : k;
    const std::size_t before = result.by_row ? sets[k - 1].front().row : k - 1;
    const long missing = std::lround(step) - static_cast<long>(at - before);
    if (missing > 0) result.gaps.emplace_back(at, static_cast<std::size_t>(missing));
  }
}

/// Set k is what was taken at one time.
void take_moments(std::span<const ShotTimes> cameras,
                  const std::vector<std::vector<TimedShot>>& sets, FrameSets& result) {
  result.by_row = false;
  std::vector<std::vector<std::optional<std::size_t>>> set_of(cameras.size());
  for (std::size_t c = 0; c < cameras.size(); ++c) set_of[c].resize(cameras[c].valid.size());
  for (const std::vector<TimedShot>& shots : sets) {
    for (const TimedShot& shot : shots) set_of[shot.camera][shot.row] = result.sets.size();
    FrameSet& set = result.sets.emplace_back();
    set.number = result.sets.size() - 1;
    set.rows.resize(cameras.size());
    set.offset_ns.resize(cameras.size(), 0);
    for (const TimedShot& shot : shots) {
      if (cameras[shot.camera].valid[shot.row] != 0) set.rows[shot.camera] = shot.row;
    }
    note_offsets(shots, set);
  }
  for (std::size_t c = 0; c < cameras.size(); ++c) place_untimed(cameras[c], c, set_of[c], result);
}

}  // namespace

FrameSets group_frames(std::span<const ShotTimes> cameras) {
  FrameSets result;
  result.clocks.resize(cameras.size());
  std::vector<TimedShot> shots_in_time = common_clock(cameras, result);
  std::vector<std::vector<TimedShot>> sets =
      fall_into_sets(std::move(shots_in_time), cameras.size(), result.period_ns);
  split_turns(sets, result.period_ns);
  result.period_ns = period_of_sets(sets, result.period_ns);
  if (sets.empty() || are_rows(sets)) {
    take_rows(cameras, result);
    for (const std::vector<TimedShot>& set : sets) note_offsets(set, result.sets[set.front().row]);
  } else {
    take_moments(cameras, sets, result);
  }
  name_gaps(sets, result);
  leave_out_empty(result);
  name_dropped_and_late(cameras, result);
  return result;
}

FrameSets group_frames(const Recording& recording) {
  std::vector<ShotTimes> cameras(recording.cameras().size());
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    cameras[c].exposure_us = recording.cameras()[c].exposure_us;
    cameras[c].shares_clock = recording.shares_clock();
    for (std::size_t row = 0; row < recording.row_count(); ++row) {
      cameras[c].times_ns.push_back(recording.timestamp_ns(row, c));
      cameras[c].valid.push_back(recording.valid(row, c) ? 1 : 0);
    }
  }
  return group_frames(cameras);
}

}  // namespace pencilscan
