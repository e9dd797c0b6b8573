#include "pencilscan/calibration/start_up.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/calibration/board_start.h"
#include "pencilscan/calibration/structure.h"
#include "pencilscan/core/parallel.h"

namespace pencilscan {
namespace {

constexpr unsigned kStartInner = 1U << kFx | 1U << kFy | 1U << kCy;
constexpr FocalGuess kUsualGuess{1.5, 1.5, 0, 0};

/// Devices with inner parameters as guessed or given, no poses unless given for all.
std::vector<BundleDevice> devices_of(const StartUp& start, const FocalGuess& guess) {
  const Rig rig = rig_with_guess(start.rig, guess, start.known);
  const bool posed = std::all_of(start.input.known.begin(), start.input.known.end(),
                                 [](const GivenCalibration& k) { return k.pose; });
  std::vector<BundleDevice> devices;
  for (std::size_t d = 0; d < device_count(rig); ++d) {
    devices.push_back(bundle_device(device_at(rig, d)));
    set_priors(start.input.known[d], start.tolerance, d < rig.cameras.size(), devices.back());
    devices.back().present = posed;
  }
  return devices;
}

/// Neighbours on the grid of guesses lead to the same place: each differs from the better ones.
std::vector<FocalGuess> differing_guesses(const StartUp& start) {
  std::vector<FocalGuess> chosen;
  for (const FocalGuess& guess : guess_focal_lengths(start.rig, start.pairs, start.known)) {
    const bool is_near = std::any_of(chosen.begin(), chosen.end(), [&](const FocalGuess& other) {
      return std::abs(std::log(guess.camera_scale / other.camera_scale)) < 0.45 &&
             std::abs(std::log(guess.projector_scale / other.projector_scale)) < 0.45 &&
             std::abs(guess.lens_shift - other.lens_shift) < 0.4;
    });
    if (!is_near) chosen.push_back(guess);
    if (chosen.size() == start.hypotheses) break;
  }
  return chosen;
}

struct Attempt {
  BundleProblem problem;
  double cost = std::numeric_limits<double>::infinity();
  [[nodiscard]] std::size_t placed() const {
    return std::isfinite(cost) ? present_devices(problem) : 0;
  }
};

/// A structure that boards place.
Attempt structure_on_boards(const StartUp& start, const BundleProblem& problem) {
  Attempt attempt{problem};
  attempt.problem.devices = devices_of(start, kUsualGuess);
  place_by_boards(start.input, start.known, attempt.problem);
  if (present_devices(attempt.problem) >= 2)
    attempt.cost = build_structure(attempt.problem, kStartInner);
  return attempt;
}

}  // namespace

bool find_structure(const StartUp& start, BundleProblem& problem) {
  std::vector<char> trusted;
  for (const GivenCalibration& k : start.input.known)
    trusted.push_back(k.K && start.tolerance ? 1 : 0);
  const auto some_trusted = std::count(trusted.begin(), trusted.end(), 1);
  const bool has_chain =
      some_trusted >= 2 && static_cast<std::size_t>(some_trusted) < trusted.size();
  const auto tried = differing_guesses(start);
  std::vector<Attempt> attempts(tried.size() + (has_chain ? 1 : 0), Attempt{problem});
  parallel_for(attempts.size(), [&](std::size_t i) {
    StructureOptions options;
    options.trusted = trusted;
    options.resects = i == tried.size();
    attempts[i].problem.devices = devices_of(start, i < tried.size() ? tried[i] : kUsualGuess);
    attempts[i].cost = build_structure(attempts[i].problem, kStartInner, options);
  });
  auto best = attempts.begin();
  for (auto a = attempts.begin(); a != attempts.end(); ++a)
    if (a->placed() > best->placed() || (a->placed() == best->placed() && a->cost < best->cost))
      best = a;
  const bool is_found = best->placed() >= 2;
  if (!start.input.board_views.empty()) {
    Attempt on_boards = structure_on_boards(start, problem);
    // On planes correspondences alone fit many rigs equally well: the boards' counts.
    if (on_boards.placed() >= std::max<std::size_t>(best->placed(), 2) &&
        (!is_found || on_boards.cost <= 1.5 * best->cost + 0.5)) {
      problem = std::move(on_boards.problem);
      return true;
    }
  }
  if (!is_found) return false;
  problem = std::move(best->problem);
  attach_boards(start.input, problem);
  return true;
}

}  // namespace pencilscan
