#include "pencilscan/calibration/calibrate_once.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pencilscan/bundle/board_corners.h"
#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/priors.h"
#include "pencilscan/bundle/triangulation.h"
#include "pencilscan/bundle/uncertainty.h"
#include "pencilscan/calibration/board_start.h"
#include "pencilscan/calibration/given_values.h"
#include "pencilscan/calibration/pair_fit.h"
#include "pencilscan/calibration/result_errors.h"
#include "pencilscan/calibration/rig_frame.h"
#include "pencilscan/calibration/start_up.h"
#include "pencilscan/calibration/track_errors.h"
#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

constexpr unsigned bit(Intrinsic i) { return 1U << static_cast<unsigned>(i); }
constexpr unsigned kFocal = bit(kFx) | bit(kFy);
constexpr unsigned kCenter = bit(kCx) | bit(kCy);
constexpr unsigned kAll = kFocal | kCenter | bit(kK1) | bit(kK2) | bit(kP1) | bit(kP2) | bit(kK3);

class Calibration {
 public:
  Calibration(const CalibrationInput& input, const CalibrateOptions& options,
              const Progress& progress, const CalibrationResult* start)
      : input_(input), options_(options), progress_(progress), start_(start), rig_(input.rig) {
    known_ = focal_lengths_from_boards(input, rig_);
    result_.tolerance = options.tolerance;
    const bool is_exact = options.tolerance.focal == 0 && options.tolerance.center_px == 0;
    const GivenUse kept = is_exact ? GivenUse::kExact : GivenUse::kTolerance;
    for (const GivenCalibration& k : input.known)
      result_.given.push_back(k.K ? kept : GivenUse::kNone);
  }

  CalibrationResult run() {
    split_tracks();
    say("finding the geometry of pairs", 0);
    result_.pairs = pair_geometries(input_.rig, result_.problem.tracks);
    all_tracks_ = result_.problem.tracks;
    drop_epipolar_outliers(input_.rig, result_.pairs, options_.least_inlier_share,
                           result_.problem.tracks);
    candidates_ = result_.problem.tracks;
    if (start_ != nullptr)
      go_on_from_start();
    else if (!solve_with_given())
      return finish(false);
    take_back_views();
    last_stage();
    return finish(true);
  }

 private:
  void say(const char* what, double fraction) const {
    if (progress_) progress_(what, fraction);
  }

