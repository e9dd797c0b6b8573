#include "pencilscan/calibration/calibrate.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pencilscan/bundle/board_corners.h"
#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/priors.h"
#include "pencilscan/bundle/triangulation.h"
#include "pencilscan/bundle/uncertainty.h"
#include "pencilscan/calibration/board_start.h"
#include "pencilscan/calibration/rig_frame.h"
#include "pencilscan/calibration/structure.h"
#include "pencilscan/calibration/suspects.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"

namespace pencilscan {
namespace {

constexpr unsigned bit(Intrinsic i) { return 1U << static_cast<unsigned>(i); }
constexpr unsigned kFocal = bit(kFx) | bit(kFy);
constexpr unsigned kCenter = bit(kCx) | bit(kCy);
constexpr unsigned kAll = kFocal | kCenter | bit(kK1) | bit(kK2) | bit(kP1) | bit(kP2);
constexpr double kLeastAngle = 0.02;  ///< rad between rays of a point

/// Robust standard deviation of one coordinate's error. A track of n measured views has 2 n - 1
/// degrees of freedom left, since they choose the depth on the hub's ray.
double error_scale(const BundleProblem& problem) {
  std::vector<double> errors;
  for_each_residual(problem, [&](std::size_t t, const TrackView&, const Vec2& error) {
    const double n = static_cast<double>(problem.tracks[t].views.size()) - 1;
    for (Eigen::Index k = 0; k < 2; ++k)
      errors.push_back(std::abs(error[k]) * std::sqrt(2 * n / (2 * n - 1)));
  });
  return kDeviationPerMedian * lower_quantile(errors, 0.5);
}

double median_sigma(const BundleProblem& problem) {
  std::vector<double> sigmas;
  for (const Track& track : problem.tracks)
    for (std::size_t i = 1; i < track.views.size(); ++i) sigmas.push_back(track.views[i].sigma_px);
  return lower_quantile(sigmas, 0.5);
}

/// Drops views beyond `limit` pixels, and tracks that are left with one view.
std::size_t drop_outliers(BundleProblem& problem, double limit) {
  std::size_t dropped = 0;
  for (std::size_t t = 0; t < problem.tracks.size(); ++t) {
    if (problem.used[t] == 0) continue;
    auto& views = problem.tracks[t].views;
    const auto is_wrong = [&](const TrackView& view) {
      const BundleDevice& device = problem.devices[view.device];
      if (!device.present) return false;
      const auto error = view_error(device, problem.points[t], view);
      return !error || error->norm() > limit;
    };
    const auto keep = std::stable_partition(views.begin() + 1, views.end(),
                                            [&](const TrackView& v) { return !is_wrong(v); });
    dropped += static_cast<std::size_t>(views.end() - keep);
    views.erase(keep, views.end());
    const auto present = std::count_if(views.begin(), views.end(), [&](const TrackView& v) {
      return problem.devices[v.device].present;
    });
    if (present < 2 || !problem.devices[views[0].device].present) problem.used[t] = 0;
  }
  return dropped;
}

class Calibration {
 public:
  Calibration(const CalibrationInput& input, const CalibrateOptions& options,
              const Progress& progress)
      : input_(input), options_(options), progress_(progress), rig_(input.rig) {
    known_ = focal_lengths_from_boards(input, rig_);
  }

  CalibrationResult run() {
    split_tracks();
    say("finding the geometry of pairs", 0);
    result_.pairs = pair_geometries(input_.rig, result_.problem.tracks);
    const std::size_t before = views();
    drop_epipolar_outliers(input_.rig, result_.pairs, options_.least_inlier_share,
                           result_.problem.tracks);
    epipolar_outliers_ = before - views();
    candidates_ = result_.problem.tracks;
    if (!find_structure()) return finish(false);
    add_projected_corners(input_, result_.problem);
    refine();
    keep_given_values();
    last_stage();
    return finish(true);
  }

 private:
  void say(const char* what, double fraction) const {
    if (progress_) progress_(what, fraction);
  }

  [[nodiscard]] std::size_t views() const {
    std::size_t sum = 0;
    for (const Track& track : result_.problem.tracks) sum += track.views.size() - 1;
    return sum;
  }

  void split_tracks() {
    const auto every = options_.held_out_share > 0
                           ? static_cast<std::size_t>(std::round(1 / options_.held_out_share))
                           : input_.tracks.size() + 1;
    for (std::size_t t = 0; t < input_.tracks.size(); ++t) {
      const bool held = t % every == every - 1;
      (held ? result_.held_out : result_.problem.tracks).push_back(input_.tracks[t]);
    }
  }

