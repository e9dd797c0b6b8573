#include "pencilscan/calibration/verdict.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/calibration/flat_scene.h"
#include "pencilscan/calibration/given_findings.h"
#include "pencilscan/calibration/mirrored.h"
#include "pencilscan/calibration/pair_fit.h"
#include "pencilscan/calibration/scale_findings.h"
#include "pencilscan/calibration/suspects.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/name_list.h"

namespace pencilscan {
namespace {

constexpr int kCells = 4;
class Judge {
 public:
  Judge(const CalibrationInput& input, const CalibrationResult& result,
        const Uncertainty& uncertainty, const VerdictOptions& options)
      : input_(input),
        result_(result),
        uncertainty_(uncertainty),
        options_(options),
        scene_(flat_scene(result, options)) {}

  /// `found_before`: what explains that devices have no place.
  std::vector<Finding> findings(const std::vector<Finding>& found_before) {
    for (const Finding& finding : found_before)
      explained_.insert(finding.explains.begin(), finding.explains.end());
    if (explained_.size() == result_.placed.size()) return {};  // nothing is left to judge
    if (result_.mirrored) return {mirrored_finding(input_.rig, *result_.mirrored)};
    judge_scene();
    if (!result_.solved) {
      add(Grade::kUnusable,
          "no structure could be found that explains the correspondences" + scene_.reason(),
          scene_.advice("give rough K of the devices, or captures that overlap more"));
      return std::move(findings_);
    }
    judge_knowledge();
    judge_placement();
    judge_pairs();
    judge_residuals();
    judge_devices();
    judge_volume();
    add_all(scale_findings(input_, result_, uncertainty_, scene_, options_));
    judge_given();
    return std::move(findings_);
  }

 private:
  void add(Grade grade, const std::string& what, const std::string& advice = {}) {
    findings_.push_back({grade, what, advice});
  }
  void add_all(const std::vector<Finding>& findings) {
    findings_.insert(findings_.end(), findings.begin(), findings.end());
  }
  [[nodiscard]] const std::string& name(std::size_t d) const {
    return device_at(input_.rig, d).name;
  }

  void judge_scene() {
    if (input_.tracks.size() < 100) {
      add(Grade::kUnusable,
          "only " + std::to_string(input_.tracks.size()) + " correspondences were found",
          "check that the object fills a good part of the pictures, exposure and focus: see the "
          "decoding table");
    }
    const bool helped = !result_.problem.board_views.empty();
    if (scene_.share < options_.planar_share) return;
    add(helped ? Grade::kDoubtful : Grade::kUnusable, "planar scene: " + scene_.text(),
        kLeaveThePlane);
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
      if (result_.placed[d] != 0 || explained_.contains(d)) continue;
      const bool has_any =
          std::any_of(input_.tracks.begin(), input_.tracks.end(), [&](const Track& track) {
            return std::any_of(track.views.begin(), track.views.end(),
                               [&](const TrackView& view) { return view.device == d; });
          });
      if (!has_any) {
        add(Grade::kUnusable,
            name(d) +
                " has no correspondence with any other device: its pictures are missing, or "
                "nothing in them was decoded",
            "see the decoding table: a pair that is not in it has no folder");
        continue;
      }
      add(Grade::kUnusable,
          name(d) + " shares too few correspondences with the others to be placed",
          "put an object where " + name(d) + " and its neighbours see it");
    }
  }

  /// A pair whose correspondences fit no rigid scene, and the share that does.
  struct LowPair {
    const PairGeometry* pair;
    double share;
  };

  /// A device that none of the others fits, while these fit each other, and that did not just move
  /// between captures: its place is what wrong codes make of it.
  void judge_codes(const std::vector<LowPair>& low, const std::vector<const PairGeometry*>& sound,
                   const std::vector<CaptureMove>& moved) {
    if (sound.empty()) return;
    const auto is_of = [](const PairGeometry& pair, std::size_t d) {
      return pair.camera == d || pair.projector == d;
    };
    for (std::size_t d = 0; d < result_.placed.size(); ++d) {
      double most = 0;
      std::size_t count = 0;
      for (const LowPair& l : low) {
        if (!is_of(*l.pair, d)) continue;
        most = std::max(most, l.share);
        ++count;
      }
      const bool fits_any =
          std::any_of(sound.begin(), sound.end(), [&](const auto* p) { return is_of(*p, d); });
      const bool has_moved = std::any_of(moved.begin(), moved.end(),
                                         [&](const CaptureMove& m) { return m.device == d; });
      if (count < 2 || fits_any || has_moved) continue;
      senseless_.insert(d);
      add(Grade::kUnusable,
          "the codes of " + name(d) + " make no sense: with none of " + std::to_string(count) +
              (d < input_.rig.cameras.size() ? " projectors" : " cameras") + " more than " +
              share_text(most) + " of its correspondences fit a rigid scene",
          "look at its images: bits may be in the wrong order, or it moved while it was captured");
    }
  }

