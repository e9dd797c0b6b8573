#include "pencilscan/calibration/structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/triangulation.h"
#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/median.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

constexpr double kEarlySigmaPx = 2;  ///< lenses and focal lengths are not known yet

std::vector<cv::Point2d> normalized(const BundleDevice& device, const std::vector<Vec2>& pixels) {
  std::vector<cv::Point2d> result;
  for (const Vec2& p : pixels) {
    const Vec3 ray = device_ray(device, p);
    result.emplace_back(ray.x(), ray.y());
  }
  return result;
}

struct Seed {
  std::size_t a = 0, b = 0;
  double score = 0;
  Mat3 rotation = Mat3::Identity();
  Vec3 translation = Vec3::Zero();
};

/// b_from_a by the five-point method; score: points in front of both, weighted by their angle.
Seed solve_seed(const BundleProblem& problem, std::size_t a, std::size_t b,
                const std::vector<std::size_t>& tracks) {
  std::vector<Vec2> pixels_a;
  std::vector<Vec2> pixels_b;
  for (const std::size_t t : tracks) {
    const TrackView* in_a = view_in(problem.tracks[t], a);
    const TrackView* in_b = view_in(problem.tracks[t], b);
    if (in_a == nullptr || in_b == nullptr) continue;
    pixels_a.push_back(in_a->pixel);
    pixels_b.push_back(in_b->pixel);
  }
  Seed seed{a, b};
  if (pixels_a.size() < 15) return seed;
  const auto points_a = normalized(problem.devices[a], pixels_a);
  const auto points_b = normalized(problem.devices[b], pixels_b);
  const double tolerance = 4 / problem.devices[a].inner[kFx];
  cv::Mat mask;
  const cv::Mat E = cv::findEssentialMat(points_a, points_b, cv::Mat::eye(3, 3, CV_64F), cv::RANSAC,
                                         0.999, tolerance, 1000, mask);
  if (E.rows != 3 || E.cols != 3) return seed;
  cv::Mat R;
  cv::Mat t;
  const int front = cv::recoverPose(E, points_a, points_b, cv::Mat::eye(3, 3, CV_64F), R, t, mask);
  cv::cv2eigen(R, seed.rotation);
  cv::cv2eigen(t, seed.translation);
  // The median angle between rays: small ones fix no depth, wide ones share little surface.
  std::vector<double> angles;
  for (std::size_t i = 0; i < points_a.size(); ++i) {
    const Vec3 ray_a = seed.rotation * Vec3(points_a[i].x, points_a[i].y, 1);
    const Vec3 ray_b(points_b[i].x, points_b[i].y, 1);
    angles.push_back(std::acos(std::clamp(ray_a.normalized().dot(ray_b.normalized()), -1.0, 1.0)));
  }
  seed.score = front * std::min(upper_median(std::move(angles)), 0.5);
  return seed;
}

std::vector<std::size_t> chosen_tracks(const BundleProblem& problem, std::size_t count) {
  std::vector<std::size_t> order;
  for (const bool is_long : {true, false}) {
    std::vector<std::size_t> pool;
    for (std::size_t t = 0; t < problem.tracks.size(); ++t)
      if ((problem.tracks[t].views.size() > 2) == is_long) pool.push_back(t);
    const std::vector<std::size_t> picked = evenly_picked(pool, is_long ? count : count / 2);
    order.insert(order.end(), picked.begin(), picked.end());
  }
  std::sort(order.begin(), order.end());
  return order;
}

/// Pairs to start from, the best first.
std::vector<Seed> seeds_of(const BundleProblem& problem, const std::vector<std::size_t>& tracks,
                           const StructureOptions& options) {
  const auto is_trusted = [&](std::size_t a, std::size_t b) {
    return options.resects && options.trusted[a] != 0 && options.trusted[b] != 0;
  };
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> shared;
  for (const std::size_t t : tracks) {
    const auto& views = problem.tracks[t].views;
    for (std::size_t i = 0; i < views.size(); ++i)
      for (std::size_t j = i + 1; j < views.size(); ++j)
        ++shared[std::minmax(views[i].device, views[j].device)];
  }
  std::vector<std::pair<std::size_t, std::pair<std::size_t, std::size_t>>> ranked;
  for (const auto& [pair, count] : shared) ranked.push_back({count, pair});
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const auto& x, const auto& y) { return x.first > y.first; });
  std::stable_partition(ranked.begin(), ranked.end(), [&](const auto& pair) {
    return is_trusted(pair.second.first, pair.second.second);
  });
  std::vector<Seed> seeds;
  for (std::size_t i = 0; i < std::min<std::size_t>(ranked.size(), 8); ++i) {
    const Seed seed = solve_seed(problem, ranked[i].second.first, ranked[i].second.second, tracks);
    if (seed.score > 0) seeds.push_back(seed);
  }
  std::stable_sort(seeds.begin(), seeds.end(),
                   [](const Seed& a, const Seed& b) { return a.score > b.score; });
  std::stable_partition(seeds.begin(), seeds.end(),
                        [&](const Seed& seed) { return is_trusted(seed.a, seed.b); });
  return seeds;
}