  /// Devices with inner parameters as guessed or given, no poses unless given for all.
  [[nodiscard]] std::vector<BundleDevice> start(const FocalGuess& guess) const {
    const Rig rig = rig_with_guess(rig_, guess, known_);
    const bool posed = std::all_of(input_.known.begin(), input_.known.end(),
                                   [](const GivenCalibration& k) { return k.pose; });
    std::vector<BundleDevice> devices;
    for (std::size_t d = 0; d < device_count(rig); ++d) {
      devices.push_back(bundle_device(device_at(rig, d)));
      set_priors(input_.known[d], d < rig.cameras.size(), device_at(rig, d), devices.back());
      devices.back().present = posed;
    }
    return devices;
  }

  [[nodiscard]] std::vector<FocalGuess> guesses() const {
    auto all = guess_focal_lengths(rig_, result_.pairs, known_);
    // Neighbours on the grid lead to the same place: each guess differs from the better ones.
    std::vector<FocalGuess> chosen;
    for (const FocalGuess& guess : all) {
      const bool is_near = std::any_of(chosen.begin(), chosen.end(), [&](const FocalGuess& other) {
        return std::abs(std::log(guess.camera_scale / other.camera_scale)) < 0.45 &&
               std::abs(std::log(guess.projector_scale / other.projector_scale)) < 0.45 &&
               std::abs(guess.lens_shift - other.lens_shift) < 0.4;
      });
      if (!is_near) chosen.push_back(guess);
      if (chosen.size() == options_.hypotheses) break;
    }
    return chosen;
  }

  /// The best of several structures: most devices, then least cost.
  bool find_structure() {
    const auto tried = guesses();
    std::vector<BundleProblem> problems(tried.size(), result_.problem);
    std::vector<double> costs(tried.size());
    say("finding a first structure", 0);
    parallel_for(tried.size(), [&](std::size_t i) {
      problems[i].devices = start(tried[i]);
      costs[i] = build_structure(problems[i], kFocal | bit(kCy));
    });
    std::size_t best = tried.size();
    std::size_t most = 1;
    for (std::size_t i = 0; i < tried.size(); ++i) {
      const std::size_t placed = present_devices(problems[i]);
      if (placed < most || !std::isfinite(costs[i])) continue;
      if (placed == most && best < tried.size() && costs[i] >= costs[best]) continue;
      best = i;
      most = placed;
    }
    if (!input_.board_views.empty()) {
      auto [problem, cost] = structure_on_boards();
      // On planes correspondences alone fit many rigs equally well: the boards' counts.
      const bool is_alone = best == tried.size();
      if (std::isfinite(cost) && present_devices(problem) >= most &&
          (is_alone || cost <= 1.5 * costs[best] + 0.5)) {
        result_.problem = std::move(problem);
        return true;
      }
    }
    if (best == tried.size()) return false;
    result_.problem = std::move(problems[best]);
    attach_boards(input_, result_.problem);
    return true;
  }

  /// A structure that boards place, and its cost; infinite where they do not join two devices.
  [[nodiscard]] std::pair<BundleProblem, double> structure_on_boards() const {
    constexpr FocalGuess kUsual{1.5, 1.5, 0, 0};
    BundleProblem problem = result_.problem;
    problem.devices = start(kUsual);
    place_by_boards(input_, known_, problem);
    if (present_devices(problem) < 2) return {problem, std::numeric_limits<double>::infinity()};
    const double cost = build_structure(problem, kFocal | bit(kCy));
    return {std::move(problem), cost};
  }

  void stage(unsigned free_inner, std::size_t tracks, int iterations, double track_weight = 1) {
    BundleProblem& problem = result_.problem;
    const double scale = error_scale(problem);
    const double own = median_sigma(problem);
    BundleOptions bundle;
    bundle.free_inner = free_inner;
    bundle.extra_sigma_px = std::sqrt(std::max(0.0, scale * scale - own * own));
    bundle.max_tracks = tracks;
    bundle.max_iterations = iterations;
    bundle.function_tolerance = tracks == 0 ? 1e-11 : 1e-6;
    bundle.track_weight = track_weight;
    weigh_corners(problem);
    adjust(problem, bundle);
    result_.adjustment = bundle;
    expect_unmodelled(input_.rig, problem);
  }

  /// What correspondences should count at the solution so far, whose weights may be others.
  [[nodiscard]] double fair_track_weight() const {
    return uncertainty(result_.problem, result_.adjustment).track_weight;
  }

  void drop() {
    BundleProblem& problem = result_.problem;
    drop_corners(problem, options_.outlier_deviations);
    const double scale = error_scale(problem);
    result_.views_dropped +=
        drop_outliers(problem, std::max(options_.outlier_deviations * scale, 0.3));
  }

