#include "pencilscan/pipeline/picture_check.h"

#include <algorithm>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/pipeline/cut_lines.h"
#include "pencilscan/pipeline/line_contrast.h"
#include "pencilscan/pipeline/picture_trial.h"
#include "pencilscan/pipeline/shown_lines.h"
#include "pencilscan/pipeline/view_agreement.h"
#include "pencilscan/points/settle.h"
#include "pencilscan/rig/camera_light.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {
namespace {

constexpr double kFarLess = 0.5;  // of what the other cameras have
constexpr double kFarMore = 2;    // of what the picture as it is has, alone
constexpr double kFewer = 0.75;   // of the others' usual share: a second sign of a wrong picture
constexpr double kPlainContradiction = 0.25;  // agreement (view_agreement.h)
constexpr std::size_t kFewPoints = 20;  // right ones, .6 each, contradict so plainly once in 3000

cv::Mat flipped(const cv::Mat& picture, int code) {
  cv::Mat result;
  cv::flip(picture, result, code);
  return result;
}

cv::Mat with_red_for_blue(const cv::Mat& picture) {
  cv::Mat result;
  cv::cvtColor(picture, result, cv::COLOR_RGB2BGR);
  return result;
}

/// Undoes what may have happened to a picture.
struct Remedy {
  PictureFault fault;
  std::function<cv::Mat(const cv::Mat&)> undo;
};

const std::vector<Remedy>& remedies() {
  static const std::vector<Remedy> all = {
      {PictureFault::kRedBlueExchanged, with_red_for_blue},
      {PictureFault::kTurned, [](const cv::Mat& p) { return flipped(p, -1); }},
      {PictureFault::kMirrored, [](const cv::Mat& p) { return flipped(p, 1); }},
      {PictureFault::kUpsideDown, [](const cv::Mat& p) { return flipped(p, 0); }}};
  return all;
}

/// A camera that may have a wrong picture.
struct Suspect {
  std::size_t camera = 0;
  double share = 0;  ///< named of its own picture, among the others
  double alone = 0;  ///< the same, without the others
  ShownLines shown;
  cv::Mat light;
  PictureFinding best;
  double best_named = 0;
};

/// `left_out`: cameras whose pictures are plainly wrong.
std::vector<PictureFinding> misfits(const Rig& rig, const Frame& frame,
                                    std::span<const std::size_t> cameras,
                                    std::span<const char> left_out) {
  if (cameras.empty()) return {};
  const std::vector<double> contrasts = line_contrasts(rig, frame, left_out);
  std::vector<PictureFinding> findings;
  for (const std::size_t c : cameras) {
    findings.push_back({PictureFault::kDoesNotFit, static_cast<int>(c)});
    findings.back().contrast = contrasts[c];
  }
  return findings;
}

/// Without the points of one projector no views are in doubt, and what this camera still measures
/// agrees with the others: the projector is what is wrong. Of two projectors either may be right,
/// and a camera that moved along the lines of one contradicts by those of the other alone.
bool is_fault_of_projector(const Rig& rig, const std::vector<std::vector<MeasuredPoint>>& points,
                           std::size_t camera) {
  constexpr double kAgrees = 0.5;  // below it views are in doubt (view_agreement.cpp)
  if (rig.projectors.size() < 3) return false;
  for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
    std::vector<std::vector<MeasuredPoint>> of_others = points;
    for (auto& of_camera : of_others)
      std::erase_if(of_camera, [&](const MeasuredPoint& x) {
        return static_cast<std::size_t>(x.projector) == p;
      });
    const ViewAgreement agreement(rig, of_others);
    const PairAgreement said = agreement.with_others(camera);
    if (said.same + said.apart >= kFewPoints && said.share() >= kAgrees &&
        agreement.doubtful_pairs() == 0)
      return true;
  }
  return false;
}