  [[nodiscard]] static std::size_t views(const std::vector<Track>& tracks) {
    std::size_t sum = 0;
    for (const Track& track : tracks) sum += track.views.size() - 1;
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

  [[nodiscard]] bool is_any_given() const {
    return std::any_of(input_.known.begin(), input_.known.end(),
                       [](const GivenCalibration& k) { return k.K; });
  }

  void go_on_from_start() {
    BundleProblem& problem = result_.problem;
    problem.devices = start_->problem.devices;
    problem.board_views = start_->problem.board_views;
    problem.board_poses = start_->problem.board_poses;
    result_.given = start_->given;
    refine();
  }

  /// A structure and its adjustment; given values are off by the tolerance, or rough.
  bool solve(const std::optional<GivenTolerance>& tolerance) {
    say("finding a first structure", 0);
    const StartUp start{input_, rig_, known_, result_.pairs, tolerance, options_.hypotheses};
    if (!find_structure(start, result_.problem)) return false;
    add_projected_corners(input_, result_.problem);
    refine();
    return true;
  }

  /// Given values within their tolerance; where that fails or strains them, also as mere starts,
  /// which count where the data know better.
  bool solve_with_given() {
    if (!is_any_given()) return solve(std::nullopt);
    const CalibrationResult fresh = result_;
    const bool is_solved = solve(options_.tolerance);
    // What is held exactly cannot be pulled, however wrong it is.
    const bool may_show = options_.tolerance.focal > 0 && options_.tolerance.center_px > 0;
    if (is_solved && may_show &&
        present_devices(result_.problem) == result_.problem.devices.size() &&
        !is_any_pulled(input_, options_.tolerance, result_.problem))
      return true;
    CalibrationResult within = std::move(result_);
    result_ = fresh;
    const bool is_freed = solve(std::nullopt) && let_contradicted_go();
    const bool places_more = is_freed && (!is_solved || present_devices(result_.problem) >
                                                            present_devices(within.problem));
    const bool fits_better = is_freed && !places_more && is_any_contradicted() &&
                             present_devices(result_.problem) == present_devices(within.problem) &&
                             misfit(result_.problem) < misfit(within.problem);
    if (places_more || fits_better) return true;
    result_ = std::move(within);
    return is_solved;
  }

  [[nodiscard]] bool is_any_contradicted() const {
    return std::count(result_.given.begin(), result_.given.end(), GivenUse::kContradicted) > 0;
  }

  /// Three quarters of what fundamental matrices left are explained better than this, px.
  [[nodiscard]] double misfit(const BundleProblem& problem) const {
    BundleProblem all;
    all.devices = problem.devices;
    all.tracks = candidates_;
    triangulate_all(all, kLeastAngle);
    std::vector<double> errors;
    for_each_residual(all, [&](std::size_t, const TrackView&, const Vec2& error) {
      errors.push_back(error.norm());
    });
    errors.resize(views(candidates_), std::numeric_limits<double>::infinity());
    return lower_quantile(errors, 0.75);
  }

  /// After given values were mere starts: those that the data contradict say nothing any more, the
  /// others are back in their tolerance.
  bool let_contradicted_go() {
    triangulate_all(result_.problem, kLeastAngle);
    const Uncertainty sigma = uncertainty(result_.problem, result_.adjustment);
    std::vector<char> agrees =
        given_agrees(input_, options_.tolerance, kContradictsDeviations, result_.problem, sigma);
    if (is_contradicted_together(agrees, sigma)) agrees.assign(agrees.size(), 0);
    for (std::size_t d = 0; d < agrees.size(); ++d) {
      if (!input_.known[d].K) continue;
      const bool is_camera = d < input_.rig.cameras.size();
      BundleDevice& device = result_.problem.devices[d];
      if (agrees[d] == 0) {
        result_.given[d] = GivenUse::kContradicted;
        set_priors({}, {}, is_camera, device);
        continue;
      }
      device = within_tolerance(d);
    }
    stage(kAll, options_.stage_tracks, 50);
    triangulate_all(result_.problem, kLeastAngle);
    return true;
  }

  /// A device as found, with the priors of its given values; what a tolerance of 0 holds is as it
  /// was given.
  [[nodiscard]] BundleDevice within_tolerance(std::size_t d) const {
    BundleDevice device = result_.problem.devices[d];
    const BundleDevice found = device;
    device.inner = bundle_device(device_at(input_.rig, d)).inner;
    set_priors(input_.known[d], options_.tolerance, d < input_.rig.cameras.size(), device);
    for (std::size_t i = 0; i < kIntrinsics; ++i)
      if (device.prior_sigma[i] > 0) device.inner[i] = found.inner[i];
    return device;
  }

  /// Whether given values that are held exactly are wrong together, though each alone agrees: a
  /// common error of a ring hides in what the data know of each. By the likelihood ratio, in which
  /// correspondences count as much as they tell: twice what the cost falls by without so many
  /// constraints is, by chance, a sum of as many squares (Wilks 1938).
  [[nodiscard]] bool is_contradicted_together(const std::vector<char>& agrees,
                                              const Uncertainty& sigma) const {
    BundleProblem free = result_.problem;
    BundleProblem held = free;
    double constraints = 0;
    for (std::size_t d = 0; d < agrees.size(); ++d) {
      if (agrees[d] == 0 || !input_.known[d].K || !free.devices[d].present) continue;
      held.devices[d] = within_tolerance(d);
      for (std::size_t i = 0; i < kIntrinsics; ++i)
        if ((kAll >> i & 1U) != 0 && held.devices[d].prior_sigma[i] == 0) ++constraints;
    }
    if (constraints == 0) return false;
    BundleOptions bundle = result_.adjustment;
    bundle.track_weight = sigma.track_weight;
    const double saved = adjust(held, bundle).cost - adjust(free, bundle).cost;
    return normal_deviation(2 * saved / sigma.variance_factor, constraints) >
           kContradictsDeviations;
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
    expect_k3(problem);
  }

  /// What correspondences should count at the solution so far, whose weights may be others.
  [[nodiscard]] double fair_track_weight() const {
    return uncertainty(result_.problem, result_.adjustment).track_weight;
  }

  void drop() {
    BundleProblem& problem = result_.problem;
    drop_corners(problem, options_.outlier_deviations);
    result_.views_dropped +=
        drop_outliers(problem, outlier_limit(problem, options_.outlier_deviations));
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

  /// What fundamental matrices left, and what they dropped although the rig explains it: one that
  /// rests on a plane knows little of what lies off it. A few views more are corners that lenses
  /// bend, or chance: these stay out.
  void take_back_views() {
    constexpr double kLeastShare = 0.02;
    const PairFit fit = pair_fit();
    std::vector<Track> explained = all_tracks_;
    drop_epipolar_outliers(input_.rig, result_.pairs, options_.least_inlier_share, explained, &fit);
    const auto all = static_cast<double>(views(all_tracks_));
    if (static_cast<double>(views(explained) - views(candidates_)) > kLeastShare * all)
      candidates_ = std::move(explained);
    epipolar_outliers_ = views(all_tracks_) - views(candidates_);
  }

  [[nodiscard]] PairFit pair_fit() const {
    return {result_.problem.devices, contradiction_limit(error_scale(result_.problem))};
  }

  /// The prior of an unknown focal length only keeps it from running away. Around a guess that the
  /// data leave far behind it would pull it back: 5 % where the guess is less than half.
  void let_guesses_go() {
    for (std::size_t d = 0; d < result_.problem.devices.size(); ++d) {
      BundleDevice& device = result_.problem.devices[d];
      const bool is_guess = !input_.known[d].K || result_.given[d] == GivenUse::kContradicted;
      const double focal = device.inner[kFx];
      if (!device.present || !is_guess ||
          std::abs(focal - device.prior[kFx]) <= device.prior_sigma[kFx])
        continue;
      device.prior_sigma[kFx] *= focal / device.prior[kFx];
      device.prior[kFx] = focal;
    }
  }

  void last_stage() {
    for (const int round : {0, 1, 2, 3}) {
      let_guesses_go();
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
    if (!solved) return std::move(result_);
    rescale_to_boards(result_.problem);
    take_frame(fix_frame(input_, result_.problem));
    for (std::size_t d = 0; d < result_.placed.size(); ++d) {
      result_.placed[d] = result_.problem.devices[d].present ? 1 : 0;
      if (result_.placed[d] != 0) set_device(result_.problem.devices[d], device_at(result_.rig, d));
    }
    measure_errors(input_, options_, pair_fit(), result_);
    return std::move(result_);
  }

  /// Volume and floor stay where the devices file has them, if its frame is that of the solution.
  void take_frame(const FixedFrame& frame) {
    Rig& rig = result_.rig;
    rig = scaled(std::move(rig), frame.of_given);
    rig.unit_known = frame.is_scaled;
    if (frame.contradicts_given) result_.given_times = frame.of_given;
    result_.board_times = frame.of_board;
    if (frame.is_given) return;
    result_.has_lost_volume = rig.volume.has_value();
    result_.has_lost_floor = rig.floor.has_value();
    rig.volume.reset();
    rig.floor.reset();
  }

  const CalibrationInput& input_;
  const CalibrateOptions& options_;
  const Progress& progress_;
  const CalibrationResult* start_;
  Rig rig_;                            ///< with focal lengths that boards give
  std::vector<char> known_;            ///< per device: K is given, or from boards
  std::vector<Track> all_tracks_;      ///< but those held out
  std::vector<Track> candidates_;      ///< what fundamental matrices, or the rig, left of them
  std::size_t epipolar_outliers_ = 0;  ///< views that they dropped
  CalibrationResult result_;
};

}  // namespace

CalibrationResult calibrate_once(const CalibrationInput& input, const CalibrateOptions& options,
                                 const Progress& progress, const CalibrationResult* start) {
  return Calibration(input, options, progress, start).run();
}

}  // namespace pencilscan
