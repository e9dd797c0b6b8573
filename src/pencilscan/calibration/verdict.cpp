#include "pencilscan/calibration/verdict.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/calibration/given_values.h"
#include "pencilscan/calibration/pair_fit.h"
#include "pencilscan/calibration/scale_deviation.h"
#include "pencilscan/calibration/suspects.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/length_units.h"
#include "pencilscan/core/name_list.h"

namespace pencilscan {
namespace {

constexpr int kCells = 4;
const std::string kOffThePlane =
    "capture an object with depth, or the plane in several poses that differ in tilt (one "
    "--captures each)";

std::string percent(double share) { return formatted(100 * share, "%.3g") + " %"; }

class Judge {
 public:
  Judge(const CalibrationInput& input, const CalibrationResult& result,
        const Uncertainty& uncertainty, const VerdictOptions& options)
      : input_(input), result_(result), uncertainty_(uncertainty), options_(options) {
    double planar = 0;
    double all = 0;
    for (const PairGeometry& pair : result.pairs) {
      planar += pair.planar_share * static_cast<double>(pair.inliers);
      all += static_cast<double>(pair.inliers);
    }
    if (all > 0) planar_share_ = planar / all;
  }

  std::vector<Finding> findings() {
    judge_scene();
    if (!result_.solved) {
      add(Grade::kUnusable,
          "no structure could be found that explains the correspondences" + reason(),
          advice("give rough K of the devices, or captures that overlap more"));
      return std::move(findings_);
    }
    judge_knowledge();
    judge_placement();
    judge_pairs();
    judge_residuals();
    judge_devices();
    judge_volume();
    judge_scale();
    judge_given();
    return std::move(findings_);
  }

 private:
  void add(Grade grade, const std::string& what, const std::string& advice = {}) {
    findings_.push_back({grade, what, advice});
  }
  [[nodiscard]] const std::string& name(std::size_t d) const {
    return device_at(input_.rig, d).name;
  }

  void judge_scene() {
    if (input_.tracks.size() < 100) {
      add(Grade::kUnusable,
          "only " + std::to_string(input_.tracks.size()) + " correspondences were found",
          "check exposure and focus: see the decoding table");
    }
    const bool helped = !result_.problem.board_views.empty();
    if (planar_share_ < options_.planar_share) return;
    add(helped ? Grade::kDoubtful : Grade::kUnusable, "planar scene: " + plane_text(),
        kOffThePlane);
  }

  [[nodiscard]] std::string plane_text() const {
    return "one plane explains " + percent(planar_share_) +
           " of the correspondences, and every rig sees a plane alike";
  }
  /// Why a rig is known weakly, and what helps.
  [[nodiscard]] std::string reason() const {
    return planar_share_ < options_.mostly_planar_share ? "" : ": " + plane_text();
  }
  [[nodiscard]] std::string advice(const std::string& usual) const {
    return planar_share_ < options_.mostly_planar_share ? usual : kOffThePlane + ", or give K";
  }

  /// One fundamental matrix has seven degrees of freedom: the pose takes five.
  void judge_knowledge() {
    if (result_.placed.size() > 2 || !result_.problem.board_views.empty()) return;
    if (input_.known[0].K || input_.known[1].K) return;
    add(Grade::kDoubtful,
        "one camera and one projector without a known K: two views fix two inner parameters, all "
        "others are what is usual",
        "give K of the camera, or add a second camera");
  }

  void judge_placement() {
    for (std::size_t d = 0; d < result_.placed.size(); ++d) {
      if (result_.placed[d] != 0) continue;
      add(Grade::kUnusable,
          name(d) + " shares too few correspondences with the others to be placed",
          "put an object where " + name(d) + " and its neighbours see it");
    }
  }