  void refine() {
    BundleProblem& problem = result_.problem;
    triangulate_all(problem, kLeastAngle);
    const std::array<unsigned, 4> stages{kFocal | bit(kCy), kFocal | kCenter,
                                         kFocal | kCenter | bit(kK1), kAll};
    for (std::size_t s = 0; s < stages.size(); ++s) {
      say("adjusting", static_cast<double>(s) / 8);
      stage(stages[s], options_.stage_tracks, 50);
      triangulate_all(problem, kLeastAngle);
      drop();
    }
  }

  /// Per device: its given focal lengths are those that the data find, as far as these know them.
  /// The scatter alone would not tell: in a ring a common error of all hides in the poses.
  [[nodiscard]] std::vector<char> given_agrees() const {
    constexpr double kDeviations = 4;
    std::vector<char> agrees(input_.known.size(), 0);
    if (std::none_of(input_.known.begin(), input_.known.end(),
                     [](const GivenCalibration& k) { return k.K; }))
      return agrees;
    const Uncertainty sigma = uncertainty(result_.problem, result_.adjustment);
    for (std::size_t d = 0; d < agrees.size(); ++d) {
      const BundleDevice& found = result_.problem.devices[d];
      if (!input_.known[d].K) continue;
      const Mat3& K = device_at(input_.rig, d).K;
      const auto is_near = [&](Intrinsic i, double given) {
        const double slack = std::max(kDeviations * sigma.devices[d].inner[i],
                                      options_.given_focal_tolerance * given);
        return !found.present || std::abs(found.inner[i] - given) <= slack;
      };
      agrees[d] = is_near(kFx, K(0, 0)) && is_near(kFy, K(1, 1)) ? 1 : 0;
    }
    return agrees;
  }

  /// Values that were given and explain the data as well as free ones do are a calibration and are
  /// kept; others were only rough.
  void keep_given_values() {
    result_.inner_held.assign(input_.known.size(), 0);
    const std::size_t cameras = input_.rig.cameras.size();
    triangulate_all(result_.problem, kLeastAngle);
    const std::vector<char> agrees = given_agrees();
    // A guess that the data contradict says nothing any more.
    for (std::size_t d = 0; d < agrees.size(); ++d)
      if (input_.known[d].K && agrees[d] == 0)
        set_priors({}, d < cameras, device_at(input_.rig, d), result_.problem.devices[d]);
    const double free_scale = error_scale(result_.problem);
    for (const int attempt : {0, 1, 2}) {  // all given ones, the cameras' alone, the projectors'
      BundleProblem trial = result_.problem;
      std::vector<char> held(input_.known.size(), 0);
      for (std::size_t d = 0; d < held.size(); ++d) {
        const bool in_group = attempt == 0 || (attempt == 1) == (d < cameras);
        if (!input_.known[d].K || !in_group) continue;
        held[d] = 1;
        const Device& given = device_at(input_.rig, d);
        BundleDevice exact = bundle_device(given);
        for (std::size_t i = 0; i < kIntrinsics; ++i)
          if (i < kK1 || input_.known[d].distortion) trial.devices[d].inner[i] = exact.inner[i];
        hold_given(input_.known[d], trial.devices[d]);
      }
      bool is_plausible = std::any_of(held.begin(), held.end(), [](char h) { return h != 0; });
      for (std::size_t d = 0; d < held.size(); ++d)
        is_plausible = is_plausible && (held[d] == 0 || agrees[d] != 0);
      if (!is_plausible) continue;
      std::swap(trial, result_.problem);
      const BundleOptions before = result_.adjustment;
      // Twice: the weights of the first round are those of errors not yet adapted to.
      for (int round = 0; round < 2; ++round) {
        stage(kAll, options_.stage_tracks, 50);
        triangulate_all(result_.problem, kLeastAngle);
      }
      if (error_scale(result_.problem) <=
          options_.given_tolerance * free_scale + options_.given_slack_px) {
        result_.inner_held = held;
        return;
      }
      std::swap(trial, result_.problem);
      result_.adjustment = before;
    }
  }

  void last_stage() {
    for (const int round : {0, 1, 2, 3}) {
      say("adjusting all correspondences", 0.6 + 0.1 * round);
      if (round < 3) {
        // Early stages drop views that only a poor start contradicts: all of them count again.
        result_.problem.tracks = candidates_;
        result_.views_dropped = epipolar_outliers_;
      }
      triangulate_all(result_.problem, kLeastAngle);
      if (round > 0) drop();
      const bool is_last = round == 3;
      stage(kAll, round < 2 ? options_.stage_tracks : 0, is_last ? 200 : 50,
            is_last ? fair_track_weight() : 1);
    }
  }