/// The two of the doubtful cameras whose pictures contradict nothing where the other one stands, if
/// there are no other two. `points`: what each measured.
std::optional<std::pair<int, int>> exchanged_pair(
    const Rig& rig, const Frame& frame, const std::vector<std::vector<MeasuredPoint>>& points,
    const std::vector<std::size_t>& doubtful, const PointOptions& options) {
  const PictureTrial trial(rig, options);
  std::vector<cv::Mat> light(rig.cameras.size());
  for (const std::size_t c : doubtful) light[c] = linear_light(rig.cameras[c], frame.images[c]);
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (const std::size_t a : doubtful) {
    for (const std::size_t b : doubtful) {
      if (a < b && light[a].size() == light[b].size()) pairs.emplace_back(a, b);
    }
  }
  std::vector<char> agrees(pairs.size(), 0);
  parallel_for(pairs.size(), [&](std::size_t i) {
    const auto [a, b] = pairs[i];
    std::vector<std::vector<MeasuredPoint>> exchanged = points;
    exchanged[a] = trial.points(a, light[b]);
    exchanged[b] = trial.points(b, light[a]);
    const bool is_measured =
        2 * exchanged[a].size() > points[b].size() && 2 * exchanged[b].size() > points[a].size();
    agrees[i] = is_measured && ViewAgreement(rig, exchanged).doubtful_pairs() == 0 ? 1 : 0;
  });
  if (std::count(agrees.begin(), agrees.end(), 1) != 1) return std::nullopt;
  const auto i = std::find(agrees.begin(), agrees.end(), 1) - agrees.begin();
  const auto [a, b] = pairs[static_cast<std::size_t>(i)];
  return std::pair(static_cast<int>(a), static_cast<int>(b));
}

/// Cameras of which too few curves got a name, and the rest, that have enough.
struct Suspects {
  std::vector<Suspect> cameras;
  std::vector<Suspect> rest;
};

Suspects suspects_of(const Rig& rig, const Frame& frame, const Labeling& labeling) {
  Suspects found;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const TellingPoints points = telling_points(labeling, c);
    if (frame.images[c].empty() || !points.are_enough()) continue;
    Suspect camera;
    camera.camera = c;
    camera.share = points.named_share();
    (camera.share >= kFewNamed ? found.rest : found.cameras).push_back(std::move(camera));
  }
  return found;
}

/// What each picture would have to be, in whose place, to get names as the others do; `usual`: the
/// share of the others.
void try_remedies(const PictureTrial& trial, double usual, std::vector<Suspect>& suspects) {
  const auto consider = [&](Suspect& s, const PictureFinding& finding, const TellingPoints& of) {
    const double named = of.named_share();
    if (!of.are_enough() || named <= s.best_named || named < kFarMore * s.alone ||
        named < kFarLess * usual)
      return;
    s.best = finding;
    s.best_named = named;
  };
  for (Suspect& s : suspects) {
    for (const Remedy& remedy : remedies()) {
      if (s.shown.fits() && remedy.fault != PictureFault::kRedBlueExchanged) continue;
      consider(s, {remedy.fault, static_cast<int>(s.camera), -1},
               trial.telling_points(s.camera, remedy.undo(s.light)));
    }
    for (const Suspect& other : suspects) {
      if (s.shown.fits() || other.camera == s.camera || other.light.size() != s.light.size())
        continue;
      consider(
          s, {PictureFault::kExchanged, static_cast<int>(s.camera), static_cast<int>(other.camera)},
          trial.telling_points(other.camera, s.light));
    }
  }
}

/// The picture by itself: its light, and what gets names without the others.
void look_at_alone(const Rig& rig, const Frame& frame, const PictureTrial& trial, Suspect& s) {
  s.light = linear_light(rig.cameras[s.camera], frame.images[s.camera]);
  s.alone = trial.telling_points(s.camera, s.light).named_share();
}

/// A fault that no fewer pictures have than there are others may be that of all of them: wrong ones
/// get names by chance, too. Finds it in those of the others that get more once it is undone;
/// whether they show what the others measured (ShownLines) says nothing once most are wrong.
/// `rest`: the cameras that were no suspects.
void find_shared_fault(const Rig& rig, const Frame& frame, const PictureTrial& trial,
                       std::vector<Suspect>& suspects, std::vector<Suspect>& rest) {
  for (const Remedy& remedy : remedies()) {
    std::vector<double> named;
    std::vector<Suspect*> others;
    for (Suspect& s : suspects) {
      if (s.best_named == 0)
        others.push_back(&s);
      else if (s.best.fault == remedy.fault)
        named.push_back(s.best_named);
    }
    for (Suspect& s : rest)
      if (s.best_named == 0) others.push_back(&s);
    if (named.size() < 2 || named.size() < others.size()) continue;
    const double usual = upper_median(std::move(named));
    parallel_for(others.size(), [&](std::size_t i) {
      Suspect& s = *others[i];
      if (s.light.empty()) look_at_alone(rig, frame, trial, s);
      const TellingPoints undone = trial.telling_points(s.camera, remedy.undo(s.light));
      const double share = undone.named_share();
      if (!undone.are_enough() || share <= s.alone || share < kFarLess * usual) return;
      s.best = {remedy.fault, static_cast<int>(s.camera), -1};
      s.best_named = share;
    });
  }
}