/// Points in the world and where an absent device sees them.
struct PointViews {
  std::vector<cv::Point3d> points;
  std::vector<Vec2> pixels;
};

PointViews point_views_of(const BundleProblem& problem, std::size_t d,
                          const std::vector<std::size_t>& tracks) {
  PointViews seen;
  for (const std::size_t t : tracks) {
    const TrackView* view = view_in(problem.tracks[t], d);
    if (view == nullptr || problem.used[t] == 0) continue;
    const Vec3& x = problem.points[t];
    seen.points.emplace_back(x.x(), x.y(), x.z());
    seen.pixels.push_back(view->pixel);
  }
  return seen;
}

/// Puts the device where most views agree; false when too few do.
bool pose_device(const PointViews& seen, const StructureOptions& options, int tries,
                 BundleDevice& device) {
  const auto rays = normalized(device, seen.pixels);
  const double width = device.width;
  const auto tolerance = static_cast<float>(options.pose_tolerance * width / device.inner[kFx]);
  cv::Mat rotation_vector;
  cv::Mat translation;
  std::vector<int> inliers;
  const bool found = cv::solvePnPRansac(seen.points, rays, cv::Mat::eye(3, 3, CV_64F),
                                        cv::noArray(), rotation_vector, translation, false, tries,
                                        tolerance, 0.999, inliers, cv::SOLVEPNP_EPNP);
  if (!found || inliers.size() < std::max(options.least_matches / 2, seen.points.size() / 4))
    return false;
  cv::Mat R;
  cv::Rodrigues(rotation_vector, R);
  Mat3 rotation;
  Vec3 t;
  cv::cv2eigen(R, rotation);
  cv::cv2eigen(translation, t);
  if (!rotation.allFinite() || !t.allFinite()) return false;
  set_pose(device, rotation, t);
  return true;
}

/// Mean of the squared errors of all views, each counted up to that of an outlier, px^2.
double truncated_error(const PointViews& seen, const BundleDevice& device) {
  constexpr double kOutlierPx = 4 * kEarlySigmaPx;
  double sum = 0;
  for (std::size_t i = 0; i < seen.pixels.size(); ++i) {
    const cv::Point3d& x = seen.points[i];
    const auto error = view_error(device, Vec3(x.x, x.y, x.z), {0, seen.pixels[i], 1});
    sum +=
        std::min(error ? error->squaredNorm() : kOutlierPx * kOutlierPx, kOutlierPx * kOutlierPx);
  }
  return sum / static_cast<double>(seen.pixels.size());
}

/// Pose, focal length and, where lenses may be shifted, the principal point of a device of which
/// nothing is known, on a grid.
bool resect_device(const PointViews& seen, const StructureOptions& options, BundleDevice& device) {
  constexpr int kTries = 60;
  constexpr std::array<double, 9> kScales{0.6, 0.8, 1.0, 1.3, 1.6, 2.0, 2.5, 3.2, 4.0};
  constexpr std::array<double, 5> kShifts{0, 0.3, 0.6, -0.3, -0.6};
  const double width = device.width;
  const double height = device.height;
  const bool may_shift = device.prior_sigma[kCy] > 0.2 * height;
  BundleDevice best = device;
  double least = std::numeric_limits<double>::infinity();
  for (const double scale : kScales) {
    for (const double shift : kShifts) {
      if (shift != 0 && !may_shift) continue;
      BundleDevice trial = device;
      trial.inner[kFx] = trial.inner[kFy] = scale * width;
      trial.inner[kCy] = trial.prior[kCy] + shift * height;
      if (!pose_device(seen, options, kTries, trial)) continue;
      const double error = truncated_error(seen, trial);
      if (error >= least) continue;
      least = error;
      best = trial;
    }
  }
  if (!std::isfinite(least)) return false;
  device = best;
  device.prior_sigma[kFx] *= device.inner[kFx] / device.prior[kFx];
  device.prior[kFx] = device.inner[kFx];
  return true;
}

/// Pose of an absent device against the points of `tracks`; false when too few agree.
bool join_device(BundleProblem& problem, std::size_t d, const std::vector<std::size_t>& tracks,
                 const StructureOptions& options) {
  constexpr int kTries = 500;
  const PointViews seen = point_views_of(problem, d, tracks);
  if (seen.points.size() < options.least_matches) return false;
  BundleDevice& device = problem.devices[d];
  const bool found = options.resects && options.trusted[d] == 0
                         ? resect_device(seen, options, device)
                         : pose_device(seen, options, kTries, device);
  device.present = found;
  return found;
}

