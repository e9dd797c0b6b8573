#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace pencilscan {

/// When a figure that was steady becomes another one.
///
/// A value is out when it is more than T spreads from the running median: of the kReference values
/// before it, spread 1.4826 times their median distance from that median, and at least the noise
/// from value to value of all of them. T is derived: of `values` independent Gaussian values, one
/// is out by chance in 1 / chance sequences. From P(|z| > T) <= 2 exp(-T^2 / 2) follows T = sqrt(2
/// ln(2 values / chance)): 5.6 for 36,000. So is one that differs by less than `smallest`, whatever
/// the spread: no one would act on it.
///
/// Three of four values out in a row, none of them nearer to what was before than half of T, are a
/// change from the first of them on. It ends with the first value of a later change to what was
/// before it, from where the running median goes on. After a change the median starts anew. Until
/// it is known, three values in a row that fit the values before the change and not those from
/// there are its end, at the end of all values fewer. Later, eight in a row are that fit the values
/// before it and lie nearer to them than to the median since: of a level that is so noisy that what
/// was before lies within its spread, no single value is out. A step among the first values is
/// looked for backwards from the fifteenth: it needs three values before it.
///
/// An outlier is one or two values in a row, each more than T spreads from the median of the
/// kReference values next to it of its own level: those of before a change and after its end are of
/// one level. At the end of all values nobody knows whether it is a change.
struct ChangeOptions {
  double smallest = 0;  ///< difference that counts at all, in the unit of the values; > 0
  std::size_t values =
      1;  ///< of all figures that are watched together, so that one chance is for all
  double chance = 0.01;  ///< of a false alarm in all of them
  /// The running median follows what changes slowly. False: it is that of the first kReference
  /// values, of a figure that the object's motion does not change; a drift is a change then, once
  /// it comes to `smallest`.
  bool follows = true;
};

struct Change {
  std::size_t at = 0;              ///< index of the first value that is different
  std::optional<std::size_t> end;  ///< of the first one that is as before again; none: it stays so
  double before = 0;               ///< median of the values before
  double after = 0;                ///< of the first ones from there
  double spreads = 0;              ///< difference over the spread before
};

/// So many values out are a change; no single bad one is.
inline constexpr std::size_t kFramesOfChange = 3;
/// Values of the running median. Short, so that slow motion of the object is followed: waves of 15
/// deviations with a period of 125 values gave no change in 100 sequences of 300 values; with 25
/// values 12.
inline constexpr std::size_t kReference = 15;

struct ChangeReport {
  std::vector<Change> changes;
  std::vector<std::size_t> outliers;  ///< single values that differ
  std::vector<std::size_t> at_end;    ///< the same of the last ones of all
};

/// Values that are not finite are unknown and passed over.
[[nodiscard]] ChangeReport find_changes(std::span<const double> values,
                                        const ChangeOptions& options);

}  // namespace pencilscan
