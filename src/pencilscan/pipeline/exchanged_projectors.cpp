#include <algorithm>
#include <numeric>

#include "pencilscan/core/parallel.h"
#include "pencilscan/pipeline/picture_check.h"
#include "pencilscan/pipeline/picture_trial.h"
#include "pencilscan/pipeline/shown_lines.h"
#include "pencilscan/points/settle.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {
namespace {

// Projectors that show each other's patterns, docs/sensors.md. With the right patterns the poorest
// cameras have more names, about 1.2 times as many and more; exchanging two that stand right takes
// names away.
constexpr double kClearlyMore = 1.1;
constexpr double kHardly = 0.25;  // of the projector with most names; exchanged ones have .05
constexpr std::size_t kTellingCameras = 3;

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

/// True where the points that cameras measured lie on each other's lines: few names, but right
/// ones.
bool have_right_names(const Rig& rig, const PointResult& found,
                      const std::vector<std::size_t>& cameras) {
  const auto points = points_by_camera(rig, some_points(rig, found));
  return std::any_of(cameras.begin(), cameras.end(), [&](std::size_t c) {
    return shown_lines(rig, found.families, found.graphs[c], points).fits();
  });
}

}  // namespace

std::optional<std::pair<int, int>> exchanged_projectors(const Rig& rig, const Frame& frame,
                                                        const PointResult& found,
                                                        const PointOptions& options) {
  // The cameras with the smallest named shares tell most.
  std::vector<std::size_t> poor;
  std::vector<TellingPoints> points;
  TellingPoints sum;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    points.push_back(telling_points(found.labeling, c));
    if (frame.images[c].empty() || !points[c].are_enough()) continue;
    poor.push_back(c);
    sum.add(points[c]);
  }
  if (poor.empty()) return std::nullopt;
  std::sort(poor.begin(), poor.end(), [&](std::size_t a, std::size_t b) {
    return points[a].named_share() < points[b].named_share();
  });
  poor.resize(std::min(poor.size(), kTellingCameras));

  // Index 0: the rig as it is.
  std::vector<std::pair<int, int>> pairs = {{-1, -1}};
  std::vector<int> doubtful(rig.projectors.size());
  std::iota(doubtful.begin(), doubtful.end(), 0);
  const bool is_hopeless = sum.named_share() < kFewNamed && !have_right_names(rig, found, poor);
  if (!is_hopeless) doubtful = projectors_with_few_names(rig, found.labeling);
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
      const TellingPoints alone = trial.telling_points(poor[k], light[k]);
      // Where hardly anything is named, chance names a little more with any exchange.
      const bool is_chance = i > 0 && is_hopeless && alone.named_share() < kFewNamed;
      counts[i].push_back(is_chance ? 0 : static_cast<double>(alone.named));
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