  CalibrationResult finish(bool solved) {
    result_.solved = solved;
    result_.rig = input_.rig;
    result_.placed.assign(device_count(input_.rig), 0);
    result_.residuals.resize(device_count(input_.rig));
    result_.inner_held.resize(device_count(input_.rig), 0);
    if (!solved) return std::move(result_);
    rescale_to_boards(result_.problem);
    result_.rig.unit_known = fix_frame(input_, result_.problem);
    for (std::size_t d = 0; d < result_.placed.size(); ++d) {
      result_.placed[d] = result_.problem.devices[d].present ? 1 : 0;
      if (result_.placed[d] != 0) set_device(result_.problem.devices[d], device_at(result_.rig, d));
    }
    measure();
    return std::move(result_);
  }

  void measure() {
    const BundleProblem& problem = result_.problem;
    std::vector<std::vector<double>> errors(problem.devices.size());
    double sum = 0;
    for_each_residual(problem, [&](std::size_t, const TrackView& view, const Vec2& error) {
      errors[view.device].push_back(error.norm());
      sum += error.squaredNorm();
      ++result_.views;
    });
    result_.rms_px = std::sqrt(sum / static_cast<double>(std::max<std::size_t>(result_.views, 1)));
    for (std::size_t d = 0; d < errors.size(); ++d) {
      DeviceResiduals& r = result_.residuals[d];
      r.views = errors[d].size();
      double squares = 0;
      for (const double e : errors[d]) squares += e * e;
      r.rms_px = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(r.views, 1)));
      r.median_px = lower_quantile(errors[d], 0.5);
      r.p95_px = lower_quantile(errors[d], 0.95);
    }
    result_.board_rms_px = board_rms_px(problem);
    measure_held_out();
  }

  void measure_held_out() {
    drop_epipolar_outliers(input_.rig, result_.pairs, options_.least_inlier_share,
                           result_.held_out);
    BundleProblem check;
    check.devices = result_.problem.devices;
    check.tracks = result_.held_out;
    triangulate_all(check, kLeastAngle);
    const double limit = std::max(options_.outlier_deviations * error_scale(result_.problem), 0.3);
    BundleOptions points_only;
    points_only.free_poses = false;
    points_only.extra_sigma_px = result_.adjustment.extra_sigma_px;
    points_only.max_iterations = 20;
    adjust(check, points_only);
    drop_outliers(check, limit);  // as for the others: wrong codes are no error of the rig
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t t = 0; t < check.tracks.size(); ++t) {
      if (check.used[t] == 0) continue;
      for (const double e : track_errors(check, check.tracks[t], check.points[t])) {
        sum += e * e;
        ++count;
      }
    }
    result_.held_out_rms_px = std::sqrt(sum / static_cast<double>(std::max<std::size_t>(count, 1)));
  }

  const CalibrationInput& input_;
  const CalibrateOptions& options_;
  const Progress& progress_;
  Rig rig_;                            ///< with focal lengths that boards give
  std::vector<char> known_;            ///< per device: K is given, or from boards
  std::vector<Track> candidates_;      ///< what fundamental matrices left
  std::size_t epipolar_outliers_ = 0;  ///< views that they dropped
  CalibrationResult result_;
};

}  // namespace

std::vector<double> track_errors(const BundleProblem& problem, const Track& track,
                                 const Vec3& point) {
  std::vector<double> errors;
  for (std::size_t i = 1; i < track.views.size(); ++i) {
    const BundleDevice& device = problem.devices[track.views[i].device];
    if (!device.present) continue;
    const auto error = view_error(device, point, track.views[i]);
    if (error) errors.push_back(error->norm());
  }
  return errors;
}

CalibrationResult calibrate(const CalibrationInput& input, const CalibrateOptions& options,
                            const Progress& progress) {
  CalibrationResult first = Calibration(input, options, progress).run();
  // What contradicts may have drawn a device to a wrong place, from where right pairs contradict.
  // Without all of them the rig may tell which are wrong.
  const Contradictions contradictions = find_contradictions(input, first);
  if (contradictions.unexplained.empty()) return first;
  CalibrationInput rest = input;
  rest.tracks = without_pairs(input.tracks, contradictions.unexplained);
  if (rest.tracks.empty()) return first;
  CalibrationResult again = Calibration(rest, options, progress).run();
  const bool places_all =
      again.solved && present_devices(again.problem) >= present_devices(first.problem);
  if (!places_all) return first;
  again.pairs = first.pairs;
  if (find_contradictions(input, again).unexplained.size() >= contradictions.unexplained.size())
    return first;
  return again;
}

}  // namespace pencilscan
