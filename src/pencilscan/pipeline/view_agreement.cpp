#include "pencilscan/pipeline/view_agreement.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/pipeline/seen_depths.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {
namespace {

constexpr std::size_t kLeastPoints = 200;
/// Of what a pair says. Pairs of right pictures have .60 and more, of intricate objects
/// (docs/sensors.md); where one picture is another camera's, .05 and less.
constexpr double kLeastSame = 0.5;

constexpr int kMeasuredCell = 8;  // px

double depth_in(const Camera& camera, const MeasuredPoint& p) {
  return (camera.device_from_world * position_of(p)).z();
}

SeenDepths measured_depths(const Camera& camera, std::span<const MeasuredPoint> points) {
  SeenDepths depths(camera, kMeasuredCell);
  for (const MeasuredPoint& p : points) depths.add({double{p.u}, double{p.v}}, depth_in(camera, p));
  return depths;
}

/// Says of a point of another camera whether this one, which has these depths, measured it; what
/// lies behind says nothing.
void judge_point(const MeasuredPoint& p, const Camera& camera, const SeenDepths& depths,
                 double tolerance, PairAgreement& agreement) {
  const std::optional<Vec2> pixel = camera.project(position_of(p));
  const SeenDepths::Range* range = pixel ? depths.at(*pixel) : nullptr;
  if (range == nullptr) return;
  const double depth = depth_in(camera, p);
  if (depth < range->nearest - tolerance) {
    ++agreement.apart;
  } else if (depth <= range->farthest + tolerance) {
    ++agreement.same;
  }
}

}  // namespace

bool PairAgreement::is_doubtful() const {
  return same + apart >= kLeastPoints && share() < kLeastSame;
}

ViewAgreement::ViewAgreement(const Rig& rig, std::span<const std::vector<MeasuredPoint>> points)
    : count_(points.size()), pairs_(count_ * count_) {
  // A camera that was moved names lines one off. Less than this, and relief between two lines of a
  // cell counts as well.
  constexpr double kSpacings = 0.3;
  const double tolerance = kSpacings * line_spacing(rig);
  std::vector<PairAgreement> said(count_ * count_);
  parallel_for(count_, [&](std::size_t b) {
    const Camera& camera = rig.cameras[b];
    const SeenDepths depths = measured_depths(camera, points[b]);
    for (std::size_t a = 0; a < count_; ++a) {
      if (a == b) continue;
      for (const MeasuredPoint& p : points[a])
        judge_point(p, camera, depths, tolerance, said[a * count_ + b]);
    }
  });
  for (std::size_t a = 0; a < count_; ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const PairAgreement& one = said[a * count_ + b];
      const PairAgreement& other = said[b * count_ + a];
      pairs_[a * count_ + b] = {one.same + other.same, one.apart + other.apart};
    }
  }
}

PairAgreement ViewAgreement::with_others(std::size_t camera) const {
  PairAgreement sum;
  for (std::size_t other = 0; other < count_; ++other) {
    if (other == camera) continue;
    sum.same += of(camera, other).same;
    sum.apart += of(camera, other).apart;
  }
  return sum;
}

std::size_t ViewAgreement::doubtful_pairs() const {
  return static_cast<std::size_t>(std::count_if(
      pairs_.begin(), pairs_.end(), [](const PairAgreement& pair) { return pair.is_doubtful(); }));
}

std::vector<std::size_t> ViewAgreement::doubtful_cameras() const {
  std::vector<std::size_t> cameras;
  for (std::size_t a = 0; a < count_; ++a) {
    bool is_doubtful = false;
    for (std::size_t b = 0; b < count_; ++b) is_doubtful |= a != b && of(a, b).is_doubtful();
    if (is_doubtful) cameras.push_back(a);
  }
  return cameras;
}

std::optional<std::size_t> ViewsApart::single() const {
  // Of 92 right scenes (drawn rigs, statues, a person; 3 to 8 cameras) none has more than 1.31, and
  // those with 1.1 and more are at most 1.45 times as far apart as the others. A camera that is one
  // frame late before an object that bends has 1.4 to 2.2, and 1.7 to 2.8 times.
  constexpr double kApart = 1.5;
  constexpr double kFarther = 1.8;  // than the others among each other
  // A right camera beside a wrong one may lie as far apart. Without the wrong one the others agree.
  std::optional<std::size_t> found;
  for (std::size_t c = 0; c < with.size(); ++c) {
    if (!with[c] || !without[c]) continue;
    if (*with[c] > kApart && *with[c] > kFarther * *without[c] &&
        (!found || *without[c] < *without[*found]))
      found = c;
  }
  return found;
}

ViewsApart views_apart(const Rig& rig, std::span<const MeasuredPoint> points,
                       std::span<const LocalSurface> surfaces) {
  constexpr std::size_t kNext = 3;      // neighbours on a line say the same
  constexpr std::size_t kMost = 4000;   // points: the median of as many is known to a fiftieth
  constexpr std::size_t kEnough = 100;  // the median is known to an eighth
  constexpr double kSameSurface = 0.5;  // line spacings
  constexpr float kOneSided = 0.5F;     // of a patch: beyond, it is continued, not measured
  struct Ratio {
    std::size_t one, other;  // cameras
    float deviations;
  };
  const double reach = kSameSurface * line_spacing(rig);
  // A thin plate has another surface right behind: what one side shows of the other says nothing.
  const auto faces = [&](const MeasuredPoint& p, const Camera& camera) {
    return about_facing(rig, p).dot(camera.center() - position_of(p)) > 0;
  };
  std::vector<Ratio> ratios;
  const std::size_t step = std::max(kNext, points.size() / kMost);
  for (std::size_t i = 0; i < points.size(); i += step) {
    const MeasuredPoint& p = points[i];
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      const Camera& camera = rig.cameras[c];
      const auto pixel = camera.project(position_of(p));
      if (c == p.camera || !pixel || !camera.contains(*pixel) || !faces(p, camera)) continue;
      const Eigen::Vector2f at = pixel->cast<float>();
      const SurfacePatch* patch = surfaces[c].nearest(at);
      if (patch == nullptr || patch->one_sidedness > kOneSided) continue;
      const double depth = 1 / double{patch->inverse_depth(at)};
      const double apart = std::abs(depth - (camera.device_from_world * position_of(p)).z());
      if (!(apart < reach)) continue;
      ratios.push_back(
          {p.camera, c,
           static_cast<float>(apart / std::hypot(double{p.sigma}, double{patch->sigma} * depth))});
    }
  }
  const auto median_where = [&](const auto& counts) -> std::optional<double> {
    std::vector<float> values;
    for (const Ratio& ratio : ratios)
      if (counts(ratio)) values.push_back(ratio.deviations);
    if (values.size() < kEnough) return std::nullopt;
    return kDeviationPerMedian * static_cast<double>(upper_median(std::move(values)));
  };
  ViewsApart result;
  result.all = median_where([](const Ratio&) { return true; });
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const auto is_of = [c](const Ratio& ratio) { return ratio.one == c || ratio.other == c; };
    result.with.push_back(median_where(is_of));
    result.without.push_back(median_where([&](const Ratio& ratio) { return !is_of(ratio); }));
  }
  return result;
}

}  // namespace pencilscan
