#include "pencilscan/pipeline/picture_check.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/pipeline/view_agreement.h"
#include "pencilscan/points/triangulate.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {
namespace {

/// Light of a picture in blocks of 8 x 8 px is above its noise by less than this many deviations:
/// of 20,000 blocks of noise alone, the largest lies 4 above the median.
constexpr double kBlackDeviations = 6;

// Right pictures have .58 and more named (an object on a lit floor between walls), wrong ones .21
// and less.
constexpr double kFew = 0.4;
constexpr double kFarLess = 0.5;  // of what the other cameras have
constexpr double kFarMore = 2;    // of what the picture as it is has, alone
constexpr std::size_t kLeastPoints = 500;
constexpr double kFewer = 0.75;  // of the others' usual share: a second sign of a wrong picture
constexpr double kPlainContradiction = 0.25;  // agreement (view_agreement.h)

// Projectors that show each other's patterns, docs/sensors.md. With the right patterns the poorest
// cameras have more names, about 1.2 times as many and more; exchanging two that stand right takes
// names away.
constexpr double kClearlyMore = 1.1;
constexpr double kHardly = 0.25;  // of the projector with most names; exchanged ones have .05
constexpr std::size_t kTellingCameras = 3;

/// Every eighth row, which tells as much of what a whole picture is; shares the pixels.
cv::Mat some_rows(const cv::Mat& picture) {
  return {picture.rows / 8, picture.cols, picture.type(), picture.data, 8 * picture.step};
}

/// Mean absolute difference of neighbours in a row, as a deviation of one pixel (Gaussian noise:
/// E|d| = 2 sigma / sqrt(pi)). Lines raise it, which only makes the rule for black stricter.
double pixel_noise(const cv::Mat& grey) {
  const cv::Mat left = grey.colRange(0, grey.cols - 2);
  const cv::Mat right = grey.colRange(2, grey.cols);  // the same colour of a mosaic
  return cv::norm(left, right, cv::NORM_L1) / static_cast<double>(left.total()) * std::sqrt(M_PI) /
         2;
}

bool is_black(const cv::Mat& picture) {
  constexpr int kBlock = 8;
  if (picture.cols < 4 * kBlock || picture.rows < 4 * kBlock) return false;
  const auto grey = [](const cv::Mat& rgb) {
    cv::Mat sum = rgb;
    if (rgb.channels() == 3) cv::transform(rgb, sum, cv::Matx13f(1, 1, 1));
    return sum;
  };
  cv::Mat blocks;
  cv::resize(picture, blocks, {picture.cols / kBlock, picture.rows / kBlock}, 0, 0, cv::INTER_AREA);
  blocks = grey(blocks);
  std::vector<float> values(blocks.begin<float>(), blocks.end<float>());
  const float brightest = *std::max_element(values.begin(), values.end());
  const float usual = upper_median(std::move(values));
  return static_cast<double>(brightest - usual) <=
         kBlackDeviations * pixel_noise(grey(some_rows(picture))) / kBlock;
}

bool needs_color(const Rig& rig) {
  const std::vector<ColorFamily> families = color_families(rig);
  return families.size() > 1 || (families.size() == 1 && families[0].colors.size() > 1);
}

bool is_grey(const cv::Mat& picture) {
  if (picture.channels() != 3) return false;
  constexpr float kStep = 2.5F / 255;  // JPEG's rounding of its colour differences
  constexpr float kFaint = 0.05F;      // of the brightest: colours of a dark picture are small
  const cv::Mat rows = some_rows(picture);
  std::vector<cv::Mat> rgb;
  cv::split(rows, rgb);
  double brightest = 0;
  cv::minMaxLoc(rgb[1], nullptr, &brightest);
  const double step = std::min(kStep, kFaint * static_cast<float>(brightest));
  const cv::Mat colorful = (cv::abs(rgb[0] - rgb[1]) > step) | (cv::abs(rgb[2] - rgb[1]) > step);
  return cv::countNonZero(colorful) * 1000 < static_cast<int>(rows.total());
}

bool is_same(const cv::Mat& a, const cv::Mat& b) {
  const auto equal = [](const cv::Mat& x, const cv::Mat& y) {
    return cv::norm(x, y, cv::NORM_INF) == 0;
  };
  return a.size() == b.size() && a.type() == b.type() &&
         equal(a.row(a.rows / 2), b.row(b.rows / 2)) && equal(a, b);
}

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

/// Share of a camera's curve points that have a name, of those that a right picture could have
/// named: what nothing crosses, or lies outside the volume (walls, people), says nothing.
double named_share(const Labeling& labeling, std::size_t c) {
  const std::size_t named = labelled_points(labeling.runs[c]);
  const auto undecided = undecided_points(labeling.undecided[c], labeling.runs[c]);
  const std::size_t unnamed = undecided[static_cast<std::size_t>(UndecidedReason::kAmbiguous)] +
                              undecided[static_cast<std::size_t>(UndecidedReason::kContradicted)];
  if (named == 0) return 0;
  return static_cast<double>(named) / static_cast<double>(named + unnamed);
}

/// Of every seventh pixel of the curves.
std::vector<MeasuredPoint> some_points(const Rig& rig, const std::vector<GridGraph>& graphs,
                                       const Labeling& labeling) {
  TriangulationOptions options;
  options.used_of_seven = 1;
  return triangulate(rig, graphs, labeling, options);
}

/// Names the curves of single pictures.
class PictureTrial {
 public:
  PictureTrial(const Rig& rig, const PointOptions& options) : rig_(rig), options_(options) {
    // The pictures come as linear light of three colours.
    for (Camera& camera : rig_.cameras) {
      camera.gamma = 1;
      camera.black_level = 0;
      camera.mosaic.reset();
    }
  }

