#include "pencilscan/calibration/suspects.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/calibration/track_errors.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/name_list.h"

namespace pencilscan {
namespace {

constexpr double kFitsShare = 0.6;         ///< of a pair that agrees with the rig
constexpr double kContradictsShare = 0.4;  ///< of one that does not
constexpr std::size_t kLeastMatches = 24;

using Matches = std::map<DevicePair, std::vector<PairMatch>>;

std::string folder(const Rig& rig, const DevicePair& pair) {
  return device_at(rig, pair.second).name + "/" + device_at(rig, pair.first).name;
}

std::string number_of(std::size_t capture) {
  return "--captures number " + std::to_string(capture + 1);
}

using Captures = std::map<DevicePair, std::vector<std::size_t>>;

/// What contradicts: whole pairs, or some captures of a pair alone.
struct Contradicting {
  std::set<DevicePair> pairs;
  Captures captures;  ///< of those pairs of which only some captures do

  [[nodiscard]] bool is_in(const DevicePair& pair, std::optional<std::size_t> capture) const {
    if (!pairs.contains(pair)) return false;
    const auto some = captures.find(pair);
    if (some == captures.end()) return !capture;
    return capture && std::count(some->second.begin(), some->second.end(), *capture) > 0;
  }
  void take_out(const DevicePair& pair, std::optional<std::size_t> capture) {
    const auto some = captures.find(pair);
    if (capture && some != captures.end()) std::erase(some->second, *capture);
    if (some != captures.end() && !some->second.empty()) return;
    captures.erase(pair);
    pairs.erase(pair);
  }
};

/// Folders that were exchanged, in one capture, or in all where none is given.
void find_swaps(const CalibrationInput& input, const Matches& matches, const PairFit& fit,
                std::optional<std::size_t> capture, Contradicting& bad, Captures& swapped,
                std::vector<Finding>& findings) {
  const auto fits = [&](const DevicePair& pair, const DevicePair& place) {
    return fit.share(matches.at(pair), place.first, place.second, nullptr,
                     capture.value_or(SIZE_MAX)) >= kFitsShare;
  };
  const std::vector<DevicePair> all(bad.pairs.begin(), bad.pairs.end());
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t j = i + 1; j < all.size(); ++j) {
      if (!bad.is_in(all[i], capture) || !bad.is_in(all[j], capture)) continue;
      if (!fits(all[i], all[j]) || !fits(all[j], all[i])) continue;
      findings.push_back({Grade::kDoubtful,
                          "the folders " + folder(input.rig, all[i]) + " and " +
                              folder(input.rig, all[j]) +
                              (capture ? " (" + number_of(*capture) + ")" : "") +
                              " are swapped: each fits the rig in the other's place",
                          "exchange the two folders and calibrate again"});
      for (const DevicePair& pair : {all[i], all[j]}) {
        bad.take_out(pair, capture);
        if (capture)
          swapped[pair].push_back(*capture);
        else
          swapped[pair].clear();
      }
    }
  }
}

