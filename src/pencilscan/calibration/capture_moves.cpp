#include "pencilscan/calibration/capture_moves.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "pencilscan/bundle/triangulation.h"
#include "pencilscan/calibration/verdict.h"
#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/median.h"
#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

using PoseBlock = Eigen::Matrix<double, 6, 6>;

/// Fits a device's pose to the tracks of one capture by Gauss-Newton, points eliminated; the other
/// devices stay.
class PoseInCapture {
 public:
  PoseInCapture(const BundleProblem& problem, std::size_t device, const BundleOptions& adjusted)
      : problem_(problem), device_(device), adjusted_(adjusted) {}

  void fit(bool free_pose) {
    constexpr int kMostSteps = 12;
    constexpr double kStillPx = 0.003;  // a tenth of the least deviation of a view
    for (int step = 0; step < kMostSteps; ++step) {
      const BundleDevice before = problem_.devices[device_];
      advance(free_pose);
      if (step > 1 && shift_from(before) < kStillPx) break;
    }
  }

  /// By how much the device's picture of the points moved, median, px.
  [[nodiscard]] double shift_from(const BundleDevice& before) const {
    std::vector<double> shifts;
    for (std::size_t t = 0; t < problem_.tracks.size(); ++t) {
      const TrackView* seen = view_in(problem_.tracks[t], device_);
      const auto now = view_error(problem_.devices[device_], problem_.points[t], *seen);
      const auto then = view_error(before, problem_.points[t], *seen);
      if (now && then) shifts.push_back((*now - *then).norm());
    }
    return lower_quantile(shifts, 0.5);
  }

  /// Half the sum of squares under Cauchy's loss.
  [[nodiscard]] double cost() const {
    const double c2 = adjusted_.loss_scale * adjusted_.loss_scale;
    double sum = 0;
    for (const double e : deviations()) sum += c2 / 2 * std::log1p(e * e / c2);
    return sum;
  }

  /// What errors of single views move the device's picture by, root mean square, px.
  [[nodiscard]] double chance_px() const {
    const double square =
        solve_symmetric(Eigen::MatrixXd(normal_), Eigen::MatrixXd(squares_)).trace();
    return std::sqrt(std::max(square, 0.0));
  }

 private:
  [[nodiscard]] double extra(bool is_hub) const { return is_hub ? 0 : adjusted_.extra_sigma_px; }

  /// Errors of the views, hubs left out, over their deviations.
  [[nodiscard]] std::vector<double> deviations() const {
    std::vector<double> deviations;
    for_each_residual(problem_, [&](std::size_t, const TrackView& view, const Vec2& error) {
      deviations.push_back(error.norm() / std::hypot(view.sigma_px, extra(false)));
    });
    return deviations;
  }

  void advance(bool free_pose) {
    // A device that moved makes many of its errors large: then all count alike.
    const double scale = std::max(adjusted_.loss_scale, lower_quantile(deviations(), 0.5));
    struct OfPoint {
      Mat3 inverse = Mat3::Zero();
      Vec3 right = Vec3::Zero();
      Eigen::Matrix<double, 6, 3> by_pose = Eigen::Matrix<double, 6, 3>::Zero();
    };
    std::vector<OfPoint> of_points(problem_.tracks.size());
    Vec6 right = Vec6::Zero();
    normal_.setZero();
    squares_.setZero();
    double views = 0;
    for (std::size_t t = 0; t < problem_.tracks.size(); ++t) {
      OfPoint& of_point = of_points[t];
      const auto& seen = problem_.tracks[t].views;
      for (std::size_t i = 0; i < seen.size(); ++i) {
        const BundleDevice& device = problem_.devices[seen[i].device];
        if (!view_error(device, problem_.points[t], seen[i])) continue;
        const ViewLinearization row = linearize(device, problem_.points[t], seen[i], extra(i == 0));
        const double weight = i == 0 ? 1 : 1 / (1 + row.residual.squaredNorm() / (scale * scale));
        of_point.inverse += weight * row.point.transpose() * row.point;
        of_point.right += weight * row.point.transpose() * row.residual;
        if (seen[i].device != device_) continue;
        normal_ += weight * row.pose.transpose() * row.pose;
        right += weight * row.pose.transpose() * row.residual;
        of_point.by_pose += weight * row.pose.transpose() * row.point;
        const double variance = std::pow(std::hypot(seen[i].sigma_px, extra(i == 0)), 2);
        squares_ += variance * row.pose.transpose() * row.pose;
        ++views;
      }
      of_point.inverse = of_point.inverse.inverse().eval();
      if (!of_point.inverse.allFinite()) of_point.inverse.setZero();
      normal_ -= of_point.by_pose * of_point.inverse * of_point.by_pose.transpose();
      right -= of_point.by_pose * of_point.inverse * of_point.right;
    }
    squares_ /= std::max(views, 1.0);
    // Where the views leave the pose free it stays: nobody moves a picture by its width unseen.
    normal_ += squares_ / std::pow(problem_.devices[device_].width, 2);
    const Vec6 move = free_pose ? Vec6(-solve_symmetric(Mat6(normal_), right)) : Vec6::Zero();
    if (!move.allFinite()) return;
    for (std::size_t i = 0; i < 6; ++i)
      problem_.devices[device_].pose[i] += move[static_cast<Eigen::Index>(i)];
    for (std::size_t t = 0; t < problem_.points.size(); ++t)
      problem_.points[t] -=
          of_points[t].inverse * (of_points[t].right + of_points[t].by_pose.transpose() * move);
  }