  void judge_pairs() {
    for (const Finding& finding : find_contradictions(input_, result_).findings)
      findings_.push_back(finding);
    const auto matches = matches_by_pair(input_.tracks);
    const PairFit fit = tolerant_fit(result_);
    for (const PairGeometry& pair : result_.pairs) {
      if (pair.matches < 24 || pair.inlier_share() >= options_.low_inlier_share) continue;
      // Fundamental matrices know no distortion: before a wide lens the rig explains what they do
      // not.
      const auto list = matches.find({pair.camera, pair.projector});
      const double by_rig =
          list == matches.end() ? 0 : fit.share(list->second, pair.camera, pair.projector);
      const double share = std::max(pair.inlier_share(), by_rig);
      if (share >= options_.low_inlier_share) continue;
      add(Grade::kDoubtful,
          "only " + percent(share) + " of the correspondences of " + name(pair.projector) + "/" +
              name(pair.camera) + " fit a rigid scene seen by one camera and one projector",
          "look at these images: something moved, or files are mixed up");
    }
  }

  void judge_residuals() {
    const double rms = result_.rms_px;
    if (rms > options_.good_rms_px) {
      add(rms > options_.usable_rms_px ? Grade::kUnusable : Grade::kDoubtful,
          "the reprojection error is " + formatted(rms) + " px (RMS)",
          "check focus, and that nothing moved while capturing");
    }
    if (result_.held_out_rms_px > 1.5 * rms + 0.05) {
      add(Grade::kDoubtful,
          "correspondences that were held out miss by " + formatted(result_.held_out_rms_px) +
              " px, the others by " + formatted(rms) + " px: the rig fits its own data only",
          "add captures that fill the volume");
    }
    const auto trends = residual_trends(result_);
    for (std::size_t d = 0; d < trends.size(); ++d) {
      double worst = 0;
      for (const TrendCell& cell : trends[d])
        if (cell.views >= 30) worst = std::max(worst, cell.mean.norm());
      if (worst > options_.trend_px)
        add(Grade::kDoubtful,
            "errors of " + name(d) + " point the same way in parts of its image (" +
                formatted(worst) + " px): the lens model does not fit, or it moved",
            "add captures that reach the corners of the image");
    }
  }

  void judge_devices() {
    double& worst = worst_focal_sigma_;
    std::size_t worst_device = 0;
    std::vector<std::string> at_prior;
    for (std::size_t d = 0; d < result_.placed.size(); ++d) {
      if (result_.placed[d] == 0) continue;
      const BundleDevice& device = result_.problem.devices[d];
      const DeviceUncertainty& u = uncertainty_.devices[d];
      const double sigma = u.inner[kFx] / device.inner[kFx];
      if (sigma > worst) {
        worst = sigma;
        worst_device = d;
      }
      for (const std::size_t i : {kFx, kCx, kCy})
        if (u.is_prior[i] && !is_given(d)) at_prior.push_back(name(d) + " " + kIntrinsicNames[i]);
      judge_lens(d);
      const Device& placed = device_at(result_.rig, d);
      const double scale = device.inner[kFx] / placed.width;
      if (scale < 0.3 || scale > 10)
        add(Grade::kUnusable,
            "the focal length of " + name(d) + ", " + formatted(device.inner[kFx], "%.0f") +
                " px, is implausible for an image " + std::to_string(placed.width) + " px wide",
            "give a rough K for it in the devices file");
    }
    if (worst > good_focal_sigma()) {
      add(worst > options_.usable_focal_sigma ? Grade::kUnusable : Grade::kDoubtful,
          "focal lengths are known weakly: that of " + name(worst_device) + " to " +
              percent(worst) + " (one standard deviation)" + reason(),
          advice("add captures with the object moved through the whole volume, or give K of the "
                 "cameras"));
    }
    if (!at_prior.empty()) {
      add(Grade::kDoubtful,
          "the data do not determine " + name_list(at_prior, 6) +
              ": held near what is plausible or was given",
          "add captures with the object moved and turned, or give K");
    }
  }

  /// The tolerance of given K and what the data add to it are independent, and each may be as large
  /// as what is good: a projector is never known better than the cameras that measure it.
  [[nodiscard]] double good_focal_sigma() const {
    const double good = options_.good_focal_sigma;
    const bool is_tolerated =
        std::count(result_.given.begin(), result_.given.end(), GivenUse::kTolerance) > 0;
    return std::hypot(good, is_tolerated ? std::min(good, result_.tolerance.focal) : 0);
  }