/// The device that most of the contradicting pairs have in common; of several, the one whose pairs
/// fit worst altogether.
std::size_t find_mover(const Matches& matches, const PairFit& fit, const Captures& bad) {
  std::map<std::size_t, std::pair<std::size_t, double>> blame;
  for (const auto& [pair, captures] : bad) {
    ++blame[pair.first].first;
    ++blame[pair.second].first;
  }
  for (const auto& [pair, list] : matches) {
    if (!fit.placed(pair.first) || !fit.placed(pair.second)) continue;
    const double misfit = 1 - fit.share(list, pair.first, pair.second);
    for (const std::size_t d : {pair.first, pair.second})
      if (blame.contains(d)) blame[d].second += misfit;
  }
  return std::max_element(blame.begin(), blame.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

Finding name_mover(const CalibrationInput& input, std::size_t mover, const Captures& bad) {
  std::vector<std::string> partners;
  std::set<std::size_t> when;
  for (const auto& [pair, captures] : bad) {
    if (pair.first != mover && pair.second != mover) continue;
    const std::size_t partner = pair.first == mover ? pair.second : pair.first;
    partners.push_back(device_at(input.rig, partner).name);
    when.insert(captures.begin(), captures.end());
  }
  const bool is_camera = mover < input.rig.cameras.size();
  std::string text = std::string(is_camera ? "camera " : "projector ") +
                     device_at(input.rig, mover).name + " has moved: its images " +
                     (is_camera ? "of " : "in ") + name_list(partners) +
                     " do not fit the rest of the rig";
  if (!when.empty()) {
    std::vector<std::string> names;
    for (const std::size_t capture : when) names.push_back(std::to_string(capture + 1));
    text += " (--captures number " + name_list(names) + ")";
  }
  return {
      Grade::kDoubtful, text,
      std::string("fix the device, and take the captures again; those that do not fit were left "
                  "out") +
          (when.empty() ? "" : ". Where nothing was touched, the object moved between pictures")};
}

/// Captures in which a device saw something, or showed something that others saw.
std::set<std::size_t> captures_of(const std::vector<Track>& tracks, std::size_t device) {
  std::set<std::size_t> captures;
  for (const Track& track : tracks)
    if (view_in(track, device) != nullptr) captures.insert(track.capture);
  return captures;
}

/// Of two captures neither is the one that is off.
std::string where_it_lies(const std::vector<CaptureMove>& when,
                          const std::set<std::size_t>& captures) {
  double most = 0;
  std::vector<std::string> numbers;
  for (const CaptureMove& move : when) {
    most = std::max(most, move.shift_px);
    numbers.push_back(std::to_string(move.capture + 1));
  }
  if (when.size() == 1 && captures.size() == 2) {
    const std::size_t other =
        *captures.begin() == when[0].capture ? *captures.rbegin() : *captures.begin();
    return "its picture lies " + formatted(most) + " px elsewhere in --captures number " +
           numbers[0] + " than in number " + std::to_string(other + 1) +
           ". The rig has it as in number " + std::to_string(other + 1) +
           "; two captures do not tell where it usually stands";
  }
  return "in --captures number " + name_list(numbers) + " its picture lies " +
         (when.size() > 1 ? "up to " : "") + formatted(most) + " px off where the rig has it";
}

/// One finding per device that moved between captures.
std::vector<Finding> name_moved(const CalibrationInput& input,
                                const std::vector<CaptureMove>& moves) {
  std::map<std::size_t, std::vector<CaptureMove>> by_device;
  for (const CaptureMove& move : moves) by_device[move.device].push_back(move);
  std::vector<Finding> findings;
  for (const auto& [device, when] : by_device)
    findings.push_back(
        {Grade::kDoubtful,
         std::string(device < input.rig.cameras.size() ? "camera " : "projector ") +
             device_at(input.rig, device).name + " has moved, or was zoomed, between captures: " +
             where_it_lies(when, captures_of(input.tracks, device)),
         "fix the device, and take the captures again: the rig may not have it where it stands "
         "now. Where nothing was touched, the object moved between pictures"});
  return findings;
}

/// What devices that moved do not explain.
void take_out_moved(const std::vector<CaptureMove>& moves, Contradicting& bad) {
  const Captures captures = bad.captures;
  for (const auto& [pair, numbers] : captures)
    for (const std::size_t capture : numbers)
      if (has_moved(moves, pair.first, capture) || has_moved(moves, pair.second, capture))
        bad.take_out(pair, capture);
}

}  // namespace

PairFit tolerant_fit(const CalibrationResult& result) {
  return {result.problem.devices, contradiction_limit(result.rms_px)};
}

Contradictions find_contradictions(const CalibrationInput& input, const CalibrationResult& result) {
  if (!result.solved) return {};
  const Matches matches = matches_by_pair(input.tracks);
  const PairFit fit = tolerant_fit(result);
  Contradicting bad;
  std::set<std::size_t> numbers_of_bad;
  for (const auto& [pair, list] : matches) {
    if (!fit.placed(pair.first) || !fit.placed(pair.second)) continue;
    if (list.size() >= kLeastMatches &&
        fit.share(list, pair.first, pair.second) < kContradictsShare) {
      bad.pairs.insert(pair);
      continue;
    }
    std::set<std::size_t> numbers;
    for (const PairMatch& m : list) numbers.insert(m.capture);
    for (const std::size_t capture : numbers) {
      std::size_t count = 0;
      const double share = fit.share(list, pair.first, pair.second, &count, capture);
      if (count < kLeastMatches || share >= kContradictsShare) continue;
      bad.pairs.insert(pair);
      bad.captures[pair].push_back(capture);
      numbers_of_bad.insert(capture);
    }
  }
  Contradictions found;
  find_swaps(input, matches, fit, std::nullopt, bad, found.swapped, found.findings);
  for (const std::size_t capture : numbers_of_bad)
    find_swaps(input, matches, fit, capture, bad, found.swapped, found.findings);
  Captures wrong = found.swapped;
  for (const DevicePair& pair : bad.pairs)
    if (!bad.captures.contains(pair)) wrong[pair].clear();
  found.moves = moved_between_captures(result, without_pairs(input.tracks, wrong));
  for (Finding& finding : name_moved(input, found.moves.clear))
    found.findings.push_back(std::move(finding));
  take_out_moved(found.moves.clear, bad);
  // Pairs without sense in themselves (their fundamental matrix fits few) are named elsewhere.
  for (const PairGeometry& geometry : result.pairs)
    if (geometry.inlier_share() < 0.35) bad.pairs.erase({geometry.camera, geometry.projector});
  for (const DevicePair& pair : bad.pairs) found.unexplained[pair] = bad.captures[pair];
  if (!bad.pairs.empty()) {
    found.mover = find_mover(matches, fit, found.unexplained);
    found.findings.push_back(name_mover(input, *found.mover, found.unexplained));
  }
  return found;
}

std::vector<Track> without_pairs(const std::vector<Track>& tracks, const Captures& pairs) {
  std::vector<Track> kept;
  for (const Track& track : tracks) {
    Track rest{{track.views[0]}, track.capture};
    for (std::size_t i = 1; i < track.views.size(); ++i) {
      const auto found = pairs.find(pair_of(track, track.views[i]));
      const bool is_out =
          found != pairs.end() &&
          (found->second.empty() ||
           std::count(found->second.begin(), found->second.end(), track.capture) != 0);
      if (!is_out) rest.views.push_back(track.views[i]);
    }
    if (rest.views.size() > 1) kept.push_back(std::move(rest));
  }
  return kept;
}

}  // namespace pencilscan