  BundleProblem problem_;
  std::size_t device_;
  BundleOptions adjusted_;
  PoseBlock normal_ = PoseBlock::Zero();   ///< of the pose, points eliminated
  PoseBlock squares_ = PoseBlock::Zero();  ///< mean over its views, px^2
};

/// Each by itself; none of a device with few views.
std::vector<CaptureMove> moves_in(const CalibrationResult& result, std::size_t capture,
                                  const std::vector<Track>& tracks) {
  constexpr std::size_t kMostTracks = 300;  // know a pose to some hundredths of a pixel
  constexpr std::size_t kFewestTracks = 24;
  std::vector<CaptureMove> moves;
  for (std::size_t d = 0; d < result.problem.devices.size(); ++d) {
    std::vector<const Track*> seen;
    for (const Track& track : tracks)
      if (view_in(track, d) != nullptr) seen.push_back(&track);
    BundleProblem problem;
    problem.devices = result.problem.devices;
    for (const Track* track : evenly_picked(seen, kMostTracks)) {
      const auto point = triangulate(problem, *track, kLeastAngle);
      if (!point) continue;
      problem.tracks.push_back(*track);
      problem.points.push_back(*point);
    }
    if (problem.tracks.size() < kFewestTracks) continue;
    problem.used.assign(problem.tracks.size(), 1);
    PoseInCapture held(problem, d, result.adjustment);
    held.fit(false);
    PoseInCapture moved(problem, d, result.adjustment);
    moved.fit(true);
    moves.push_back({d, capture, moved.shift_from(problem.devices[d]), moved.chance_px(),
                     held.cost() - moved.cost()});
  }
  return moves;
}

/// Views of devices without a place are left out.
std::map<std::size_t, std::vector<Track>> placed_by_capture(const BundleProblem& problem,
                                                            const std::vector<Track>& tracks) {
  std::map<std::size_t, std::vector<Track>> of_capture;
  for (const Track& track : tracks) {
    if (!problem.devices[track.views[0].device].present) continue;
    Track placed{{}, track.capture};
    for (const TrackView& view : track.views)
      if (problem.devices[view.device].present) placed.views.push_back(view);
    if (placed.views.size() > 1) of_capture[track.capture].push_back(std::move(placed));
  }
  return of_capture;
}

}  // namespace

CaptureMoves moved_between_captures(const CalibrationResult& result,
                                    const std::vector<Track>& tracks) {
  constexpr double kDeviations = 4;
  const double least_px = VerdictOptions{}.trend_px;
  CaptureMoves found;
  auto of_capture = placed_by_capture(result.problem, tracks);
  if (of_capture.size() < 2) return found;
  std::map<std::size_t, std::vector<CaptureMove>> all;
  std::vector<double> times_chance;
  for (const auto& [capture, seen] : of_capture) {
    all[capture] = moves_in(result, capture, seen);
    for (const CaptureMove& m : all[capture]) times_chance.push_back(m.shift_px / m.chance_px);
  }
  // Of those that lie off by more than so many times chance.
  const auto clearest = [&](const std::vector<CaptureMove>& moves, double times) {
    const CaptureMove* best = nullptr;
    for (const CaptureMove& m : moves)
      if (m.shift_px > std::max(least_px, times * m.chance_px) &&
          m.gain > (best == nullptr ? 0 : best->gain))
        best = &m;
    return best;
  };
  const double usual = std::max(1.0, lower_quantile(times_chance, 0.5));
  for (auto& [capture, moves] : all) {
    const CaptureMove* likely = clearest(moves, kDeviations);
    if (likely != nullptr && (!found.likeliest || likely->gain > found.likeliest->gain))
      found.likeliest = *likely;
    while (const CaptureMove* clear = clearest(moves, kDeviations * usual)) {
      found.clear.push_back(*clear);
      // It draws its partners along: these are asked again without it.
      of_capture[capture] = without_moved(of_capture[capture], found.clear);
      moves = moves_in(result, capture, of_capture[capture]);
    }
  }
  return found;
}

bool has_moved(const std::vector<CaptureMove>& moves, std::size_t device, std::size_t capture) {
  return std::any_of(moves.begin(), moves.end(), [&](const CaptureMove& m) {
    return m.device == device && m.capture == capture;
  });
}

std::vector<Track> without_moved(const std::vector<Track>& tracks,
                                 const std::vector<CaptureMove>& moves) {
  std::vector<Track> kept;
  for (const Track& track : tracks) {
    if (has_moved(moves, track.views[0].device, track.capture)) continue;
    Track rest{{}, track.capture};
    for (const TrackView& view : track.views)
      if (!has_moved(moves, view.device, track.capture)) rest.views.push_back(view);
    if (rest.views.size() > 1) kept.push_back(std::move(rest));
  }
  return kept;
}

}  // namespace pencilscan