  /// Aspect and decentring far from what lenses have: something else is wrong.
  void judge_lens(std::size_t d) {
    const BundleDevice& device = result_.problem.devices[d];
    double worst = 0;
    const char* which = "";
    for (const std::size_t i : {kFy, kP1, kP2, kCx, kK1, kK2, kK3}) {
      // How far a given K moved is told in its tolerances, but for the shape of its pixels.
      if (is_given(d) && (i == kCx || i == kCy)) continue;
      const double sigma = device.prior_sigma[i];
      if (sigma == 0 || !std::isfinite(sigma)) continue;
      const double value = i == kFy ? device.inner[kFy] / device.inner[kFx] : device.inner[i];
      const double pull = std::abs(value - device.prior[i]) / sigma;
      if (pull <= worst) continue;
      worst = pull;
      which = i == kFy ? "fy / fx" : kIntrinsicNames[i];
    }
    if (worst < 3) return;
    const bool has_board = !result_.problem.board_views.empty();
    add(Grade::kDoubtful,
        std::string(which) + " of " + name(d) + " lies " + formatted(worst) +
            " standard deviations from what such devices have" +
            (is_given(d) ? " and from what was given" : "") + ": the data contradict the model",
        std::string("check that nothing moved and that no glass or mirror is in the way") +
            (has_board ? ", and that the board is flat and its squares are square" : "") +
            ", and add captures");
  }

  void judge_volume() {
    if (uncertainty_.volume_radius <= 0) return;
    const double share = uncertainty_.volume_median / uncertainty_.volume_radius;
    if (share <= options_.good_volume_sigma) return;
    const std::string unit = result_.rig.unit_known ? " mm" : "";
    add(share > options_.usable_volume_sigma ? Grade::kUnusable : Grade::kDoubtful,
        "a measured point is off by " + formatted(uncertainty_.volume_median) + unit +
            " (one standard deviation) from the rig's errors alone, scale apart, in a volume of "
            "radius " +
            formatted(uncertainty_.volume_radius, "%.3g") + unit + reason(),
        advice("add captures that fill the volume"));
  }

  void judge_scale() {
    if (!input_.board_views.empty() && result_.problem.board_views.empty())
      add(Grade::kDoubtful, "the board was seen, but not placed: too few correspondences lie on it",
          "let a projector light the board while a camera sees all of it");
    if (!result_.rig.unit_known)
      add(Grade::kGood, "the scale is not known: the rig's unit is \"unknown\"",
          "give --known-distance" + best_pair_text() + ", or a --board");
    judge_scale_deviation();
    if (result_.board_times) judge_board_lengths(*result_.board_times);
    if (result_.given_times) judge_given_lengths(*result_.given_times);
    judge_given_places();
  }

  /// Which distance would fix the scale best, and to what.
  [[nodiscard]] std::string best_pair_text() const {
    const auto best = best_distance(result_, uncertainty_);
    if (!best) return {};
    return " of " + name(best->devices[0]) + " and " + name(best->devices[1]) +
           ", with which lengths are known to " + percent(best->share);
  }

  [[nodiscard]] std::string given_length(const ScaleDeviation& scale) const {
    switch (scale.from) {
      case ScaleDeviation::From::kDistance:
        return "the distance of " + name(scale.devices[0]) + " and " + name(scale.devices[1]);
      case ScaleDeviation::From::kBoard:
        return "the board";
      case ScaleDeviation::From::kPoses:
        return "the given poses";
    }
    return {};
  }