  /// How many points of `light` have a name where camera c stands, and named_share() there.
  struct Named {
    double points = 0;
    double share = 0;
  };
  [[nodiscard]] Named named(std::size_t c, const cv::Mat& light) const {
    const Labeling labeling = solved(c, light).labeling;
    return {static_cast<double>(labelled_points(labeling.runs[c])), named_share(labeling, c)};
  }

  /// What `light` measures where camera c stands.
  [[nodiscard]] std::vector<MeasuredPoint> points(std::size_t c, const cv::Mat& light) const {
    const PointResult result = solved(c, light);
    return some_points(rig_, result.graphs, result.labeling);
  }

 private:
  [[nodiscard]] PointResult solved(std::size_t c, const cv::Mat& light) const {
    Frame frame;
    frame.images.resize(rig_.cameras.size());
    frame.images[c] = light;
    PointResult found = detect_frame(rig_, frame, options_);
    found.labeling =
        solution_method(options_.method).solve(rig_, found.families, found.graphs, options_.method);
    return found;
  }

  Rig rig_;
  PointOptions options_;
};

/// A camera that may have a wrong picture.
struct Suspect {
  std::size_t camera = 0;
  double share = 0;  ///< named_share() of its own picture, among the others
  double named = 0;  ///< the same, alone
  cv::Mat light;
  PictureFinding best;
  double best_named = 0;
};

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

/// Those whose lines hardly a curve has.
std::vector<int> projectors_with_few_names(const Rig& rig, const Labeling& labeling) {
  std::vector<std::size_t> named(rig.projectors.size(), 0);
  for (const std::vector<LabeledRun>& runs : labeling.runs) {
    for (const LabeledRun& run : runs)
      named[static_cast<std::size_t>(run.label.pattern.projector)] +=
          static_cast<std::size_t>(run.end - run.begin);
  }
  const std::size_t most = *std::max_element(named.begin(), named.end());
  std::vector<int> few;
  for (std::size_t p = 0; p < named.size(); ++p) {
    if (static_cast<double>(named[p]) < kHardly * static_cast<double>(most))
      few.push_back(static_cast<int>(p));
  }
  return few;
}

}  // namespace