/// What other cameras say of a picture few of whose curves have names.
enum class OthersSay { kFits, kNothing, kDoesNotFit };

/// `said`: of what it measures, and of what the others measured.
OthersSay others_say(const Suspect& s, double usual, const PairAgreement& said) {
  const bool is_told = said.same + said.apart >= kFewPoints;
  const bool is_contradicted = is_told && said.share() < kPlainContradiction;
  const bool is_confirmed = is_told && said.share() > 1 - kPlainContradiction;
  const bool has_far_fewer = s.share < kFarLess * usual;
  // Lines that lie along a camera's way stay on each other, so that it shows many of them from
  // where it does not stand; what it measures then lies in front of what the others did.
  if (has_far_fewer && is_contradicted) return OthersSay::kDoesNotFit;
  if (s.shown.fits()) return OthersSay::kFits;
  // Where what it measures lies where the others measured it, that it does not show their lines is
  // the fault of these: of a projector that is off, say.
  return has_far_fewer && s.shown.misfits() && !is_confirmed ? OthersSay::kDoesNotFit
                                                             : OthersSay::kNothing;
}

/// What the other cameras measured goes on beyond the volume.
bool others_see_beyond_volume(const Rig& rig, const PointResult& found, std::size_t camera) {
  CutLines others;
  for (std::size_t c = 0; c < found.graphs.size(); ++c) {
    if (c == camera) continue;
    const CutLines lines = cut_lines(rig, {&found.graphs[c], 1}, found.labeling);
    others.inside += lines.inside;
    others.cut += lines.cut;
  }
  return others.are_many();
}

/// The picture gets names as the others do once the volume is larger: what this camera sees lies
/// beyond that of the rig.
bool fits_larger_volume(const Rig& rig, const PointResult& found, const Suspect& suspect,
                        double usual, const PointOptions& options) {
  constexpr double kLarger = 2;
  if (!rig.volume || !others_see_beyond_volume(rig, found, suspect.camera)) return false;
  Rig larger = rig;
  larger.volume->radius *= kLarger;
  const TellingPoints points =
      PictureTrial(larger, options).telling_points(suspect.camera, suspect.light);
  return points.are_enough() && points.named_share() >= kFarMore * suspect.alone &&
         points.named_share() >= kFarLess * usual;
}

}  // namespace

std::string describe(const Rig& rig, const PictureFinding& finding) {
  const auto mosaics = [](const PictureFinding& of) {
    return of.greens == Greens::kOdd ? "RGGB or BGGR" : "GRBG or GBRG";
  };
  const auto name = [&](int camera) { return rig.camera(camera).name; };
  const std::string who = "camera " + name(finding.camera) + ": its picture ";
  const std::string out = "; reconstructed without it";
  switch (finding.fault) {
    case PictureFault::kBlack:
      return who + "is black: no projector's light is in it" + out;
    case PictureFault::kGrey:
      return who + "is grey, and lines are told apart by colour: take it in colour" + out;
    case PictureFault::kUnstatedMosaic:
      return who + "has one colour a pixel: state the \"mosaic\" of the camera, " +
             mosaics(finding) + out;
    case PictureFault::kOtherMosaic:
      return who + "is not that of its mosaic in the rig: its green samples are those of " +
             mosaics(finding) + ", or the camera mirrors it" + out;
    case PictureFault::kRepeated:
      return who + "is the same as camera " + name(finding.other) + "'s: one of them is a copy" +
             out;
    case PictureFault::kRedBlueExchanged:
      return who + "has red and blue exchanged (BGR for RGB): store it as RGB" +
             (rig.camera(finding.camera).mosaic
                  ? ", or state the \"mosaic\" of raw pictures with R for B"
                  : "") +
             out;
    case PictureFault::kExchanged:
      return who + "is that of camera " + name(finding.other) + ": exchange their files" + out;
    case PictureFault::kTurned:
      return who + "is turned by half a turn: turn it back, or calibrate it as it is" + out;
    case PictureFault::kMirrored:
      return who + "is mirrored, left for right" + out;
    case PictureFault::kUpsideDown:
      return who + "is mirrored, top for bottom" + out;
    case PictureFault::kDoesNotFit:
      break;
  }
  const std::string misfit = "does not fit the rig as the others' do: ";
  if (is_out_of_focus(finding.contrast))
    return who + misfit + "its lines stand out " + times_less(finding.contrast) +
           " than theirs, so it is out of focus, or its lens is fogged or covered" + out;
  return who + misfit + "the camera was moved, or the picture is of another moment or rig" + out;
}