  void judge_scale_deviation() {
    const auto scale = scale_deviation(input_, result_, uncertainty_);
    if (!scale || scale->share <= options_.good_scale_sigma) return;
    const auto best = best_distance(result_, uncertainty_);
    // Deviations are stated to a fifth (docs/calibration.md, "Deviations").
    constexpr double kClearly = 0.8;
    const bool another_helps = best && best->share < kClearly * scale->share;
    const std::string captures = "add captures that fill the volume, or give K of the cameras";
    std::string what_to_do =
        another_helps ? "give --known-distance" + best_pair_text() : advice(captures);
    if (another_helps && best->share > options_.good_scale_sigma) what_to_do += "; " + captures;
    add(Grade::kDoubtful,
        "the scale is known weakly: lengths in the volume to " + percent(scale->share) +
            " (one standard deviation) by " + given_length(*scale) + reason(),
        what_to_do);
  }

  /// Of what is `factor` times as long by `measured` as by `other`: what is too short is in the
  /// larger unit.
  [[nodiscard]] static std::string unit_behind(double factor, const std::string& other,
                                               const std::string& measured) {
    constexpr double kUnitTolerance = 0.1;
    const UnitFactor* unit = unit_behind_factor(std::max(factor, 1 / factor), kUnitTolerance);
    if (unit == nullptr) return {};
    return "; " + (factor > 1 ? other : measured) + " is probably in " + unit->words;
  }

  void judge_board_lengths(double factor) {
    add(Grade::kDoubtful,
        "the known distance and the board contradict each other: by the known distance, which "
        "counts, lengths are " +
            formatted(factor, "%.3g") + " times those by the board" +
            unit_behind(factor, "the board", "the known distance"),
        "measure a square of the board, and the distance of the lenses of these two devices");
  }

  /// A distance or a board against given poses, all in millimetres.
  void judge_given_lengths(double factor) {
    const std::string measured = input_.distance ? "known distance" : "board";
    std::string what = "the " + measured + " and the given poses contradict each other: by the " +
                       measured + ", lengths are " + formatted(factor, "%.3g") +
                       " times those of t. Poses, volume and floor were multiplied by it";
    what += unit_behind(factor, "t", "the " + measured);
    add(Grade::kDoubtful, what, "give the " + measured + " and t in mm");
  }

  void judge_given_places() {
    std::string lost = result_.has_lost_volume ? "volume" : "";
    if (result_.has_lost_floor) lost += lost.empty() ? "floor" : " and floor";
    if (lost.empty()) return;
    add(Grade::kGood,
        lost +
            " of the devices file were left out: fewer than three of its poses are known, so "
            "the rig has a frame of its own",
        "state them in the rig's frame, or give three poses");
  }

  /// A given K within its tolerance.
  [[nodiscard]] bool is_given(std::size_t d) const {
    return result_.given[d] == GivenUse::kTolerance || result_.given[d] == GivenUse::kExact;
  }

  /// The tolerances of given K.
  [[nodiscard]] std::string tolerances() const {
    return percent(result_.tolerance.focal) + ", " + formatted(result_.tolerance.center_px) + " px";
  }

  /// `moved`: tolerances; infinite where there is none.
  [[nodiscard]] std::string how_far_off(std::size_t d, std::size_t intrinsic, double moved) const {
    const std::string what = kIntrinsicNames[intrinsic];
    if (std::isfinite(moved))
      return what + " " + formatted(moved) + " of its tolerances (" + tolerances() + ") off";
    const double stated = bundle_device(device_at(input_.rig, d)).inner[intrinsic];
    return what + " is " + formatted(result_.problem.devices[d].inner[intrinsic], "%.5g") +
           ", and was stated exactly as " + formatted(stated, "%.5g");
  }