std::string describe(const Rig& rig, const PictureFinding& finding) {
  const auto name = [&](int camera) { return rig.camera(camera).name; };
  const std::string who = "camera " + name(finding.camera) + ": its picture ";
  const std::string out = "; reconstructed without it";
  switch (finding.fault) {
    case PictureFault::kBlack:
      return who + "is black: no projector's light is in it" + out;
    case PictureFault::kGrey:
      return who + "is grey, and lines are told apart by colour: take it in colour" + out;
    case PictureFault::kRepeated:
      return who + "is the same as camera " + name(finding.other) + "'s: one of them is a copy" +
             out;
    case PictureFault::kRedBlueExchanged:
      return who + "has red and blue exchanged (BGR for RGB): store it as RGB" + out;
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
  return who +
         "does not fit the rig as the others' do: the camera was moved, or the picture is of "
         "another moment or rig" +
         out;
}

std::vector<PictureFinding> plain_faults(const Rig& rig, const Frame& frame) {
  std::vector<PictureFinding> findings;
  const bool colored = needs_color(rig);
  std::vector<char> faulty(rig.cameras.size(), 0);
  const auto find = [&](PictureFault fault, std::size_t c, int other = -1) {
    faulty[c] = 1;
    findings.push_back({fault, static_cast<int>(c), other});
  };
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const cv::Mat& picture = frame.images[c];
    if (picture.empty() || rig.cameras[c].sees_texture_only) continue;
    if (is_black(picture)) {
      find(PictureFault::kBlack, c);
      continue;
    }
    if (colored && is_grey(picture)) {
      find(PictureFault::kGrey, c);
      continue;
    }
    // A copy of a picture says nothing of which camera took it: both are left out.
    for (std::size_t other = 0; other < c; ++other) {
      if (frame.images[other].empty() || !is_same(picture, frame.images[other])) continue;
      if (!faulty[other]) find(PictureFault::kRepeated, other, static_cast<int>(c));
      find(PictureFault::kRepeated, c, static_cast<int>(other));
      break;
    }
  }
  return findings;
}

std::vector<PictureFinding> misplaced_pictures(const Rig& rig, const Frame& frame,
                                               const std::vector<GridGraph>& graphs,
                                               const Labeling& labeling,
                                               const PointOptions& options) {
  std::vector<double> of_others;
  std::vector<Suspect> suspects;
  for (std::size_t c = 0; c < graphs.size(); ++c) {
    if (frame.images[c].empty() || curve_points(graphs[c]) < kLeastPoints) continue;
    const double share = named_share(labeling, c);
    if (share >= kFew) {
      of_others.push_back(share);
      continue;
    }
    Suspect suspect;
    suspect.camera = c;
    suspect.share = share;
    suspects.push_back(std::move(suspect));
  }
  if (suspects.empty()) return {};
  const std::size_t others = of_others.size();
  const double usual = others == 0 ? 2 * kFew : upper_median(std::move(of_others));

  const PictureTrial trial(rig, options);
  parallel_for(suspects.size(), [&](std::size_t i) {
    Suspect& s = suspects[i];
    const Camera& camera = rig.cameras[s.camera];
    s.light = linear_light(camera, frame.images[s.camera]);
    s.named = trial.named(s.camera, s.light).share;
  });
  const auto consider = [&](Suspect& s, const PictureFinding& finding, double named) {
    if (named <= s.best_named || named < kFarMore * s.named || named < kFarLess * usual) return;
    s.best = finding;
    s.best_named = named;
  };
  for (Suspect& s : suspects) {
    for (const Remedy& remedy : remedies()) {
      consider(s, {remedy.fault, static_cast<int>(s.camera), -1},
               trial.named(s.camera, remedy.undo(s.light)).share);
    }
    for (const Suspect& other : suspects) {
      if (other.camera == s.camera || other.light.size() != s.light.size()) continue;
      consider(
          s, {PictureFault::kExchanged, static_cast<int>(s.camera), static_cast<int>(other.camera)},
          trial.named(other.camera, s.light).share);
    }
  }
  std::vector<PictureFinding> findings;
  for (const Suspect& s : suspects) {
    if (s.best_named > 0) {
      findings.push_back(s.best);
    } else if (s.share < kFarLess * usual && suspects.size() < others) {
      findings.push_back({PictureFault::kDoesNotFit, static_cast<int>(s.camera), -1});
    }
  }
  return findings;
}

