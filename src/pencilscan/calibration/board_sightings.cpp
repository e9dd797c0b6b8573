#include "pencilscan/calibration/board_sightings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <utility>

#include "pencilscan/bundle/board_corners.h"
#include "pencilscan/bundle/bundle_device.h"

namespace pencilscan {
namespace {

/// Sum of the squared errors of a sighting's corners.
double misses(const BundleProblem& problem, const BoardSighting& s) {
  double sum = 0;
  for (const std::size_t i : s.views)
    sum += corner_error(problem, problem.board_views[i]).squaredNorm();
  return sum;
}

/// Numbers the corners from the other end: half a turn of the board, whose last corner is that of
/// all views. A sighting may lack corners.
void turn_round(const BoardSighting& s, std::vector<BoardView>& views) {
  Vec2 last = Vec2::Zero();
  for (const BoardView& view : views) last = last.cwiseMax(view.position_mm);
  for (const std::size_t i : s.views) views[i].position_mm = last - views[i].position_mm;
}

/// Boards that present devices see get poses, and the corners of all others that see one agree on
/// its end.
void place_boards(const std::vector<BoardSighting>& sightings, std::vector<char>& has_pose,
                  BundleProblem& problem) {
  for (const BoardSighting& s : sightings) {
    const BundleDevice& device = problem.devices[s.device];
    if (!device.present) continue;
    if (has_pose[s.board] != 0) {
      agree_on_end(s, problem);
      continue;
    }
    const auto pose = camera_from_board(problem, s);
    if (!pose) continue;
    problem.board_poses[s.board] = pose_from(transform_from(device.pose).inverse() * *pose);
    has_pose[s.board] = 1;
  }
}

/// Sum of the squared errors of sightings of one device, each numbered from the end that fits.
double least_misses(const std::vector<BoardSighting>& sightings, BundleProblem& problem) {
  double sum = 0;
  for (const BoardSighting& s : sightings) {
    const double as_is = misses(problem, s);
    turn_round(s, problem.board_views);
    sum += std::min(as_is, misses(problem, s));
    turn_round(s, problem.board_views);
  }
  return sum;
}

/// Puts an absent device where its sightings of boards with poses fit best together: each gives a
/// pose for either end of the board. One alone does not tell the end.
bool join_by_boards(const std::vector<BoardSighting>& sightings, std::size_t d,
                    BundleProblem& problem) {
  BundleDevice& device = problem.devices[d];
  BundleDevice best = device;
  double least = std::numeric_limits<double>::infinity();
  constexpr double kBetter = 0.999;  // both ends of one board differ by rounding
  for (const BoardSighting& s : sightings) {
    for (int end = 0; end < 2; ++end) {
      if (const auto pose = camera_from_board(problem, s)) {
        const RigidTransform p = *pose * transform_from(problem.board_poses[s.board]).inverse();
        set_pose(device, p.rotation, p.translation);
        const double sum = least_misses(sightings, problem);
        if (sum < kBetter * least) {
          least = sum;
          best = device;
        }
      }
      turn_round(s, problem.board_views);
    }
  }
  device = best;
  device.present = std::isfinite(least);
  return device.present;
}

/// Joins the absent device that sees most corners of boards with poses, of those that can be;
/// false: none can.
bool join_next(const std::vector<BoardSighting>& sightings, const std::vector<char>& has_pose,
               BundleProblem& problem) {
  std::map<std::size_t, std::vector<BoardSighting>> by_device;
  for (const BoardSighting& s : sightings)
    if (!problem.devices[s.device].present && has_pose[s.board] != 0)
      by_device[s.device].push_back(s);
  const auto corners = [&](std::size_t d) {
    std::size_t sum = 0;
    for (const BoardSighting& s : by_device.at(d)) sum += s.views.size();
    return sum;
  };
  std::vector<std::size_t> absent;
  for (const auto& [d, seen] : by_device) absent.push_back(d);
  std::stable_sort(absent.begin(), absent.end(),
                   [&](std::size_t a, std::size_t b) { return corners(a) > corners(b); });
  return std::any_of(absent.begin(), absent.end(),
                     [&](std::size_t d) { return join_by_boards(by_device.at(d), d, problem); });
}

}  // namespace

std::vector<BoardSighting> sightings_of(const std::vector<BoardView>& views) {
  std::map<std::pair<std::size_t, std::size_t>, BoardSighting> by_key;
  for (std::size_t i = 0; i < views.size(); ++i) {
    BoardSighting& s = by_key[{views[i].board, views[i].view.device}];
    s.board = views[i].board;
    s.device = views[i].view.device;
    s.views.push_back(i);
  }
  std::vector<BoardSighting> sightings;
  for (auto& [key, sighting] : by_key) sightings.push_back(std::move(sighting));
  return sightings;
}

std::optional<RigidTransform> camera_from_board(const BundleProblem& problem,
                                                const BoardSighting& s) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> rays;
  for (const std::size_t i : s.views) {
    const BoardView& v = problem.board_views[i];
    points.emplace_back(v.position_mm.x(), v.position_mm.y(), 0);
    const Vec3 ray = device_ray(problem.devices[s.device], v.view.pixel);
    rays.emplace_back(ray.x(), ray.y());
  }
  cv::Mat rotation_vector;
  cv::Mat translation;
  const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
  if (!cv::solvePnP(points, rays, identity, cv::noArray(), rotation_vector, translation, false,
                    cv::SOLVEPNP_IPPE))
    return std::nullopt;
  cv::solvePnPRefineLM(points, rays, identity, cv::noArray(), rotation_vector, translation);
  cv::Mat R;
  cv::Rodrigues(rotation_vector, R);
  RigidTransform pose;
  cv::cv2eigen(R, pose.rotation);
  cv::cv2eigen(translation, pose.translation);
  if (!pose.rotation.allFinite() || !(pose.translation.z() > 0)) return std::nullopt;
  return pose;
}

void agree_on_end(const BoardSighting& s, BundleProblem& problem) {
  const double as_is = misses(problem, s);
  turn_round(s, problem.board_views);
  if (misses(problem, s) >= as_is) turn_round(s, problem.board_views);
}

std::vector<char> grow_from_boards(BundleProblem& problem) {
  std::vector<char> has_pose(problem.board_poses.size(), 0);
  const std::vector<BoardSighting> sightings = sightings_of(problem.board_views);
  if (sightings.empty()) return has_pose;
  if (present_devices(problem) == 0) has_pose[sightings.front().board] = 1;
  do {
    place_boards(sightings, has_pose, problem);
  } while (join_next(sightings, has_pose, problem));
  return has_pose;
}

}  // namespace pencilscan