void triangulate_tracks(BundleProblem& problem, const std::vector<std::size_t>& tracks,
                        double least_angle) {
  for (const std::size_t t : tracks) {
    if (problem.used[t] != 0) continue;
    const auto point = triangulate(problem, problem.tracks[t], least_angle);
    if (!point) continue;
    problem.points[t] = *point;
    problem.used[t] = 1;
  }
}

/// Joins absent devices, the one that sees most points first, until none can be.
void grow(BundleProblem& problem, const std::vector<std::size_t>& tracks,
          const BundleOptions& bundle, const StructureOptions& options) {
  std::vector<char> failed(problem.devices.size(), 0);
  for (;;) {
    std::vector<std::size_t> seen(problem.devices.size(), 0);
    for (const std::size_t t : tracks)
      if (problem.used[t] != 0)
        for (const TrackView& view : problem.tracks[t].views) ++seen[view.device];
    std::size_t next = problem.devices.size();
    for (std::size_t d = 0; d < problem.devices.size(); ++d) {
      if (problem.devices[d].present || failed[d] != 0) continue;
      if (next == problem.devices.size() || seen[d] > seen[next]) next = d;
    }
    if (next == problem.devices.size()) break;
    if (!join_device(problem, next, tracks, options)) {
      failed[next] = 1;
      continue;
    }
    std::fill(failed.begin(), failed.end(), 0);  // new points may join those that failed
    triangulate_tracks(problem, tracks, options.least_angle_rad);
    adjust(problem, bundle);
  }
}

/// What an attempt changes in a problem: all but what was seen.
struct Placement {
  std::vector<BundleDevice> devices;
  std::vector<Vec3> points;
  std::vector<char> used;
  std::vector<std::array<double, 6>> board_poses;
};

Placement placement_of(const BundleProblem& problem) {
  return {problem.devices, problem.points, problem.used, problem.board_poses};
}

void place(const Placement& placement, BundleProblem& problem) {
  problem.devices = placement.devices;
  problem.points = placement.points;
  problem.used = placement.used;
  problem.board_poses = placement.board_poses;
}

/// Triangulates what the present devices see and joins the others, with all tracks where the chosen
/// ones do not suffice.
void grow_from_present(BundleProblem& problem, const std::vector<std::size_t>& tracks,
                       BundleOptions bundle, const StructureOptions& options) {
  problem.used.assign(problem.tracks.size(), 0);
  problem.points.assign(problem.tracks.size(), Vec3::Zero());
  triangulate_tracks(problem, tracks, options.least_angle_rad);
  adjust(problem, bundle);
  grow(problem, tracks, bundle, options);
  if (present_devices(problem) == problem.devices.size()) return;
  std::vector<std::size_t> all(problem.tracks.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  triangulate_tracks(problem, all, options.least_angle_rad);
  bundle.max_tracks = 2 * options.tracks;
  grow(problem, all, bundle, options);
}

}  // namespace

double build_structure(BundleProblem& problem, unsigned free_inner,
                       const StructureOptions& options) {
  const auto tracks = chosen_tracks(problem, options.tracks);
  BundleOptions bundle;
  bundle.free_inner = free_inner;
  bundle.extra_sigma_px = kEarlySigmaPx;
  bundle.max_iterations = 15;
  if (present_devices(problem) >= 2) {
    grow_from_present(problem, tracks, bundle, options);
  } else {
    // A pair whose captures were exchanged looks sound by itself; what joins it contradicts it.
    constexpr std::size_t kMostSeeds = 4;
    constexpr double kSoundCost = 0.1;  // per view, of kEarlySigmaPx: few contradict the rest
    std::vector<Seed> seeds = seeds_of(problem, tracks, options);
    if (seeds.empty()) return std::numeric_limits<double>::infinity();
    seeds.resize(std::min(seeds.size(), kMostSeeds));
    const Placement nothing = placement_of(problem);
    Placement best = nothing;
    std::size_t most = 0;
    double least = std::numeric_limits<double>::infinity();
    for (const Seed& seed : seeds) {
      place(nothing, problem);
      set_pose(problem.devices[seed.a], Mat3::Identity(), Vec3::Zero());
      set_pose(problem.devices[seed.b], seed.rotation, seed.translation);
      problem.devices[seed.a].present = problem.devices[seed.b].present = true;
      grow_from_present(problem, tracks, bundle, options);
      const BundleSummary found = adjust(problem, bundle);
      const double cost = found.cost / static_cast<double>(std::max<std::size_t>(found.views, 1));
      const std::size_t placed = present_devices(problem);
      if (placed < most || (placed == most && !(cost < least))) continue;
      most = placed;
      least = cost;
      best = placement_of(problem);
      if (most == problem.devices.size() && least < kSoundCost) break;
    }
    place(best, problem);
  }
  bundle.max_iterations = 60;
  const BundleSummary summary = adjust(problem, bundle);
  return summary.cost / static_cast<double>(std::max<std::size_t>(summary.views, 1));
}

}  // namespace pencilscan
