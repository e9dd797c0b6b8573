#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/recording/recording.h"

namespace pencilscan {

/// The pictures of one moment.
struct FrameSet {
  std::size_t number = 0;  ///< its row, or which moment it is, from 0; it names the frame
  std::vector<std::optional<std::size_t>> rows;  ///< one per camera; nothing: it has no picture
  /// When each exposure began, ns after the median of the set by the common clock; 0 where it is
  /// unknown or there is no picture.
  std::vector<double> offset_ns;
  double spread_ns = 0;  ///< latest minus earliest
};

/// How a camera's clock and shutter go, against the camera with most time stamps.
struct CameraClock {
  bool timed = false;                ///< it has time stamps
  bool shared = true;                ///< its time stamps count from the same moment as the others'
  double shift_ns = 0;               ///< its clock minus the others', at the first frame
  double drift_ppm = 0;              ///< how much faster its clock runs
  double period_ns = 0;              ///< median time from picture to picture; 0: unknown
  double limit_ns = 0;               ///< a picture is late from here on; 0: unknown
  std::vector<std::size_t> dropped;  ///< numbers of sets without its picture
  std::vector<std::size_t> late;     ///< numbers of sets where its picture is of another moment
  /// Rows whose picture is in no set: it has no time stamp, and the rows do not tell its moment.
  std::vector<std::size_t> left_out;
};

/// Which pictures show one moment.
struct FrameSets {
  std::vector<FrameSet> sets;         ///< each has a picture
  std::vector<std::size_t> no_frame;  ///< numbers of rows, or moments, without any valid picture
  std::vector<CameraClock> clocks;    ///< one per camera
  bool by_row = true;                 ///< set number k is row k of every camera
  double period_ns = 0;               ///< median from set to set; 0: unknown
  /// Numbers before which moments are missing in all cameras, and how many.
  std::vector<std::pair<std::size_t, std::size_t>> gaps;
};

/// What is known of one camera's pictures, in the order in which it gave them.
struct ShotTimes {
  std::vector<std::int64_t> times_ns;  ///< kUnknownTime: not known
  std::vector<std::uint8_t> valid;     ///< 1: there is a picture
  double exposure_us = 0;              ///< 0: unknown
  std::optional<bool> shares_clock;    ///< nothing: found out
};

/// Pictures belong together by their time stamps, not by their numbers: a camera that drops one
/// counts on. Two are of one moment when they began less than half a period apart, and when the
/// camera of the first has no next picture that is nearer to the other's: another moment is nearer
/// otherwise.
///
/// Cameras may take turns: those of one half lie between those of the other half. So a recording
/// where a period P holds the same two groups again and again, of two cameras at least each, more
/// than P / 4 apart, has two moments a period, one for each group: moments follow each other P / 2
/// apart then, and what is more than half of that apart is of two. One camera alone on its side is
/// late, since it sees nothing that another one sees at that moment.
///
/// A picture without a time stamp between timed ones of its camera is of the moment between theirs
/// where there are as many as pictures; else it is left out.
///
/// Clocks that do not count from the same moment (the recording says so, or they were hardly ever
/// running at once) are shifted onto each other: of all lags in
/// pictures, the one that lets most pictures meet, the smallest of equals (a constant rate repeats
/// itself). Then the lag is followed over time in blocks, as clocks drift. What is constant in it
/// cannot be told from a shutter that opens late: it counts as late where clocks are shared and as
/// a shift where not.
///
/// A picture is late when it began more than half an exposure before or after its set, so that it
/// shows mostly another moment; where the exposure is unknown, more than a quarter of a period.
///
/// Where nothing is timed, or the rows already are the moments, set number k is row k. A row or a
/// moment without a valid picture of any camera is no set; the others keep their numbers.
[[nodiscard]] FrameSets group_frames(std::span<const ShotTimes> cameras);
[[nodiscard]] FrameSets group_frames(const Recording& recording);

}  // namespace pencilscan