std::vector<PictureFinding> misplaced_pictures(const Rig& rig, const Frame& frame,
                                               const PointResult& found,
                                               const PointOptions& options) {
  Suspects asked = suspects_of(rig, frame, found.labeling);
  std::vector<Suspect>& suspects = asked.cameras;
  if (suspects.empty()) return {};
  const auto points = points_by_camera(rig, some_points(rig, found));
  const std::size_t others = asked.rest.size();
  std::vector<double> of_others;
  for (const Suspect& s : asked.rest) of_others.push_back(s.share);
  const double usual = others == 0 ? 2 * kFewNamed : upper_median(std::move(of_others));
  const PictureTrial trial(rig, options);
  parallel_for(suspects.size(), [&](std::size_t i) {
    Suspect& s = suspects[i];
    look_at_alone(rig, frame, trial, s);
    s.shown = shown_lines(rig, found.families, found.graphs[s.camera], points);
  });
  try_remedies(trial, usual, suspects);
  find_shared_fault(rig, frame, trial, suspects, asked.rest);
  const ViewAgreement agreement(rig, points);
  std::vector<PictureFinding> findings;
  for (const Suspect& s : asked.rest)
    if (s.best_named > 0) findings.push_back(s.best);
  std::vector<std::size_t> unfit;
  std::size_t fit = others;
  for (const Suspect& s : suspects) {
    const OthersSay said = others_say(s, usual, agreement.with_others(s.camera));
    if (s.best_named > 0) {
      findings.push_back(s.best);
    } else if (said == OthersSay::kFits) {
      ++fit;
    } else if (said == OthersSay::kDoesNotFit &&
               !fits_larger_volume(rig, found, s, usual, options)) {
      unfit.push_back(s.camera);
    }
  }
  // Where most do not fit, their pictures are not what is wrong.
  if (unfit.size() < fit) {
    const std::vector<PictureFinding> all = misfits(rig, frame, unfit, found.left_out);
    findings.insert(findings.end(), all.begin(), all.end());
  }
  std::stable_sort(
      findings.begin(), findings.end(),
      [](const PictureFinding& a, const PictureFinding& b) { return a.camera < b.camera; });
  return findings;
}

std::vector<PictureFinding> contradicting_pictures(const Rig& rig, const Frame& frame,
                                                   const PointResult& found,
                                                   const PointOptions& options) {
  const std::size_t count = rig.cameras.size();
  std::vector<std::vector<MeasuredPoint>> points = points_by_camera(rig, some_points(rig, found));
  const ViewAgreement agreement(rig, points);
  const auto shown = [&](std::size_t c) {
    return shown_lines(rig, found.families, found.graphs[c], points);
  };
  std::vector<std::size_t> doubtful = agreement.doubtful_cameras();
  std::erase_if(doubtful, [&](std::size_t c) { return shown(c).fits(); });
  if (doubtful.empty()) return {};

  if (const auto pair = exchanged_pair(rig, frame, points, doubtful, options)) {
    const auto [a, b] = *pair;
    return {{PictureFault::kExchanged, a, b}, {PictureFault::kExchanged, b, a}};
  }

  // One camera alone against the others: the one that agrees least, if nothing is left without it.
  const auto share = [&](std::size_t c) { return agreement.with_others(c).share(); };
  const std::size_t alone =
      *std::min_element(doubtful.begin(), doubtful.end(),
                        [&](std::size_t a, std::size_t b) { return share(a) < share(b); });
  std::vector<double> of_others;
  for (std::size_t c = 0; c < count; ++c)
    if (c != alone && !points[c].empty())
      of_others.push_back(telling_points(found.labeling, c).named_share());
  // Without a second sign, such as few names, the contradiction must be plain.
  const double named = telling_points(found.labeling, alone).named_share();
  const bool is_plain = share(alone) < kPlainContradiction || shown(alone).misfits() ||
                        named < kFewer * upper_median(std::move(of_others));
  if (count < 3 || !is_plain || is_fault_of_projector(rig, points, alone)) return {};
  points[alone].clear();
  if (ViewAgreement(rig, points).doubtful_pairs() > 0) return {};
  return misfits(rig, frame, {&alone, 1}, found.left_out);
}

bool points_lie_on_lines(const Rig& rig, const PointResult& found) {
  const auto points = points_by_camera(rig, some_points(rig, found));
  std::size_t fit = 0;
  for (const GridGraph& graph : found.graphs) {
    const ShownLines shown = shown_lines(rig, found.families, graph, points);
    if (shown.tells() && !shown.fits()) return false;
    fit += shown.fits() ? 1U : 0U;
  }
  return fit >= 2;
}

}  // namespace pencilscan