std::vector<PictureFinding> contradicting_pictures(const Rig& rig, const Frame& frame,
                                                   const std::vector<GridGraph>& graphs,
                                                   const Labeling& labeling,
                                                   const PointOptions& options) {
  const std::size_t count = rig.cameras.size();
  std::vector<std::vector<MeasuredPoint>> points(count);
  for (const MeasuredPoint& p : some_points(rig, graphs, labeling)) points[p.camera].push_back(p);
  const ViewAgreement agreement(rig, points);
  const std::vector<std::size_t> doubtful = agreement.doubtful_cameras();
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
    if (c != alone && !points[c].empty()) of_others.push_back(named_share(labeling, c));
  points[alone].clear();
  // Without a second sign, such as few names, the contradiction must be plain.
  const bool is_plain = share(alone) < kPlainContradiction ||
                        named_share(labeling, alone) < kFewer * upper_median(std::move(of_others));
  if (count < 3 || !is_plain || ViewAgreement(rig, points).doubtful_pairs() > 0) return {};
  return {{PictureFault::kDoesNotFit, static_cast<int>(alone), -1}};
}

std::optional<std::pair<int, int>> exchanged_projectors(const Rig& rig, const Frame& frame,
                                                        const std::vector<GridGraph>& graphs,
                                                        const Labeling& labeling,
                                                        const PointOptions& options) {
  // The cameras with the smallest named shares tell most.
  std::vector<std::size_t> poor;
  double named = 0;
  double points = 0;
  for (std::size_t c = 0; c < graphs.size(); ++c) {
    if (frame.images[c].empty() || curve_points(graphs[c]) < kLeastPoints) continue;
    poor.push_back(c);
    const auto weight = static_cast<double>(curve_points(graphs[c]));
    named += weight * named_share(labeling, c);
    points += weight;
  }
  if (poor.empty()) return std::nullopt;
  std::sort(poor.begin(), poor.end(), [&](std::size_t a, std::size_t b) {
    return named_share(labeling, a) < named_share(labeling, b);
  });
  poor.resize(std::min(poor.size(), kTellingCameras));

  // Index 0: the rig as it is.
  std::vector<std::pair<int, int>> pairs = {{-1, -1}};
  std::vector<int> doubtful(rig.projectors.size());
  std::iota(doubtful.begin(), doubtful.end(), 0);
  const bool is_hopeless = named < kFew * points;
  if (!is_hopeless) doubtful = projectors_with_few_names(rig, labeling);
  for (const int a : doubtful) {
    for (const int b : doubtful) {
      const Projector& one = rig.projector(a);
      const Projector& other = rig.projector(b);
      if (a < b && one.width == other.width && one.height == other.height &&
          one.patterns != other.patterns)
        pairs.emplace_back(a, b);
    }
  }
  if (pairs.size() == 1) return std::nullopt;
  std::vector<cv::Mat> light;
  for (const std::size_t c : poor) light.push_back(linear_light(rig.cameras[c], frame.images[c]));
  std::vector<std::vector<double>> counts(pairs.size());
  parallel_for(pairs.size(), [&](std::size_t i) {
    Rig trial_rig = rig;
    const auto of = [&](int p) -> Projector& {
      return trial_rig.projectors[static_cast<std::size_t>(p)];
    };
    if (i > 0) std::swap(of(pairs[i].first).patterns, of(pairs[i].second).patterns);
    const PictureTrial trial(trial_rig, options);
    for (std::size_t k = 0; k < poor.size(); ++k) {
      const PictureTrial::Named alone = trial.named(poor[k], light[k]);
      // Where hardly anything is named, chance names a little more with any exchange.
      counts[i].push_back(i > 0 && is_hopeless && alone.share < kFew ? 0 : alone.points);
    }
  });
  // Exchanging two projectors that stand right takes names from every camera that sees them.
  std::optional<std::pair<int, int>> best;
  double best_sum = kClearlyMore * std::accumulate(counts[0].begin(), counts[0].end(), 0.0);
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    double sum = 0;
    bool is_right = true;
    for (std::size_t k = 0; k < poor.size(); ++k) {
      sum += counts[i][k];
      is_right = is_right && counts[i][k] > 0 && counts[i][k] >= counts[0][k];
    }
    if (!is_right || sum <= best_sum) continue;
    best = pairs[i];
    best_sum = sum;
  }
  return best;
}

}  // namespace pencilscan