  void judge_given() {
    // Before a plane another rig fits as well as the right one, and has another K.
    if (worst_focal_sigma_ > options_.usable_focal_sigma &&
        planar_share_ >= options_.mostly_planar_share) {
      if (std::count(result_.given.begin(), result_.given.end(), GivenUse::kNone) <
          static_cast<std::ptrdiff_t>(result_.given.size()))
        add(Grade::kGood, "given K are not judged: " + plane_text());
      return;
    }
    const std::string unit = tolerances();
    const std::string advice =
        "check that K is of this lens, focus and image size, or say how rough it is "
        "(--focal-tolerance, --center-tolerance)";
    std::string moved_within;
    std::vector<char> within(result_.placed.size(), 0);
    for (std::size_t d = 0; d < result_.placed.size(); ++d) {
      if (result_.given[d] == GivenUse::kNone || result_.placed[d] == 0) continue;
      const BundleDevice& found = result_.problem.devices[d];
      const auto moved = moved_deviations(device_at(input_.rig, d), result_.tolerance, found);
      const auto most =
          static_cast<std::size_t>(std::max_element(moved.begin(), moved.end()) - moved.begin());
      if (is_given(d) && moved[most] <= kContradictsDeviations) {
        if (moved[most] > 0)
          add_name(moved_within,
                   name(d) + " by " + kIntrinsicNames[most] + " " + formatted(moved[most]));
        within[d] = 1;
        continue;
      }
      const bool is_free = result_.given[d] == GivenUse::kContradicted;
      add(Grade::kDoubtful,
          "the data contradict the given K of " + name(d) + ": " +
              how_far_off(d, most, moved[most]) +
              (is_free ? ", so it was only a start" : ", though it was held near it"),
          advice);
    }
    // A single one would be named above.
    const double together = common_pull(input_, within, result_.tolerance, result_.problem);
    if (together > kContradictsDeviations)
      add(Grade::kDoubtful,
          "the data contradict the given K together: that all are off by as much is as unlikely "
          "as " +
              formatted(together) +
              " standard deviations, though each alone is near its tolerance (" + unit + ")",
          advice);
    if (moved_within.empty() && std::count(within.begin(), within.end(), 1) > 0)
      add(Grade::kGood, "given K were kept exactly");
    if (!moved_within.empty())
      add(Grade::kGood,
          "given K were kept; they moved, in their tolerances (" + unit + "): " + moved_within);
  }

  const CalibrationInput& input_;
  const CalibrationResult& result_;
  const Uncertainty& uncertainty_;
  const VerdictOptions& options_;
  double planar_share_ = 0;       ///< of the correspondences of all pairs
  double worst_focal_sigma_ = 0;  ///< over the focal length
  std::vector<Finding> findings_;
};

}  // namespace

std::string to_string(Grade grade) {
  switch (grade) {
    case Grade::kGood:
      return "good";
    case Grade::kDoubtful:
      return "doubtful";
    case Grade::kUnusable:
      return "unusable";
  }
  return "unknown";
}

std::vector<std::vector<TrendCell>> residual_trends(const CalibrationResult& result) {
  std::vector<std::vector<TrendCell>> trends(result.placed.size(),
                                             std::vector<TrendCell>(kCells * kCells));
  const auto cell_of = [](double x, int size) {
    return std::clamp(static_cast<int>((x + 0.5) * kCells / size), 0, kCells - 1);
  };
  for_each_residual(result.problem, [&](std::size_t, const TrackView& view, const Vec2& error) {
    const Device& device = device_at(result.rig, view.device);
    TrendCell& at = trends[view.device][static_cast<std::size_t>(
        kCells * cell_of(view.pixel.y(), device.height) + cell_of(view.pixel.x(), device.width))];
    ++at.views;
    at.mean += error;
  });
  for (auto& cells : trends)
    for (TrendCell& cell : cells)
      if (cell.views > 0) cell.mean /= cell.views;
  return trends;
}

Verdict judge(const CalibrationInput& input, const CalibrationResult& result,
              const Uncertainty& uncertainty, std::vector<Finding> found_before,
              const VerdictOptions& options) {
  Verdict verdict;
  verdict.findings = std::move(found_before);
  for (Finding& finding : Judge(input, result, uncertainty, options).findings())
    verdict.findings.push_back(std::move(finding));
  std::stable_sort(verdict.findings.begin(), verdict.findings.end(),
                   [](const Finding& a, const Finding& b) { return a.grade > b.grade; });
  for (const Finding& finding : verdict.findings)
    verdict.grade = std::max(verdict.grade, finding.grade);
  return verdict;
}

}  // namespace pencilscan