  void add_scene_move(const SceneMove& move) {
    add(Grade::kDoubtful,
        "the object moved while --captures number " + std::to_string(move.capture + 1) +
            " was taken: between the pictures of " + name(move.a) + " and those of " +
            name(move.b) + " its surface shifts by " + formatted(move.shift) + " " +
            unit_name(result_.rig) + " (median, along the cameras' rays)",
        "fix the object, and take that capture again");
  }

  void judge_pairs() {
    Contradictions contradictions = find_contradictions(input_, result_);
    std::vector<LowPair> low;
    std::vector<const PairGeometry*> sound;
    // What stood in the wrong folder says nothing against the rest.
    const auto matches = matches_by_pair(without_pairs(input_.tracks, contradictions.swapped));
    const PairFit fit = tolerant_fit(result_);
    for (const PairGeometry& pair : result_.pairs) {
      if (pair.matches < 24) continue;
      if (pair.inlier_share() >= options_.low_inlier_share) {
        sound.push_back(&pair);
        continue;
      }
      // Fundamental matrices know no distortion: before a wide lens the rig explains what they do
      // not.
      const auto list = matches.find({pair.camera, pair.projector});
      if (list == matches.end()) continue;
      const double by_rig = fit.share(list->second, pair.camera, pair.projector);
      const double share = std::max(pair.inlier_share(), by_rig);
      if (share >= options_.low_inlier_share)
        sound.push_back(&pair);
      else
        low.push_back({&pair, share});
    }
    judge_codes(low, sound, contradictions.moves.clear);
    if (contradictions.mover && senseless_.contains(*contradictions.mover))
      contradictions.findings.pop_back();
    add_all(contradictions.findings);
    for (const SceneMove& move : result_.scene_moves) add_scene_move(move);
    for (const LowPair& l : low) {
      if (senseless_.contains(l.pair->camera) || senseless_.contains(l.pair->projector)) continue;
      add(Grade::kDoubtful,
          "only " + share_text(l.share) + " of the correspondences of " + name(l.pair->projector) +
              "/" + name(l.pair->camera) +
              " fit a rigid scene seen by one camera and one projector",
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
        if (u.is_prior[i] && !is_given(result_, d))
          at_prior.push_back(name(d) + " " + kIntrinsicNames[i]);
      if (!senseless_.contains(d)) judge_lens(d);
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
              share_text(worst) + " (one standard deviation)" + scene_.reason(),
          scene_.advice(
              "add captures with the object moved through the whole volume, or give K of the "
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
      if (is_given(result_, d) && (i == kCx || i == kCy)) continue;
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
            (is_given(result_, d) ? " and from what was given" : "") +
            ": the data contradict the model",
        std::string("check that nothing moved and that no glass or mirror is in the way") +
            (has_board ? ", and that the board is flat and its squares are square" : "") +
            ", and add captures");
  }

  void judge_given() {
    // Before a plane another rig fits as well as the right one, and has another K.
    const bool is_any_other =
        worst_focal_sigma_ > options_.usable_focal_sigma && scene_.is_mostly_flat;
    if (!is_any_other) {
      add_all(given_findings(input_, result_));
    } else if (std::count(result_.given.begin(), result_.given.end(), GivenUse::kNone) <
               static_cast<std::ptrdiff_t>(result_.given.size())) {
      add(Grade::kGood, "given K are not judged: " + scene_.text());
    }
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
            formatted(uncertainty_.volume_radius, "%.3g") + unit + scene_.reason(),
        scene_.advice("add captures that fill the volume"));
  }

  const CalibrationInput& input_;
  const CalibrationResult& result_;
  const Uncertainty& uncertainty_;
  const VerdictOptions& options_;
  FlatScene scene_;
  std::set<std::size_t> explained_;  ///< devices of which nothing is left, as was told before
  std::set<std::size_t> senseless_;  ///< devices whose correspondences fit no other's
  double worst_focal_sigma_ = 0;     ///< over the focal length
  std::vector<Finding> findings_;
};

}  // namespace

std::vector<std::string> Verdict::reasons() const {
  std::vector<std::string> reasons;
  if (grade == Grade::kGood) return reasons;
  for (const Finding& finding : findings)
    if (finding.grade == grade) reasons.push_back(finding.what);
  return reasons;
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
  std::vector<Finding> found = Judge(input, result, uncertainty, options).findings(found_before);
  verdict.findings = std::move(found_before);
  for (Finding& finding : found) verdict.findings.push_back(std::move(finding));
  std::stable_sort(verdict.findings.begin(), verdict.findings.end(),
                   [](const Finding& a, const Finding& b) { return a.grade > b.grade; });
  for (const Finding& finding : verdict.findings)
    verdict.grade = std::max(verdict.grade, finding.grade);
  return verdict;
}

}  // namespace pencilscan
